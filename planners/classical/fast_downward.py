# SPDX-License-Identifier: GPL-3.0-or-later
"""The optimal cost of a task by Fast Downward: the independent cross-check.

unified-planning runs in a child process of its own group and in a directory of its own, so that
nothing of it is left behind, whatever happens: no file, no output, no process.
"""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import tempfile
import time
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

from planners.classical import LONGEST, ClassicalTask, Form, compile_classical
from planners.errors import CoordlangError, OutOfMemory, OutOfTime
from planners.joint.model import JointModel, PlanningTask
from planners.limits import has_memory_limit, memory_left, more_memory
from planners.signals import Postponed, postponed_signals

#: Fast Downward adds up costs in 32-bit integers.
_GREATEST = 2**31 - 1
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


class FastDownwardFailed(CoordlangError):
    """Fast Downward gave no answer.

    The cost that was to be checked is neither confirmed nor refuted.
    """

    exit_code = 3


@dataclass(frozen=True, slots=True)
class FastDownwardAnswer:
    """What Fast Downward says of a task.

    Its optimal cost (makespan, second component), None if it is unsolvable.

    ``actions`` is the number of classical actions that it got, in the form ``form``; ``seconds``
    are wall time.
    """

    cost: tuple[int, int] | None
    form: Form
    actions: int
    seconds: float


def optimal_cost(
    model: JointModel,
    task: PlanningTask,
    *,
    time_limit: float | None = None,
    memory_limit: int | None = None,
    limit: int = 2000,
    longest: int = LONGEST,
) -> FastDownwardAnswer:
    """The optimal cost of a task according to Fast Downward.

    Parameters
    ----------
    time_limit, memory_limit
        Seconds of wall time for all of it; bytes of address space for Fast Downward's translator
        and its search.
    limit, longest
        See `planners.classical.compile_classical`; where a plan turns out to have more steps than
        ``longest``, it is asked again.

    Raises
    ------
    OutOfTime, OutOfMemory
        A limit is met.  No process is left behind.
    FastDownwardFailed
        unified-planning or Fast Downward broke down; the end of what they said is in the message.
    """
    start = time.monotonic()
    while True:
        classical = compile_classical(model, task, limit, longest)
        left = None if time_limit is None else time_limit - (time.monotonic() - start)
        total = _solve(classical, left, time_limit, memory_limit)
        cost = None if total is None else classical.cost(total)
        if total is None or cost is not None:
            return FastDownwardAnswer(
                cost, classical.form, len(classical.actions), time.monotonic() - start
            )
        # No optimal plan has more steps than this one seems to have, so the second round is the
        # last.
        longest = total // classical.step_cost


def total_cost(
    classical: ClassicalTask, *, time_limit: float | None = None, memory_limit: int | None = None
) -> int | None:
    """The total cost of an optimal plan by Fast Downward, None if there is no plan.

    See `optimal_cost`.
    """
    return _solve(classical, time_limit, time_limit, memory_limit)


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


def _solve(
    classical: ClassicalTask, left: float | None, time_limit: float | None, memory_limit: int | None
) -> int | None:
    """The cost of an optimal plan of a classical task, None if there is no plan."""
    task = as_json(classical, memory_limit)
    with ExitStack() as stack:
        signals = stack.enter_context(postponed_signals())
        try:
            directory = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="coordlang-")))
            (directory / "task.json").write_text(task)
            errors = stack.enter_context((directory / "stderr").open("wb"))
        except OSError as error:
            raise FastDownwardFailed(
                f"the task for Fast Downward cannot be written: {error.strerror}",
                remedy="Set TMPDIR to a folder with free space that you may write to.",
            ) from None
        try:
            code = _run(directory, errors, left, signals)
        except subprocess.TimeoutExpired:
            raise OutOfTime(
                f"Fast Downward found no answer in {time_limit:g} s",
                remedy="Use a larger --time-limit.",
            ) from None
        result = directory / "result.json"
        if not result.exists():
            said = (directory / "stderr").read_text(errors="replace")
            if code == -signal.SIGKILL:  # not by us: by the system, which is out of memory
                raise _out_of_memory()
            raise _crash(f"the process that runs Fast Downward ended with exit code {code}", said)
        answer = _read_answer(result)
    match answer["status"]:
        case "solved":
            return _checked_cost(classical, answer["plan"])
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
            f"the answer of Fast Downward is not complete: {error}",
            remedy="See whether the disk of the temporary directory (TMPDIR) is full.",
        ) from None
    return answer


def _checked_cost(classical: ClassicalTask, plan: list[int]) -> int:
    """The cost of Fast Downward's plan, which is executed: it writes part of one to a full disk."""
    total = classical.cost_of_plan(plan)
    if total is None:
        raise FastDownwardFailed(
            f"Fast Downward wrote {len(plan)} actions that are no plan of its task",
            remedy="See whether the disk of the temporary directory (TMPDIR) is full.",
        )
    if total + classical.step_cost > _GREATEST:
        raise FastDownwardFailed(
            f"a cost of {total} is too large for Fast Downward's 32-bit integers",
            remedy="Check with --cost makespan.",
        )
    return total


def _run(directory: Path, errors: BinaryIO, left: float | None, signals: Postponed) -> int:
    """Run the worker in a directory; its exit code.  It writes what is wrong to ``errors``.

    However this ends, the worker and its children are gone.  Signals are heard while it runs.
    """
    home = str(Path(__file__).resolve().parents[2])
    path = os.pathsep.join(p for p in (home, os.environ.get("PYTHONPATH")) if p)
    process = None
    try:
        process = subprocess.Popen(
            [
                sys.executable,
                "-P",  # by its path: the package around it loads numpy, which it does not need
                str(Path(__file__).with_name("fast_downward_worker.py")),
                "task.json",
                "result.json",
            ],
            cwd=directory,
            # What the worker's libraries put into a temporary directory goes away with this
            # one.
            env={**os.environ, **_ENVIRONMENT, "PYTHONPATH": path, "TMPDIR": str(directory)},
            stdin=subprocess.PIPE,  # ends when we do; then the worker ends its group
            stdout=subprocess.DEVNULL,
            stderr=errors,
            start_new_session=True,
        )
        with signals.heard():
            return process.wait(None if left is None else max(left, 0.0))
    finally:
        if process is not None:
            _end(process)


def _end(process: subprocess.Popen[bytes]) -> None:
    """End the process group of the worker at once and wait for the worker."""
    with suppress(ProcessLookupError, PermissionError):
        os.killpg(process.pid, signal.SIGKILL)
    if process.stdin is not None:
        process.stdin.close()
    process.wait()


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
