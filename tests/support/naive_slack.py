# SPDX-License-Identifier: GPL-3.0-or-later
"""Plans within slack by the definition: every sequence of joint steps is tried.  Tiny inputs only."""

from __future__ import annotations

from functools import cache

import numpy as np

from planners.joint.model import JointModel, PlanningTask
from planners.search.plans import Plan

#: A joint step: its labels, its cost, and the state that it leads to.
Step = tuple[tuple[int, ...], int, bytes]


class TooMany(Exception):
    """More sequences than a twin should list."""


class Sequences:
    """The sequences of joint steps of a task that end in its goal, by their number of steps."""

    def __init__(self, model: JointModel, task: PlanningTask, most: int = 4_000) -> None:
        self.model, self.task, self.most = model.without_slack, task, most
        self.steps = cache(self._steps)

    def _steps(self, state: bytes) -> list[Step]:
        found = self.model.successors(np.frombuffer(state, np.uint64)[None, :])
        rows = zip(found.labels.tolist(), found.cost.tolist(), found.result, strict=True)
        return [(tuple(labels), cost, row.tobytes()) for labels, cost, row in rows]

    def of_length(self, length: int) -> dict[Plan, int]:
        """All that end in the goal after so many steps, each with what it costs."""
        reached: list[tuple[Plan, int, bytes]] = [((), 0, self.task.init.tobytes())]
        for _ in range(length):
            reached = [
                ((*plan, labels), paid + cost, after)
                for plan, paid, state in reached
                for labels, cost, after in self.steps(state)
            ]
            if len(reached) > self.most:
                raise TooMany
        rows = np.frombuffer(b"".join(state for *_, state in reached), np.uint64)
        rows = rows.reshape(len(reached), len(self.task.init))
        holds = self.model.holds(self.task.goal, rows)
        return {plan: paid for (plan, paid, _), ends in zip(reached, holds, strict=True) if ends}

    def within(self, slack: int) -> set[Plan] | None:
        """The plans within slack, with a rest at the end; None where the task is too hard."""
        makespan = next((k for k in range(5) if self.of_length(k)), None)
        if makespan is None:
            return None
        found = self.of_length(makespan + slack)
        cheapest = min(found.values(), default=0)
        return {plan for plan, paid in found.items() if paid == cheapest}
