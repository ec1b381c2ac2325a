# SPDX-License-Identifier: GPL-3.0-or-later
"""Two optimal searches of Fast Downward for one classical task: the first whole answer counts.

A* finds an optimal plan with any admissible heuristic, and none is the best everywhere.  In the
select-then-apply form LM-cut sees little of the makespan, and mostly costs more than it saves
(docs/coverage.md); where few robots have many states, only LM-cut may end.

unified-planning runs in child processes, each in a group and a directory of its own, so that
nothing of them is left behind, whatever happens: no file, no output, no process.
"""

from __future__ import annotations

import json
import math
import os
import re
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from multiprocessing.connection import wait
from pathlib import Path
from typing import IO, Any

from planners.classical.task import ClassicalTask
from planners.errors import CoordlangError, OutOfMemory, OutOfTime
from planners.limits import default_memory_limit, has_memory_limit, memory_left, more_memory
from planners.signals import Postponed, postponed_signals

#: The searches in the order in which they are begun, and how many seconds after the first.  Blind
#: search comes first: on most tasks of CoDMAP that both decide within a minute it was faster than
#: LM-cut, by up to 19 times.
SEARCHES = (("astar(blind())", 0.0), ("astar(lmcut())", 3.0))
#: The end of a message that is worth showing.
_TAIL = 1500
#: numpy, which unified-planning imports, would reserve memory for a thread per processor.
_ENVIRONMENT = {"PYTHONHASHSEED": "0", "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
#: Bytes that are more than what a crash may be blamed on.
_MUCH = 2 << 30
#: How Python, the loader and numpy say that a limit of the calling process leaves them too little
#: memory.
_NO_MEMORY = re.compile(
    "MemoryError|out of memory|allocat|failed to map|start new thread", re.IGNORECASE
)
#: How Python and the translator say that a file cannot be written.
_NO_SPACE = re.compile("No space left on device|File too large|Disk quota exceeded")
#: What to do where Fast Downward says nothing.
_SILENT = "Run `pip install --force-reinstall up-fast-downward` and try again."
#: What to do where a file of it is not whole.
_FULL = "See whether the disk of the temporary directory (TMPDIR) is full."


class FastDownwardFailed(CoordlangError):
    """Fast Downward gave no answer.

    The cost that was to be checked is neither confirmed nor refuted.
    """

    exit_code = 3


def first_answer(
    classical: ClassicalTask,
    left: float | None = None,
    time_limit: float | None = None,
    memory_limit: int | None = None,
) -> list[int] | None:
    """An optimal plan (numbers of actions) by the search that ends first, None if there is no plan.

    The plan is executed.  A search that breaks down is no answer: the others go on.

    Parameters
    ----------
    left, time_limit
        Seconds of wall time for all of it; what to call the limit in an error.
    memory_limit
        Bytes of address space for each translator and each search.  None: those of this process,
        or its share of most of what the machine has free.

    Raises
    ------
    OutOfTime, OutOfMemory
        A limit is met.  No process is left behind.
    FastDownwardFailed
        All searches broke down; the end of what one of them said is in the message.
    """
    if memory_limit is None and not has_memory_limit():
        memory_limit = default_memory_limit() // len(SEARCHES)
    with postponed_signals() as signals, _directory() as directory:
        try:
            (directory / "task.json").write_text(as_json(classical, memory_limit))
        except OSError as error:
            raise _unwritten(error) from None
        race = _Race(classical, directory, signals)
        try:
            return race.winner(math.inf if left is None else left)
        except _TimeIsOver:
            raise OutOfTime(
                f"Fast Downward found no answer in {time_limit:g} s",
                remedy="Use a larger --time-limit.",
            ) from None
        finally:
            race.end()


def as_json(classical: ClassicalTask, memory_limit: int | None) -> str:
    """The task as `planners.classical.fast_downward_worker` reads it; names stay here."""
    return json.dumps(
        {
            "facts": len(classical.facts),
            "init": sorted(classical.init),
            "actions": [(a.preconditions, a.adds, a.deletes, a.cost) for a in classical.actions],
            "goal": classical.goal,
            "memory_limit": memory_limit,
        }
    )


@contextmanager
def _directory() -> Iterator[Path]:
    """A directory for all that the searches write."""
    try:
        directory = tempfile.TemporaryDirectory(prefix="coordlang-")
    except OSError as error:
        raise _unwritten(error) from None
    with directory as name:
        yield Path(name)


class _TimeIsOver(Exception):
    """The searches ran for as long as they may."""


class _Race:
    """The searches that run; `end` ends them all."""

    def __init__(self, classical: ClassicalTask, directory: Path, signals: Postponed) -> None:
        self._classical = classical
        self._directory = directory
        self._signals = signals
        self._running: list[_Worker] = []

    def winner(self, seconds: float) -> list[int] | None:
        """The first answer, or the error of a search if none has one.  Raises `_TimeIsOver`."""
        begin = time.monotonic()
        coming = list(SEARCHES)
        failures: list[CoordlangError] = []
        while coming or self._running:
            if coming and (not self._running or time.monotonic() >= begin + coming[0][1]):
                search, _ = coming.pop(0)
                try:
                    self._running.append(_Worker(self._directory / str(len(coming)), search))
                except CoordlangError as error:
                    failures.append(error)
                    continue
            now = time.monotonic() - begin
            if now >= seconds:
                raise _TimeIsOver
            for worker in self._ended(min([seconds, *(after for _, after in coming)]) - now):
                self._running.remove(worker)
                try:
                    return answered(self._classical, worker.folder, worker.end())
                except CoordlangError as error:
                    failures.append(error)
        raise next((e for e in failures if isinstance(e, OutOfMemory)), failures[0])

    def _ended(self, seconds: float) -> list[_Worker]:
        """The searches that end within so many seconds.  Signals are heard meanwhile."""
        pipes = {worker.pipe: worker for worker in self._running}
        with self._signals.heard():
            ready = wait(list(pipes), None if math.isinf(seconds) else max(seconds, 0.0))
        return [worker for pipe, worker in pipes.items() if pipe in ready]

    def end(self) -> None:
        """End what still runs."""
        while self._running:
            self._running.pop().end()


class _Worker:
    """A process group in which Fast Downward searches; ``pipe`` ends when it does.

    Parameters
    ----------
    folder
        Made for it.
    search
        What Fast Downward gets as ``--search``.
    """

    def __init__(self, folder: Path, search: str) -> None:
        self.folder = folder
        try:
            folder.mkdir()
            errors = (folder / "stderr").open("wb")
        except OSError as error:
            raise _unwritten(error) from None
        #: Ends when the worker does: nobody writes to it, whatever libraries print.
        self.pipe, lifeline = os.pipe()
        try:
            with errors:
                self._process = _started(folder, search, errors, lifeline)
        except OSError as error:
            os.close(self.pipe)
            raise FastDownwardFailed(
                f"a process for Fast Downward cannot be started: {error.strerror}",
                remedy="End other programs, or allow more processes (`ulimit -u`).",
            ) from None
        finally:
            os.close(lifeline)

    def end(self) -> int:
        """End its process group at once, wait for the worker, return its exit code."""
        if self.pipe in wait([self.pipe], 0):  # it ends by itself, and its code is wanted
            self._process.wait()
        with suppress(ProcessLookupError, PermissionError):
            os.killpg(self._process.pid, signal.SIGKILL)
        assert self._process.stdin is not None, "a pipe that was asked for"
        self._process.stdin.close()
        os.close(self.pipe)
        return self._process.wait()


def _started(
    folder: Path, search: str, errors: IO[bytes], lifeline: int
) -> subprocess.Popen[bytes]:
    """The process of a worker, which alone has the writing end of a pipe."""
    home = str(Path(__file__).resolve().parents[2])
    path = os.pathsep.join(p for p in (home, os.environ.get("PYTHONPATH")) if p)
    return subprocess.Popen(
        [
            sys.executable,
            "-P",  # by its path: the package around it loads numpy, which it does not need
            str(Path(__file__).with_name("fast_downward_worker.py")),
            "../task.json",
            "result.json",
            search,
        ],
        cwd=folder,
        # What the worker's libraries put into a temporary directory goes away with this one.
        env={**os.environ, **_ENVIRONMENT, "PYTHONPATH": path, "TMPDIR": str(folder)},
        stdin=subprocess.PIPE,  # ends when we do; then the worker ends its group
        stdout=errors,
        stderr=errors,
        pass_fds=(lifeline,),
        start_new_session=True,
    )


def answered(classical: ClassicalTask, folder: Path, code: int) -> list[int] | None:
    """The plan in the folder of a worker that ended with this code; see `first_answer`."""
    result = folder / "result.json"
    if not result.exists():
        said = (folder / "stderr").read_text(errors="replace")
        if code == -signal.SIGKILL:  # not by us: by the system, which is out of memory
            raise _out_of_memory()
        raise _crash(f"the process that runs Fast Downward ended with exit code {code}", said)
    answer = _read_answer(result)
    match answer["status"]:
        case "solved":
            plan: list[int] = answer["plan"]
            if classical.cost_of_plan(plan) is None:  # part of a plan, on a full disk
                raise FastDownwardFailed(
                    f"Fast Downward wrote {len(plan)} actions that are no plan of its task",
                    remedy=_FULL,
                )
            return plan
        case "unsolvable":
            return None
        case "memory":
            raise _out_of_memory()
    raise _crash(f"Fast Downward {answer['status']}", answer["log"])


def _read_answer(result: Path) -> dict[str, Any]:
    """What the worker wrote: its JSON ends with a bracket, so that no part of it is JSON."""
    try:
        answer: dict[str, Any] = json.loads(result.read_bytes())
    except ValueError as error:
        raise FastDownwardFailed(
            f"the answer of Fast Downward is not complete: {error}", remedy=_FULL
        ) from None
    return answer


def _unwritten(error: OSError) -> FastDownwardFailed:
    return FastDownwardFailed(
        f"the task for Fast Downward cannot be written: {error.strerror}",
        remedy="Set TMPDIR to a folder with free space that you may write to.",
    )


def _crash(what: str, said: str) -> CoordlangError:
    """The error for a process that gave no answer, with the end of what it said."""
    # A limit of this process holds for all below it, and libraries crash in many ways when they
    # meet it.
    tight = has_memory_limit() and memory_left() < _MUCH
    if not _NO_SPACE.search(said) and (tight or _NO_MEMORY.search(said)):
        return _out_of_memory()
    return FastDownwardFailed(what, remedy=said[-_TAIL:].strip() or _SILENT)


def _out_of_memory() -> OutOfMemory:
    return OutOfMemory(
        "Fast Downward needs more memory than it may use", remedy=f"Use {more_memory()}."
    )
