# SPDX-License-Identifier: GPL-3.0-or-later
"""A command is run in a fork of this process, now and then in a new interpreter, under limits."""

from __future__ import annotations

import os
import shutil
import signal
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from tests.fuzz.mutants import TIME_LIMIT
from tests.support.forks import fork_command, fresh_command

#: Seconds beyond the limit before a run counts as a hang.
GRACE = 3
#: What a run may read and write in its working directory.
FILES = ("domain.pddl", "problem.pddl", "language.json")


@dataclass(frozen=True)
class Outcome:
    """What a run did; ``code`` is None for one that had to be killed or that died."""

    code: int | None
    out: str
    err: str
    seconds: float
    left: tuple[str, ...] = ()


def run(folder: Path, arguments: Sequence[str], *, fresh: bool) -> Outcome:
    """Run ``coordlang ARGUMENTS`` in the folder ``work``."""
    for name in ("work", "tmp"):
        (folder / name).mkdir(exist_ok=True)
    command = fresh_command if fresh else fork_command
    start = time.perf_counter()
    process = command(*arguments, before=partial(_enter, folder))
    code = process.join(TIME_LIMIT + GRACE).code
    seconds = time.perf_counter() - start
    out, err = ((folder / name).read_text("utf-8", "replace") for name in ("out", "err"))
    left = (*_files_left(folder), *_processes_left(process.pid))
    return Outcome(None if code < 0 else code, out, err, seconds, left)


def _enter(folder: Path) -> None:
    """A session of its own, the folders for its files, and files for what it says."""
    os.setsid()
    os.chdir(folder / "work")
    os.environ["TMPDIR"] = str(folder / "tmp")
    tempfile.tempdir = None
    for number, name in ((1, "out"), (2, "err")):
        os.dup2(os.open(folder / name, os.O_WRONLY | os.O_CREAT | os.O_TRUNC), number)


def _files_left(folder: Path) -> Iterator[str]:
    for path in (*(folder / "tmp").iterdir(), *(folder / "work").iterdir()):
        if path.name not in FILES:
            yield str(path.relative_to(folder))
            shutil.rmtree(path) if path.is_dir() else path.unlink()


def _processes_left(session: int) -> Iterator[str]:
    """The processes of a session whose first one has ended; they are ended."""
    for path in Path("/proc").glob("[0-9]*/stat"):
        try:
            state, _, _, own = path.read_text().rpartition(")")[2].split()[:4]
        except OSError:
            continue
        if int(own) == session and state != "Z":
            yield f"process {path.parent.name}"
            os.kill(int(path.parent.name), signal.SIGKILL)
