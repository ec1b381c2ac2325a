# SPDX-License-Identifier: GPL-3.0-or-later
"""Plans of a given number of joint steps as a propositional formula, for a SAT solver.

Planning as satisfiability (Kautz and Selman 1992) with the joint steps of this model: every robot
has exactly one label in a step, labels that may not share a step exclude each other, a fact changes
only where an effect changes it.  Steps are counted from the goal, so that one formula answers for
every state how many steps lead from it to the goal.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, suppress
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from planners.grounding import GroundAction
from planners.joint.composition import ComposingStepper
from planners.joint.interference import Choices
from planners.joint.model import FullState, Goal, JointModel
from planners.joint.step_clauses import Clause, clauses
from planners.joint.tables import Ints, Rows
from planners.pddl.formula_tree import Leaf, negated
from planners.pddl.lifted import TRUE, Formula
from planners.search.mutexes import Pair
from planners.search.questions import FixedPlans, Literals, OutOfEffort, Plan, Questions
from planners.search.state_variables import StateVariable


class TooManyClauses(Exception):
    """A condition of the model has too many clauses to be part of a formula."""


@dataclass(frozen=True, slots=True)
class StepFormula:
    """The clauses of one step, over the variables of its state and the facts of the next one.

    Variable k (from 1) of a step is fact k - 1, then come labels, robot by robot, then helping
    variables; ``size`` is how many there are.  ``size + k`` is variable k of the next state.
    """

    size: int
    first_label: tuple[int, ...]
    clauses: tuple[tuple[int, ...], ...]


def step_formula(
    model: JointModel, variables: Sequence[StateVariable], pairs: Callable[[], Sequence[Pair]]
) -> StepFormula:
    """The clauses of a step whose state has one value of each variable, and none of the pairs.

    These are asked for when all conditions are written.

    Raises `TooManyClauses`.
    """
    return _Builder(model).build(variables, pairs)


def clauses_of(model: JointModel, formula: Formula, robot: int, label: int) -> list[Clause]:
    """The clauses of a condition; raises `TooManyClauses`."""
    found = clauses(formula, model.evaluator, robot, label)
    if found is None:
        raise TooManyClauses
    return found


class _Builder:
    def __init__(self, model: JointModel) -> None:
        stepper = model.stepper
        assert isinstance(stepper, ComposingStepper)
        self._model, self._stepper = model, stepper
        self._facts = len(model.codec.facts)
        counts = [len(own) for own in model.labels]
        self.first_label = tuple(
            self._facts + 1 + sum(counts[:robot]) for robot in range(len(counts))
        )
        self._size = self._facts + sum(counts)
        self.clauses: list[tuple[int, ...]] = []
        #: Per fact the literals that make it true in the next state, and false.
        self._adders: list[Literals] = [[] for _ in range(self._facts)]
        self._deleters: list[Literals] = [[] for _ in range(self._facts)]
        self._choices = [Choices(own) for own in stepper.labelled]
        self._touched: dict[tuple[int, str], dict[Leaf, Ints]] = {}
        #: Per robot and some of its labels, as bytes, the variable that they imply.
        self._implied: dict[tuple[int, bytes], int] = {}

    def build(
        self, variables: Sequence[StateVariable], pairs: Callable[[], Sequence[Pair]]
    ) -> StepFormula:
        for variable in variables:
            self._exactly_one([fact + 1 for fact in variable.facts])
        for robot, own in enumerate(self._stepper.labelled):
            self._one_label(robot, len(own))
            for label, action in enumerate(own):
                if action is not None:
                    self._action(robot, label, action)
        for i, j in combinations(range(len(self._model.robots)), 2):
            self._apart(i, j)
        known = {fact: number for number, own in enumerate(variables) for fact in own.facts}
        for one, other in pairs():
            if one == other:
                self.clauses.append((-(one + 1),))
            elif one not in known or known[one] != known.get(other):
                self.clauses.append((-(one + 1), -(other + 1)))
        following = self._facts_follow()
        # Variables of the next state come after all of this step's.
        shifted = [
            tuple(self._next(lit) if is_next else lit for lit, is_next in clause)
            for clause in following
        ]
        return StepFormula(self._size, self.first_label, (*self.clauses, *shifted))

    def _next(self, literal: int) -> int:
        return literal + self._size if literal > 0 else literal - self._size

    def _fresh(self) -> int:
        self._size += 1
        return self._size

    def _label(self, robot: int, label: int) -> int:
        return self.first_label[robot] + label

    def _one_label(self, robot: int, count: int) -> None:
        self._exactly_one([self._label(robot, label) for label in range(count)])

    def _exactly_one(self, variables: Literals) -> None:
        """Of some variables; at most one, by a chain: "one of those up to here"."""
        self.clauses.append(tuple(variables))
        before = variables[0]
        for variable in variables[1:]:
            self.clauses.append((-before, -variable))
            so_far = self._fresh()
            self.clauses += [(-before, so_far), (-variable, so_far)]
            before = so_far

    def _literal(self, literal: tuple[int, ...]) -> int:
        number = literal[0] + 1 if len(literal) == 2 else self._label(literal[0], literal[1])
        return number if literal[-1] else -number

    def _action(self, robot: int, label: int, action: GroundAction) -> None:
        chosen = self._label(robot, label)
        for clause in clauses_of(self._model, action.precondition, robot, label):
            self.clauses.append((-chosen, *map(self._literal, sorted(clause))))
        index = self._model.codec.facts.index
        for effect in action.effects:
            if effect.atom not in index:
                continue
            fires = chosen
            if effect.condition != TRUE:
                fires = self._fires(robot, label, effect.condition)
            (self._adders if effect.adds else self._deleters)[index[effect.atom]].append(fires)

    def _fires(self, robot: int, label: int, condition: Formula) -> int:
        """A variable for: the label is chosen, and the condition of an effect holds."""
        chosen, fires = self._label(robot, label), self._fresh()
        self.clauses.append((-fires, chosen))
        for clause in clauses_of(self._model, condition, robot, label):
            self.clauses.append((-fires, *map(self._literal, sorted(clause))))
        for clause in clauses_of(self._model, negated(condition), robot, label):
            self.clauses.append((fires, -chosen, *map(self._literal, sorted(clause))))
        return fires

    def _apart(self, i: int, j: int) -> None:
        """Labels that may not share a step: first fact by fact, as far as facts say why.

        Of the others those that exclude the same ones are one class.
        """
        apart = ~self._stepper.tables[i, j]
        left = apart.copy()
        for mine, theirs in self._meeting(i, j):
            block = np.ix_(mine, theirs)
            if np.count_nonzero(left[block]) > 1 and apart[block].all():
                self.clauses.append((-self._one_of(i, mine), -self._one_of(j, theirs)))
                left[block] = False
        rows, row_class = np.unique(left, axis=0, return_inverse=True)
        columns, column_class = np.unique(rows, axis=1, return_inverse=True)
        for one, other in np.argwhere(columns).tolist():
            mine = np.flatnonzero(row_class.reshape(-1) == one)
            theirs = np.flatnonzero(column_class.reshape(-1) == other)
            self.clauses.append((-self._one_of(i, mine), -self._one_of(j, theirs)))

    def _meeting(self, i: int, j: int) -> Iterator[tuple[Ints, Ints]]:
        """Labels of two robots of which one makes a fact what the other needs it not to be."""
        for one, other in (("deletes", "keeps"), ("adds", "requires_false")):
            for first, second in ((one, other), (other, one)):
                rows, columns = self._touching(i, first), self._touching(j, second)
                for fact in rows:
                    if fact in columns:
                        yield rows[fact], columns[fact]

    def _touching(self, robot: int, field: str) -> dict[Leaf, Ints]:
        """Per fact the labels in whose footprint it is; "keeps": needed to be true, or added."""
        if (robot, field) not in self._touched:
            choices = self._choices[robot]
            fields = ("requires_true", "adds") if field == "keeps" else (field,)
            found: dict[Leaf, set[int]] = {}
            for labels in map(choices.labels, fields):
                for fact, own in labels.items():
                    found.setdefault(fact, set()).update(own)
            self._touched[robot, field] = {
                fact: np.array(sorted(found[fact])) for fact in sorted(found, key=str)
            }
        return self._touched[robot, field]

    def _one_of(self, robot: int, labels: Ints) -> int:
        """A variable that is implied by each of a robot's labels."""
        if len(labels) == 1:
            return self._label(robot, int(labels[0]))
        key = (robot, labels.tobytes())
        if key not in self._implied:
            self._implied[key] = self._fresh()
            self.clauses += [
                (-self._label(robot, label), self._implied[key]) for label in labels.tolist()
            ]
        return self._implied[key]

    def _facts_follow(self) -> list[tuple[tuple[int, bool], ...]]:
        """What is true in the next state; added facts are, whatever deletes them, too."""
        found: list[tuple[tuple[int, bool], ...]] = []
        for fact in range(self._facts):
            now, adders, deleters = fact + 1, self._adders[fact], self._deleters[fact]
            adding = tuple((adder, False) for adder in adders)
            found += [((-adder, False), (now, True)) for adder in adders]
            found += [((-deleter, False), *adding, (-now, True)) for deleter in deleters]
            found.append(((-now, True), (now, False), *adding))
            found.append(((now, True), (-now, False), *((d, False) for d in deleters)))
        return found


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
