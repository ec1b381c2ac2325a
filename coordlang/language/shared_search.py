# SPDX-License-Identifier: GPL-3.0-or-later
"""Tasks searched one by one, of which those with one goal share what is found."""

from __future__ import annotations

import numpy as np

from planners.joint.model import Goal, JointModel, PlanningTask
from planners.joint.tables import find_rows
from planners.search.kept_plans import search
from planners.search.plan_space import PlanSpace


class SharedSearch:
    """All optimal plans of tasks; a task that starts on another's plan to its goal needs no search.

    From a state on an optimal plan the plan space holds all optimal plans to that goal.
    """

    def __init__(self, model: JointModel) -> None:
        self._model = model
        self._found: dict[Goal, list[PlanSpace]] = {}

    def search(self, task: PlanningTask) -> PlanSpace:
        """The plan space of a task.  Raises `ProvedImpossible` if there is none.

        With slack, plans of another task through this one's initial state may have used some of it.
        """
        if self._model.slack:
            return search(self._model, task)
        known = self._found.setdefault(task.goal, [])
        for space in known:
            node = _node_of(space, task)
            if node is not None:
                return _from_node(space, node)
        found = search(self._model, task)
        known.append(found)
        return found


def _node_of(space: PlanSpace, task: PlanningTask) -> int | None:
    state = int(find_rows(space.rows, task.init[None, :])[0])
    found = np.flatnonzero(space.state == state)
    return int(found[0]) if state >= 0 and len(found) else None


def _from_node(space: PlanSpace, node: int) -> PlanSpace:
    """The part of a plan space that a node's plans pass through, with a table of its own states."""
    cost = int(space.cost[space.first_path(node)].sum())
    return space.with_tasks(np.array([node]), np.array([cost]))
