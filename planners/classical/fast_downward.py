# SPDX-License-Identifier: GPL-3.0-or-later
"""The optimal cost of a task by Fast Downward: the independent cross-check.

Fast Downward comes with up-fast-downward.  It gets the classical task as PDDL and runs in a process
group and a directory of its own, so that nothing of it is left behind, whatever happens: no file,
no output, no process.
"""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import tempfile
from contextlib import ExitStack, suppress
from importlib.util import find_spec
from pathlib import Path

from planners.classical import compile_classical
from planners.classical.task import LONGEST, ClassicalTask, action_names, to_pddl
from planners.joint.model import JointModel, PlanningTask
from planners.system.errors import CoordlangError, OutOfMemory
from planners.system.limits import default_memory_limit, has_memory_limit, memory_left, more_memory
from planners.system.signals import postponed_signals

#: A* finds an optimal plan with any admissible heuristic.  Of 111 shipped, foreign and small CoDMAP
#: rows blind search decided 95 in 20 s, LM-cut 94: in select-then-apply LM-cut sees little of the
#: makespan (taxi, sokoban, wireless); of the rows of logistics, which have many states, only LM-cut
#: decided some.
SEARCH = "astar(blind())"
#: Fast Downward adds up costs in 32-bit integers.
_GREATEST = 2**31 - 1
#: What Fast Downward writes below the actions of a whole plan: less than 0 if the sum is too large.
_COST = re.compile(r"; cost = (-?\d+) \((?:general|unit) cost\)")
#: The exit codes with which its translator and its search say that there is no plan, and that they
#: had too little memory; the last one: the system has killed them.
_UNSOLVABLE = (10, 11)
_OUT_OF_MEMORY = (20, 22, 256 - signal.SIGKILL)
#: The end of a message that is worth showing.
_TAIL = 1500
#: Bytes that are more than what a crash may be blamed on.
_MUCH = 2 << 30
#: How Python and the loader say that there is too little memory.
_NO_MEMORY = re.compile("MemoryError|out of memory|allocat|failed to map", re.IGNORECASE)
#: How Python and the translator say that a file cannot be written.
_NO_SPACE = re.compile("No space left on device|File too large|Disk quota exceeded")
#: What to do where Fast Downward says nothing, or where a file of it is not whole.
_SILENT = "Run `pip install --force-reinstall up-fast-downward` and try again."
_FULL = "See whether the disk of the temporary directory (TMPDIR) is full."


class FastDownwardFailed(CoordlangError):
    """Fast Downward gave no answer: the cost is neither confirmed nor refuted."""

    exit_code = 3


def optimal_cost(
    model: JointModel, task: PlanningTask
) -> tuple[tuple[int, int] | None, ClassicalTask]:
    """The optimal cost of a task according to Fast Downward, and the classical task that it got.

    A cost is (makespan, second component), None if there is no plan.  It stops where the
    `planners.system.limits.time_limit` around is over; its translator and its search may have the
    memory that this process may have.  No process is left behind.

    Raises `FastDownwardFailed`, with the end of what it said, if it broke down.
    """
    longest = LONGEST
    while True:
        classical = compile_classical(model, task, longest=longest)
        total = total_cost(classical)
        cost = None if total is None else classical.cost(total)
        if total is None or cost is not None:
            return cost, classical
        # No optimal plan has more steps than this one seems to have, so the second round is the
        # last.
        longest = total // classical.step_cost


def total_cost(classical: ClassicalTask) -> int | None:
    """The total cost of an optimal plan by Fast Downward, None without one; see `optimal_cost`."""
    _require_small(classical, max((action.cost for action in classical.actions), default=0))
    with postponed_signals() as signals, ExitStack() as ended:
        directory = _written(classical, ended)
        process = _started(directory)
        try:
            with signals.heard():
                code = process.wait()
        finally:
            _end(process)
        total = answered(classical, directory, code)
    if total is not None:
        _require_small(classical, total)
    return total


def _require_small(classical: ClassicalTask, cost: int) -> None:
    """Raise `FastDownwardFailed` for a cost beside which one more step is too much."""
    if cost + classical.step_cost > _GREATEST:
        raise FastDownwardFailed(
            f"a cost of {cost} is too large for Fast Downward's 32-bit integers",
            remedy="Check with --cost makespan.",
        )


