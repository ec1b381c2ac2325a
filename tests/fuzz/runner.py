# SPDX-License-Identifier: GPL-3.0-or-later
"""Commands are run in a worker process, now and then in one of their own, under limits."""

from __future__ import annotations

import json
import os
import select
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tests.fuzz.mutants import TIME_LIMIT
from tests.support.command import own_process
from tests.support.domains import ROOT

#: Seconds beyond the limit before a run counts as a hang.
GRACE = 3
#: Runs after which the worker is replaced, so that memory it has kept does not count as a mutant's.
_WORKER_LIFE = 150


@dataclass(frozen=True)
class Outcome:
    """What a run did; ``code`` is None for one that had to be killed or that died."""

    code: int | None
    out: str
    err: str
    seconds: float
    left: tuple[str, ...] = ()


class Runner:
    """Runs commands in a worker process, or now and then in one of their own."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._worker: subprocess.Popen[str] | None = None
        self._age = 0
        for name in ("work", "tmp"):
            (folder / name).mkdir()

    def close(self) -> None:
        if self._worker is not None:
            self._worker.kill()
            self._worker.communicate()
            self._worker = None

    def run(self, arguments: Sequence[str], *, fresh: bool) -> Outcome:
        """Run ``coordlang ARGUMENTS`` in the folder ``work``."""
        out, err = self._folder / "out", self._folder / "err"
        for path in (out, err):
            path.write_bytes(b"")
        start = time.perf_counter()
        code = self._once(arguments, out, err) if fresh else self._ask(arguments, out, err)
        seconds = time.perf_counter() - start
        return Outcome(code, _text(out), _text(err), seconds, tuple(self._leftovers()))

    def _environment(self) -> dict[str, str]:
        return {
            **os.environ,
            "TMPDIR": str(self._folder / "tmp"),
            "PYTHONPATH": str(ROOT),
            "PYTHONFAULTHANDLER": "1",
        }

    def _once(self, arguments: Sequence[str], out: Path, err: Path) -> int | None:
        command = own_process(*arguments)
        with out.open("wb") as to, err.open("wb") as errors:
            process = subprocess.Popen(
                command,
                stdin=subprocess.DEVNULL,
                stdout=to,
                stderr=errors,
                cwd=self._folder / "work",
                env=self._environment(),
                start_new_session=True,
            )
            try:
                return process.wait(TIME_LIMIT + GRACE)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
                return None

    def _ask(self, arguments: Sequence[str], out: Path, err: Path) -> int | None:
        self._age += 1
        if self._age > _WORKER_LIFE:
            self.close()
        if self._worker is None:
            self._age = 0
            self._worker = subprocess.Popen(
                [sys.executable, "-m", "tests.fuzz.worker"],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                text=True,
                cwd=self._folder / "work",
                env=self._environment(),
            )
            self._answer(30)
        worker = self._worker
        assert worker.stdin is not None
        worker.stdin.write(
            json.dumps({"arguments": list(arguments), "out": str(out), "err": str(err)}) + "\n"
        )
        worker.stdin.flush()
        answer = self._answer(TIME_LIMIT + GRACE)
        if answer is None:
            self.close()
            return None
        return int(answer["code"])

    def _answer(self, seconds: float) -> dict[str, Any] | None:
        assert self._worker is not None
        assert self._worker.stdout is not None
        ready, _, _ = select.select([self._worker.stdout], [], [], seconds)
        line = self._worker.stdout.readline() if ready else ""
        return json.loads(line) if line else None

    def _leftovers(self) -> Iterator[str]:
        for path in (self._folder / "tmp").iterdir():
            yield f"tmp/{path.name}"
            shutil.rmtree(path) if path.is_dir() else path.unlink()
        for path in (self._folder / "work").iterdir():
            if path.name not in ("domain.pddl", "problem.pddl", "language.json"):
                yield f"work/{path.name}"
                path.unlink()
        if self._worker is not None and self._worker.poll() is None:
            try:
                children = (
                    Path(f"/proc/{self._worker.pid}/task/{self._worker.pid}/children")
                    .read_text()
                    .split()
                )
            except OSError:
                children = []
            yield from (f"process {pid}" for pid in children)


def _text(path: Path) -> str:
    return path.read_bytes().decode("utf-8", "replace")
