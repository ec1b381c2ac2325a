# SPDX-License-Identifier: GPL-3.0-or-later
"""The optimal cost of a task by Fast Downward: the independent cross-check."""

from __future__ import annotations

import time
from dataclasses import dataclass

from planners.classical import LONGEST, ClassicalTask, Form, compile_classical
from planners.classical.fast_downward_searches import FastDownwardFailed, first_answer
from planners.joint.model import JointModel, PlanningTask

__all__ = ["FastDownwardAnswer", "FastDownwardFailed", "optimal_cost", "total_cost"]

#: Fast Downward adds up costs in 32-bit integers.
_GREATEST = 2**31 - 1


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


def _solve(
    classical: ClassicalTask, left: float | None, time_limit: float | None, memory_limit: int | None
) -> int | None:
    """The cost of an optimal plan of a classical task, None if there is no plan."""
    plan = first_answer(classical, left, time_limit, memory_limit)
    if plan is None:
        return None
    total = classical.cost_of_plan(plan)
    assert total is not None, "a plan that was executed is none"
    if total + classical.step_cost > _GREATEST:
        raise FastDownwardFailed(
            f"a cost of {total} is too large for Fast Downward's 32-bit integers",
            remedy="Check with --cost makespan.",
        )
    return total
