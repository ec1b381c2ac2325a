# SPDX-License-Identifier: GPL-3.0-or-later
"""What coordination is left if robots that have nothing to do stand still.

The optimal plans with the fewest actions are some paths of the plan space of the least makespan:
nothing is searched again.  If all plans of a task mix, so do these: of two of them, both mixtures
have as many actions together, and none has fewer.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from coordlang.required.choices import Choices
from coordlang.required.label_sets import LabelSets
from planners.joint.composition import cost_of
from planners.joint.model import JointModel
from planners.joint.tables import Ints
from planners.pddl.model_options import Cost
from planners.search.plan_space import PlanSpace

#: The cost that has these plans only.
FEWEST: Cost = "makespan+actions"
#: Edges of plan spaces up to which `requiring` looks at them: some seconds of work.
MOST_EDGES = 300_000


def fewest_actions(space: PlanSpace) -> PlanSpace | None:
    """The plans with the fewest actions, None if all plans are or the cost is no makespan.

    O(edges).
    """
    model = space.model
    if model.cost != "makespan" or model.slack:
        return None
    counts = _actions(model)
    cost = sum(counts[robot][space.robot_labels(robot)] for robot in range(space.robots))
    fewer = space.cheapest(np.asarray(cost))
    return None if len(fewer.target) == len(space.target) else fewer


def requiring(spaces: Sequence[PlanSpace]) -> int | None:
    """How many tasks require coordination if only plans with the fewest actions count.

    None if all plans count, or there are too many.
    """
    if sum(len(space.target) for space in spaces) > MOST_EDGES:
        return None
    found = [(space, fewest_actions(space)) for space in spaces]
    if all(fewer is None for _, fewer in found):
        return None
    sets = LabelSets()
    return sum(
        int(Choices(used, sets).requires[used.starts].sum())
        for used in (space if fewer is None else fewer for space, fewer in found)
    )


def _actions(model: JointModel) -> list[Ints]:
    """For each robot how many actions each of its labels is; a shared one counts once."""
    if model.is_joint_action:
        return [np.array([0] + [1] * (len(own) - 1), np.int64) for own in model.labels]
    counts = [dict.fromkeys(own, 0) for own in model.labels]
    for action in model.actions:
        counts[action.owners[0]][action.label] = cost_of(action, FEWEST)
    return [np.array(list(own.values()), np.int64) for own in counts]