def _written(classical: ClassicalTask, ended: ExitStack) -> Path:
    """A directory with the task, for all that Fast Downward writes; it goes with ``ended``."""
    try:
        directory = Path(ended.enter_context(tempfile.TemporaryDirectory(prefix="coordlang-")))
        for file, text in zip(("domain", "problem"), to_pddl(classical), strict=True):
            (directory / f"{file}.pddl").write_text(text)
    except OSError as error:
        raise FastDownwardFailed(
            f"the task for Fast Downward cannot be written: {error.strerror}",
            remedy="Set TMPDIR to a folder with free space that you may write to.",
        ) from None
    return directory


def _started(directory: Path) -> subprocess.Popen[bytes]:
    """Fast Downward at work in a process group of its own."""
    found = find_spec("up_fast_downward")
    if found is None or found.origin is None:
        raise FastDownwardFailed("up-fast-downward is not installed", remedy=_SILENT)
    worker = Path(__file__).with_name("fast_downward_worker.py")
    driver = Path(found.origin).with_name("downward") / "fast-downward.py"
    memory = []
    if not has_memory_limit():  # else it has the limit of this process
        memory = ["--overall-memory-limit", f"{default_memory_limit() >> 10}K"]
    # A search for invariants among facts without arguments takes seconds and gains nothing.
    options = ["--translate-options", "--invariant-generation-max-time", "0"]
    try:
        with (directory / "log").open("wb") as log:
            return subprocess.Popen(
                [
                    *(sys.executable, "-P", str(worker)),
                    *(sys.executable, str(driver), *memory, "--plan-file", "plan"),
                    *("domain.pddl", "problem.pddl", *options),
                    *("--search-options", "--search", SEARCH),
                ],
                cwd=directory,
                env={**os.environ, "PYTHONHASHSEED": "0", "TMPDIR": str(directory)},
                stdin=subprocess.PIPE,  # ends when we do; then the worker ends its group
                stdout=log,
                stderr=log,
                start_new_session=True,
            )
    except OSError as error:
        raise FastDownwardFailed(
            f"a process for Fast Downward cannot be started: {error.strerror}",
            remedy="End other programs, or allow more processes (`ulimit -u`).",
        ) from None


def _end(process: subprocess.Popen[bytes]) -> None:
    """End its process group at once."""
    with suppress(ProcessLookupError, PermissionError):
        os.killpg(process.pid, signal.SIGKILL)
    assert process.stdin is not None, "a pipe that was asked for"
    process.stdin.close()
    process.wait()


def answered(classical: ClassicalTask, directory: Path, code: int) -> int | None:
    """The cost of the plan in a directory in which Fast Downward has ended with this exit code.

    None if there is no plan.  The plan is executed before its cost is believed.
    """
    if code in _UNSOLVABLE:
        return None
    if code:
        raise _crash(code, (directory / "log").read_text(errors="replace"))
    plan = directory / "plan"
    *actions, last = (plan.read_text() if plan.exists() else "").splitlines() or [""]
    cost = _COST.fullmatch(last)
    if cost is None:
        raise FastDownwardFailed("the plan of Fast Downward is not complete", remedy=_FULL)
    number = {f"({name} )": n for n, name in enumerate(action_names(classical))}
    total = classical.cost_of_plan([number.get(line, -1) for line in actions])
    if total is None or (total != int(cost[1]) and total <= _GREATEST):
        raise FastDownwardFailed(
            f"Fast Downward wrote {len(actions)} actions that are no plan of its task", remedy=_FULL
        )
    return total


def _crash(code: int, said: str) -> CoordlangError:
    """The error for an exit code that is no answer, with the end of what was said."""
    # A limit of this process holds for all below it, and libraries crash in many ways when they
    # meet it.
    tight = has_memory_limit() and memory_left() < _MUCH
    full = _NO_SPACE.search(said)
    if code in _OUT_OF_MEMORY or (not full and (tight or _NO_MEMORY.search(said))):
        return OutOfMemory(
            "Fast Downward needs more memory than it may use", remedy=f"Use {more_memory()}."
        )
    return FastDownwardFailed(
        f"Fast Downward ended with exit code {code}", remedy=said[-_TAIL:].strip() or _SILENT
    )
