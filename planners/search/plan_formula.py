# SPDX-License-Identifier: GPL-3.0-or-later
"""Plans of a given number of joint steps as a propositional formula, for a SAT solver.

Steps (`planners.search.step_formula`) are counted from the goal, so that one formula answers for
every state how many steps lead from it to the goal.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, suppress

import numpy as np

from planners.joint.model import FullState, Goal, JointModel
from planners.search.fixed_plans import FixedPlans
from planners.search.mutexes import Pair
from planners.search.questions import Literals, OutOfEffort, Plan, Questions
from planners.search.state_variables import StateVariable
from planners.search.step_formula import clauses_of, step_formula
from planners.tables import Ints, Rows

#: Conflicts for a question, after which it is asked of a solver of its own.
_SOON = 1_000


class PlanFormula(Questions):
    """Whether a state has a plan of so many steps; exact.

    ``variables`` and ``pairs()`` of facts that are never true together hold in the states that are
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
        pairs: Callable[[], Sequence[Pair]],
        effort: int,
    ) -> None:
        self.model = model
        self._step = step_formula(model, variables, pairs)
        super().__init__(effort, self._step.size)
        self._steps = 0
        #: Per step its variables begin after this one; the goal's state is the first.
        self._base = [0]
        self._active: Literals = []
        #: The clauses of a step one after the other, each with 0 at its end.
        self._flat: Ints = np.array(
            [k for clause in self._step.clauses for k in (*clause, 0)], np.int64
        )
        #: Where each of them begins.
        self._begins: Ints = np.flatnonzero(np.append(0, self._flat[:-1]) == 0)
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
        self.add_all(np.insert(moved, self._begins, -active))
        self._base.append(base)
        self._active.append(active)
        self._steps += 1

    @property
    def clauses_of_step(self) -> int:
        """How many clauses one step more has."""
        return len(self._step.clauses)

    # ---- questions

    def solvable(self, row: Rows, steps: int) -> bool:
        """Whether a plan of exactly so many steps leads from a state to the goal."""
        return self.holds(self._begun(row, steps))

    def plan(self, row: Rows, steps: int) -> Plan | None:
        """A plan of exactly so many steps from a state to the goal, if there is one.

        What is not decided soon is asked of a solver that knows of no other beginning.
        """
        with suppress(OutOfEffort), self.at_most(_SOON):
            return self.labels_chosen(steps) if self.solvable(row, steps) else None
        with closing(self.with_units(self._begun(row, steps))) as alone:
            found = alone.holds([])
            self.left = alone.left
            return alone.chosen(self._first(steps), self._sizes) if found else None

    def _begun(self, row: Rows, steps: int) -> Literals:
        """Literals that say: so many steps are taken, from this state on."""
        self._require_steps(steps)
        facts = np.full(len(self.model.codec.facts), -1)
        facts[self.model.codec.true_facts(row)] = 1
        numbers = self._base[steps] + 1 + np.arange(len(facts))
        return [*self._active[:steps], *(facts * numbers).tolist()]

    def fixed(self, row: Rows, steps: int) -> FixedPlans:
        """The plans of so many steps from this state, for many easy questions.

        What is fixed is simplified away; what is assumed may be part of every clause learnt.
        """
        clauses = self.clauses[:]
        for literal in self._begun(row, steps):
            clauses.extend((literal, 0))
        return FixedPlans(clauses, self._first(steps), self._sizes, self.left)

    def _first(self, steps: int) -> Ints:
        """The variables of the robots' first labels, from the first of so many steps on."""
        base = np.array(self._base[steps:0:-1], np.int64)
        first: Ints = base[:, None] + np.array(self._step.first_label)
        return first

    @property
    def _sizes(self) -> list[int]:
        return [len(own) for own in self.model.labels]

    def labels_chosen(self, steps: int) -> Plan:
        """The robots' labels in the plan that the last answer found, from its first step on."""
        return self.chosen(self._first(steps), self._sizes)


def _goal_clauses(model: JointModel, goal: Goal) -> Iterator[Literals]:
    if isinstance(goal, FullState):
        for fact in range(len(model.codec.facts)):
            yield [fact + 1 if fact in goal.facts else -(fact + 1)]
        return
    for clause in clauses_of(model, goal, 0, 0):
        yield [lit[0] + 1 if lit[-1] else -(lit[0] + 1) for lit in sorted(clause)]
