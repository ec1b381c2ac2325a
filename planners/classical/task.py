# SPDX-License-Identifier: GPL-3.0-or-later
"""The classical task: what every planner reads."""

from __future__ import annotations

from collections.abc import Mapping, Sequence, Set
from dataclasses import dataclass
from typing import Literal

from planners.pddl.lifted import Atom

Form = Literal["explicit", "select-then-apply"]
#: A condition on a classical state: the number of a fact, and whether it is to be true.
Condition = tuple[int, bool]
Known = Mapping[Atom, bool]

#: The makespan up to which `ClassicalTask.cost` is sure to be lexicographic by default.
LONGEST = 100


@dataclass(frozen=True, slots=True)
class ClassicalAction:
    """A ground STRIPS action with negative preconditions.

    Facts by number, ``adds`` and ``deletes`` are disjoint.
    """

    name: str
    preconditions: tuple[Condition, ...]
    adds: tuple[int, ...]
    deletes: tuple[int, ...]
    cost: int


@dataclass(frozen=True, slots=True)
class ClassicalTask:
    """A ground planning task.

    ``facts`` are texts; facts of the model are its PDDL atoms.  A plan of total cost ``step_cost *
    m + s`` stands for a joint plan of makespan ``m`` and second cost ``s``; ``highest_cost`` is the
    most that one joint step adds to ``s``.  ``between`` is the fact that is true between two joint
    steps and false within one; None where every action is a whole joint step.
    """

    name: str
    form: Form
    facts: tuple[str, ...]
    init: frozenset[int]
    actions: tuple[ClassicalAction, ...]
    goal: tuple[Condition, ...]
    step_cost: int
    highest_cost: int
    between: int | None = None

    def cost(self, total: int) -> tuple[int, int] | None:
        """An optimal total cost as (makespan, second cost).

        None if ``step_cost`` is too small to be sure.

        A plan of ``k`` steps costs from ``step_cost * k`` to ``(step_cost + highest_cost) * k``,
        which is less than ``step_cost * m`` for every ``k < m`` when ``step_cost > highest_cost *
        m``: then no plan has fewer than ``m`` steps.
        """
        makespan, second = divmod(total, self.step_cost)
        return (makespan, second) if self.step_cost > self.highest_cost * makespan else None

    def cost_of_plan(self, plan: Sequence[int]) -> int | None:
        """The total cost of the actions of these numbers in turn, None if they are no plan."""
        state = set(self.init)
        for number in plan:
            if not 0 <= number < len(self.actions) or not _holds(
                self.actions[number].preconditions, state
            ):
                return None
            state.difference_update(self.actions[number].deletes)
            state.update(self.actions[number].adds)
        if not _holds(self.goal, state):
            return None
        return sum(self.actions[number].cost for number in plan)


def _holds(conditions: Sequence[Condition], state: Set[int]) -> bool:
    return all((fact in state) == wanted for fact, wanted in conditions)
