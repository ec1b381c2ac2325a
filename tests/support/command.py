# SPDX-License-Identifier: GPL-3.0-or-later
"""The command line: in this process, and as a process of its own."""

from __future__ import annotations

import os
import pty
import subprocess
import sys
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Outcome:
    """What a command ended with."""

    code: int
    out: str
    err: str


Command = Callable[..., Outcome]

#: Signals are heard even where this process ignores them, as jobs of a shell and under nohup do.
_MAIN = """
import signal
signal.signal(signal.SIGHUP, signal.SIG_DFL)
signal.signal(signal.SIGINT, signal.default_int_handler)
from coordlang.__main__ import main
main()
"""


def own_process(*arguments: object) -> list[str]:
    """The program and arguments that run ``coordlang ..`` as a process of its own."""
    return [sys.executable, "-c", _MAIN, *map(str, arguments)]


def on_a_terminal(
    command: list[str],
    heard: Callable[[str, subprocess.Popen[str]], object] = lambda _said, _process: None,
    environment: Mapping[str, str] = {},
) -> Outcome:
    """Run a command whose stderr is a terminal; ``heard`` is told all that it got, piece by piece."""
    terminal, end = pty.openpty()
    process = subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=end, text=True, env={**os.environ, **environment}
    )
    os.close(end)
    said = b""
    with suppress(OSError):  # nobody has the other end of the terminal any more
        while piece := os.read(terminal, 4096):
            said += piece
            heard(said.decode(errors="replace"), process)
    os.close(terminal)
    out, _ = process.communicate(timeout=60)
    return Outcome(process.returncode, out, said.decode())


def program(path: Path, text: str) -> Path:
    """A script of the shell that can be run."""
    path.write_text(f"#!/bin/sh\n{text}\n")
    path.chmod(0o755)
    return path


def in_shell(script: str, *arguments: object, before: str = "") -> subprocess.CompletedProcess[str]:
    """Run ``script``, in which COORDLANG stands for a command, after ``before``."""
    program = script.replace("COORDLANG", f'{sys.executable} -m coordlang "$@"')
    return subprocess.run(
        ["bash", "-c", f"set -o pipefail; {before} {program}", "bash", *map(str, arguments)],
        capture_output=True,
        text=True,
        timeout=120,
    )
