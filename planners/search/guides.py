# SPDX-License-Identifier: GPL-3.0-or-later
"""What the search for optimal plans is bounded by, by name, and which one suits a task."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from planners.errors import UsageError
from planners.joint.model import JointModel, PlanningTask
from planners.search.bounds import relaxed
from planners.search.guide import Bound, Guide
from planners.search.plan_formula import may_be_exact
from planners.search.projections import Projections
from planners.search.state_variables import StateVariable
from planners.tables import Ints, Rows

#: The names of all guides; ``auto`` chooses one.
GUIDES = ("auto", "blind", "projections", "relaxed")

#: Joint steps that are composed to compare bounds, at most.
_STEPS = 200_000


def guide_for(
    name: str, model: JointModel, task: PlanningTask, variables: Sequence[StateVariable]
) -> Guide:
    """The guide of this name for a task."""
    if name == "blind":
        return Guide("blind")
    projections = Projections(model, task.goal, variables)
    cost_left = None if model.cost == "makespan" else projections.cost_left
    if name == "projections":
        return Guide(name, projections.value, projections.in_time, cost_left=cost_left)
    if name not in GUIDES:
        raise UsageError(f"there is no heuristic {name}", remedy=f"One of {', '.join(GUIDES)}.")
    hmax = relaxed(model, task.goal)
    start = task.init[None, :]
    if name == "auto" and not max(hmax(start)[0], projections.value(start)[0]):
        return Guide("blind", exact=may_be_exact(model))
    if name == "auto" and _as_good(model, task, projections, hmax):
        return Guide(
            "projections", projections.value, projections.in_time, may_be_exact(model), cost_left
        )

    def both(rows: Rows) -> Ints:
        return np.maximum(projections.value(rows), hmax(rows))

    exact = name == "auto" and may_be_exact(model)
    return Guide("relaxed", both, projections.in_time, exact, cost_left)


def _as_good(model: JointModel, task: PlanningTask, projections: Projections, hmax: Bound) -> bool:
    """Whether the projections say as much as h^max in the first states of the search.

    No, where robots have so many joint steps there that not even these are composed.
    """
    rows = task.init[None, :]
    for _ in range(2):
        if (projections.value(rows) < hmax(rows)).any():
            return False
        rows = rows[:20]
        if model.stepper.most_steps(model.codec.facts_part(rows)) > _STEPS:
            return False
        rows = model.successors(rows).result[:2_000]
        if not len(rows):
            break
    return True
