# SPDX-License-Identifier: GPL-3.0-or-later
"""What the search for a task's optimal plans would be bounded by, and what that leaves of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from planners.joint.model import JointModel, PlanningTask
from planners.search.bounds import FAR
from planners.search.guides import guide_for
from planners.search.layers import probe_size
from planners.search.reachable import PIECES
from planners.search.state_variables import state_variables
from planners.tables import Rows

#: States that are looked at, of all layers together.
_STATES = 2_000


@dataclass(frozen=True, slots=True)
class Outlook:
    """How a search would begin.

    Attributes
    ----------
    heuristic
        What `planners.search.guides` chooses.
    at_least
        Its lower bound on the makespan, in joint steps; None if it proves that there is no plan.
    within
        How many states of each of the first layers are within this bound.
    solver_after
        Joint steps within this bound, after which a SAT solver would be asked for the optimal cost;
        None if never.
    """

    heuristic: str
    at_least: int | None
    within: tuple[int, ...]
    solver_after: int | None


def outlook(model: JointModel, task: PlanningTask, layers: Sequence[Rows]) -> Outlook:
    """How a search for this task would begin; ``layers`` are the first ones, all states of each."""
    guide = guide_for("auto", model, task, state_variables(model, task.init))
    at_least = 0
    within: list[int] = []
    if guide.bound is not None:
        at_least = int(guide.bound(task.init[None, :])[0])
        left = _STATES
        for depth, rows in enumerate(layers):
            left -= len(rows)
            if left < 0 or at_least >= FAR or (within and not within[-1]):
                break
            within.append(int((guide.bound(rows) + depth <= at_least).sum()))
    return Outlook(
        guide.name,
        at_least if at_least < FAR else None,
        tuple(within),
        probe_size(model, at_least, PIECES) if guide.exact else None,
    )
