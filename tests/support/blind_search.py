# SPDX-License-Identifier: GPL-3.0-or-later
"""All optimal plans of a task by exploring every reachable state, without any bound."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from planners.joint.model import JointModel, PlanningTask
from planners.search.optimal_plans import plan_spaces
from planners.search.plan_space import PlanSpace
from planners.search.reachable import explore


def search(model: JointModel, task: PlanningTask) -> PlanSpace:
    """The plan space of one task, with the states that its plans pass through.

    Raises `ProvedImpossible` if the goal cannot be reached.
    """
    init = task.init[None, :]
    (found,) = plan_spaces(explore(model, init), [(task.goal, init)])
    used, state = np.unique(found.state, return_inverse=True)
    return replace(found, rows=found.rows[used], state=state)
