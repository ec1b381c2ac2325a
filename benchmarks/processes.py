# SPDX-License-Identifier: GPL-3.0-or-later
"""Commands run as processes of their own, with their seconds and peak memory."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from time import perf_counter, sleep
from typing import Any

#: Seconds after which a process is ended.
MOST = 600


@dataclass(frozen=True, slots=True)
class Done:
    """What a process printed (JSON), its exit code, seconds and peak memory in MiB."""

    data: dict[str, Any]
    code: int
    seconds: float
    memory: int
    errors: str

    @property
    def cost(self) -> str:
        """The seconds and the memory, as text."""
        return f"{self.seconds:.1f} s {self.memory} MB"


def coordlang(*arguments: str) -> Done:
    """Run ``coordlang ARGUMENTS`` as a process of its own."""
    return run_python(("-c", "from coordlang.__main__ import main; main()", *arguments))


def run_python(arguments: Sequence[str], most: float = MOST, python: str = sys.executable) -> Done:
    """Run Python with these arguments, ``most`` seconds; what it prints is read as JSON."""
    start = perf_counter()
    with tempfile.TemporaryFile() as out, tempfile.TemporaryFile() as err:
        process = subprocess.Popen(
            [python, *arguments],
            stdout=out,
            stderr=err,
            stdin=subprocess.DEVNULL,
            start_new_session=True,
        )
        pid = 0
        while pid == 0:
            pid, status, usage = os.wait4(process.pid, os.WNOHANG)
            if pid == 0:
                sleep(0.02)
                if perf_counter() - start > most:
                    os.killpg(process.pid, signal.SIGKILL)
        process.returncode = os.waitstatus_to_exitcode(status)
        seconds = perf_counter() - start
        texts = []
        for stream in (out, err):
            stream.seek(0)
            texts.append(stream.read().decode())
    data = json.loads(texts[0]) if texts[0].startswith("{") else {}
    return Done(data, process.returncode, seconds, usage.ru_maxrss // 1024, texts[1])
