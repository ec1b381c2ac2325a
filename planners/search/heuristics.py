# SPDX-License-Identifier: GPL-3.0-or-later
"""The heuristics by name, for A* and for the search for all optimal plans.

Every one is admissible and consistent, is 0 in goal states and counts joint steps only.  Modules
are imported where they are used: the names are needed for ``--help``.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, get_args

from planners.system.errors import UsageError

if TYPE_CHECKING:
    from planners.joint.model import Goal, JointModel, Options, PlanningTask
    from planners.joint.tables import Ints, Rows
    from planners.search.goals import Values
    from planners.search.projections import Projections
    from planners.search.state_variables import StateVariable

HeuristicName = Literal["relaxed", "manhattan", "projections", "blind"]
#: What a search for all optimal plans takes; ``auto`` chooses one.
SearchHeuristic = Literal["auto", "relaxed", "manhattan", "projections", "blind"]
CHOICES: tuple[str, ...] = get_args(SearchHeuristic)

#: Joint steps that are composed to compare heuristics, at most.
_STEPS = 200_000


def _blind(model: JointModel, goal: Goal, projections: Projections) -> Values:
    """Nothing is known."""
    import numpy as np

    return lambda rows: np.zeros(len(rows), np.int64)


def _manhattan(model: JointModel, goal: Goal, projections: Projections) -> Values:
    from planners.search.manhattan import manhattan

    return manhattan(model, goal)


def _projections(model: JointModel, goal: Goal, projections: Projections) -> Values:
    return projections.value


def _relaxed(model: JointModel, goal: Goal, projections: Projections) -> Values:
    from planners.search.relaxed import relaxed

    return relaxed(model, goal)


#: Model, goal and what its projections say -> lower bounds on the joint steps left.
HEURISTICS: dict[str, Callable[[JointModel, Goal, Projections], Values]] = {
    "relaxed": _relaxed,
    "manhattan": _manhattan,
    "projections": _projections,
    "blind": _blind,
}


def heuristic(name: str, model: JointModel, goal: Goal, init: Rows) -> Values:
    """``HEURISTICS[name]`` for the states reachable from one; 0 exactly in goal states."""
    import numpy as np

    from planners.search.projections import Projections
    from planners.search.state_variables import state_variables

    projections = Projections(model, goal, state_variables(model, init))
    bound = HEURISTICS[name](model, goal, projections)

    def value(rows: Rows) -> Ints:
        return np.maximum(bound(rows), ~model.holds(goal, rows))

    return value


@dataclass(frozen=True, slots=True)
class Heuristic:
    """What a search for all optimal plans is bounded by; ``name`` is what messages call it.

    Where nothing is known (``value`` None) all states are searched, in one round.  ``in_time``
    keeps choices after which a robot's own variables need at most so many joint steps more, and
    says the least number that some other choice needs.  ``exact``: once the search has grown, a SAT
    solver finds the optimal cost and what leads to it.
    """

    name: str
    value: Values | None = None
    in_time: Callable[[Rows, Options, int], tuple[Options, int]] | None = None
    exact: bool = False


def search_heuristic(
    name: str, model: JointModel, task: PlanningTask, variables: Sequence[StateVariable]
) -> Heuristic:
    """The heuristic of this name together with the projections; ``auto`` chooses."""
    import numpy as np

    from planners.joint.composition import ComposingStepper
    from planners.search.projections import Projections

    if name not in CHOICES:
        raise UsageError(f"there is no heuristic {name}", remedy=f"One of {', '.join(CHOICES)}.")
    if name == "blind":
        return Heuristic(name)
    projections = Projections(model, task.goal, variables)
    chosen = "relaxed" if name == "auto" else name
    own = HEURISTICS[chosen](model, task.goal, projections)
    exact = name == "auto" and isinstance(model.stepper, ComposingStepper)
    start = task.init[None, :]
    if name == "auto" and not max(own(start)[0], projections.value(start)[0]):
        return Heuristic("blind", exact=exact)
    if name == "auto" and _as_good(model, task, projections.value, own):
        chosen = "projections"

    def both(rows: Rows) -> Ints:
        return np.maximum(projections.value(rows), own(rows))

    value = projections.value if chosen == "projections" else both
    return Heuristic(chosen, value, projections.in_time, exact)


def _as_good(model: JointModel, task: PlanningTask, one: Values, other: Values) -> bool:
    """Whether one heuristic says as much as another in the first states of the search.

    No, where robots have so many joint steps there that not even these are composed.
    """
    rows = task.init[None, :]
    for _ in range(2):
        if (one(rows) < other(rows)).any():
            return False
        rows = rows[:20]
        if model.stepper.most_steps(model.codec.facts_part(rows)) > _STEPS:
            return False
        rows = model.successors(rows).result[:2_000]
        if not len(rows):
            break
    return True
