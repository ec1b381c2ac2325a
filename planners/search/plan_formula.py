# SPDX-License-Identifier: GPL-3.0-or-later
"""Plans of a given number of joint steps as a propositional formula, for a SAT solver.

Steps (`planners.search.step_formula`) are counted from the goal, so that one formula answers for
every state how many steps, and how much of the second cost component, lead from it to the goal.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from planners.joint.composition import ComposingStepper
from planners.joint.model import FullState, Goal, JointModel
from planners.search.fixed_plans import FixedPlans
from planners.search.mutexes import Pair
from planners.search.questions import Literals, Questions
from planners.search.state_variables import StateVariable
from planners.search.step_formula import clauses_of, step_formula
from planners.tables import Ints, Rows

#: The largest cost of one action that is counted.
_COST = 8


class PlanFormula(Questions):
    """Whether a state has a plan of at most some steps and some cost; exact.

    ``variables`` and ``pairs`` of facts that are never true together hold in the states that are
    asked for and in all that follow; ``effort`` are the solver's conflicts that may be spent.

    Raises
    ------
    TooManyClauses
        Where a condition cannot be written as clauses.
    OutOfEffort
        By questions that are not decided within ``effort``.
    """

    def __init__(
        self,
        model: JointModel,
        goal: Goal,
        variables: Sequence[StateVariable],
        pairs: Sequence[Pair],
        effort: int,
    ) -> None:
        self.model = model
        self.costs = label_costs(model)
        self._step = step_formula(model, variables, pairs)
        super().__init__(effort, self._step.size)
        self._steps = 0
        #: Per step its variables begin after this one; the goal's state is the first.
        self._base = [0]
        self._active: Literals = []
        self._counted: list[Literals] = []
        #: The clauses of a step one after the other, each with 0 at its end.
        self._flat: Ints = np.array(
            [k for clause in self._step.clauses for k in (*clause, 0)], np.int64
        )
        for clause in _goal_clauses(model, goal):
            self.add(clause)

    def so_far(self) -> str:
        """What is asked just now, for messages."""
        return (
            f"question {self.calls:,} to the SAT solver, about plans of {self._steps} joint steps; "
            f"{self.variables:,} variables"
        )

    # ---- the formula

    def _require_steps(self, steps: int) -> None:
        while self._steps < steps:
            self._add_step()

    def _add_step(self) -> None:
        size, base, following = self._step.size, self.variables, self._base[-1]
        self.variables += size + 1
        active = self.variables
        number = np.abs(self._flat)
        moved = np.sign(self._flat) * np.where(
            number <= size, number + base, number - size + following
        )
        clause = [-active]
        for literal in moved.tolist():
            if literal:
                clause.append(literal)
            else:
                self.add(clause)
                clause = [-active]
        self._base.append(base)
        self._active.append(active)
        self._steps += 1

    @property
    def clauses_of_step(self) -> int:
        """How many clauses one step more has."""
        return len(self._step.clauses)

    def count_costs(self, most: int) -> None:
        """Let costs up to ``most`` be bounded, in all steps that there are.

        A unary counter: ``self._counted[r][k]`` is implied where steps r .. 1 cost more than k.
        """
        before: Literals = []
        self._counted = [before]
        for step in range(1, self._steps + 1):
            for robot in range(len(self._step.first_label)):
                for paid in self._paid(step, robot):
                    before = self._one_more(before, paid, most)
            self._counted.append(before)

    def _one_more(self, before: Literals, paid: int, most: int) -> Literals:
        after = [self.fresh() for _ in range(min(len(before) + 1, most + 1))]
        for place, literal in enumerate(before):
            if place < len(after):
                self.add([-literal, after[place]])
            if place + 1 < len(after):
                self.add([-literal, -paid, after[place + 1]])
        self.add([-paid, after[0]])
        return after

    def _paid(self, step: int, robot: int) -> Iterator[int]:
        """Literals, as many of which hold as the robot's label in a step costs."""
        costs = self.costs[robot]
        base = self._base[step] + self._step.first_label[robot]
        for least in range(1, int(costs.max(initial=0)) + 1):
            paid = self.fresh()
            for label in np.flatnonzero(costs >= least).tolist():
                self.add([-(base + label), paid])
            yield paid

    # ---- questions

    def solvable(self, row: Rows, steps: int) -> bool:
        """Whether a plan of exactly so many steps leads from a state to the goal."""
        return self.holds(self._begun(row, steps))

    def _begun(self, row: Rows, steps: int) -> Literals:
        """Literals that say: so many steps are taken, from this state on."""
        self._require_steps(steps)
        facts = np.full(len(self.model.codec.facts), -1)
        facts[self.model.codec.true_facts(row)] = 1
        numbers = self._base[steps] + 1 + np.arange(len(facts))
        return [*self._active[:steps], *(facts * numbers).tolist()]

    def costs_at_most(self, steps: int, cost: int) -> Literals:
        """A literal that says so of these steps, after `count_costs`; none where it is no bound."""
        counted = self._counted[steps]
        return [-counted[cost]] if cost < len(counted) else []

    def fix(self, row: Rows, steps: int) -> None:
        """Ask from now on, by `holds`, only about plans of so many steps from this state.

        What is fixed is simplified away; what is assumed may be part of every clause learnt.
        """
        self.require(self._begun(row, steps))

    def fixed(self, steps: int) -> FixedPlans:
        """The plans of so many steps that the formula has now, for many easy questions."""
        labels = [
            [
                np.arange(len(own)) + self.label(step, robot, 0)
                for robot, own in enumerate(self.model.labels)
            ]
            for step in range(steps, 0, -1)
        ]
        return FixedPlans(self.clauses, labels)

    def label(self, step: int, robot: int, label: int) -> int:
        """The variable of a robot's label in a step."""
        return self._base[step] + self._step.first_label[robot] + label

    def labels_chosen(self, steps: int) -> list[tuple[int, ...]]:
        """The robots' labels in the plan that the last answer found, from its first step on."""
        true = self.true()
        found = []
        for step in range(steps, 0, -1):
            chosen = []
            for robot, first in enumerate(self._step.first_label):
                count = len(self.model.labels[robot])
                own = true[self._base[step] + first - 1 : self._base[step] + first - 1 + count]
                chosen.append(int(np.flatnonzero(own)[0]))
            found.append(tuple(chosen))
        return found


def label_costs(model: JointModel) -> list[NDArray[np.int64]]:
    """Per robot the second cost component of each of its labels; idling is free."""
    assert isinstance(model.stepper, ComposingStepper)
    return model.stepper.costs


def may_be_exact(model: JointModel) -> bool:
    """Whether a model may have a plan formula: its joint steps are composed."""
    return isinstance(model.stepper, ComposingStepper)


def countable(model: JointModel) -> bool:
    """Whether costs are small enough for a counter."""
    return all(int(own.max(initial=0)) <= _COST for own in label_costs(model))


def _goal_clauses(model: JointModel, goal: Goal) -> Iterator[Literals]:
    if isinstance(goal, FullState):
        for fact in range(len(model.codec.facts)):
            yield [fact + 1 if fact in goal.facts else -(fact + 1)]
        return
    for clause in clauses_of(model, goal, 0, 0):
        yield [lit[0] + 1 if lit[-1] else -(lit[0] + 1) for lit in sorted(clause)]
