# SPDX-License-Identifier: GPL-3.0-or-later
"""Plans of a given number of joint steps as a propositional formula, for a SAT solver.

Planning as satisfiability (Kautz and Selman 1992) with the joint steps of this model: every robot
has exactly one label in a step, labels that may not share a step exclude each other, a fact changes
only where an effect changes it.  Steps are counted from the goal, so that one formula answers for
every state how many steps, and how much of the second cost component, lead from it to the goal.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from planners.grounding import GroundAction
from planners.joint.composition import ComposingStepper
from planners.joint.model import FullState, Goal, JointModel
from planners.joint.step_clauses import Clause, clauses
from planners.pddl.formula_tree import negated
from planners.pddl.lifted import TRUE, Formula
from planners.sat import SolverName, sat_solver, solve_slice
from planners.search.mutexes import Pair
from planners.search.state_variables import StateVariable
from planners.tables import Ints, Rows

#: Many easy questions and some hard ones: MiniSat answers both as fast as any.
SOLVER: SolverName = "minisat22"
#: Conflicts between two looks at the limits.
_SLICE = 2_000
#: The largest cost of one action that is counted.
_COST = 8

Literals = list[int]


class TooManyClauses(Exception):
    """A condition of the model has too many clauses to be part of a formula."""


class OutOfEffort(Exception):
    """The solver did not decide a question with the effort that was left."""


@dataclass(frozen=True, slots=True)
class _Template:
    """The clauses of one step, over the variables of its state and the facts of the next one.

    Variable k (from 1) of a step is fact k - 1, then come labels, robot by robot, then helping
    variables; ``size`` is how many there are.  ``size + k`` is variable k of the next state.
    """

    size: int
    first_label: tuple[int, ...]
    clauses: tuple[tuple[int, ...], ...]


class PlanFormula:
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
        #: The effort that is left.
        self.left = effort
        self.costs = label_costs(model)
        self._template = _TemplateBuilder(model).build(variables, pairs)
        self._solver = sat_solver(SOLVER)
        self._steps = 0
        self._variables = self._template.size
        #: Per step its variables begin after this one; the goal's state is the first.
        self._base = [0]
        self._active: Literals = []
        self._counted: list[Literals] = []
        self.calls = 0
        for clause in _goal_clauses(model, goal):
            self._solver.add_clause(clause)

    def so_far(self) -> str:
        """What is asked just now, for messages."""
        return (
            f"question {self.calls:,} to the SAT solver, about plans of {self._steps} joint steps; "
            f"{self._variables:,} variables"
        )

    def close(self) -> None:
        """Give the solver back."""
        self._solver.delete()

    # ---- the formula

    def _require_steps(self, steps: int) -> None:
        while self._steps < steps:
            self._add_step()

    def _add_step(self) -> None:
        size = self._template.size
        base, following = self._variables, self._base[-1]
        self._variables += size + 1
        active = self._variables
        for clause in self._template.clauses:
            self._solver.add_clause(
                [-active, *(_moved(lit, base, following, size) for lit in clause)]
            )
        self._base.append(base)
        self._active.append(active)
        self._steps += 1

    @property
    def clauses_of_step(self) -> int:
        """How many clauses one step more has."""
        return len(self._template.clauses)

    def count_costs(self, most: int) -> None:
        """Let costs up to ``most`` be bounded, in all steps that there are.

        A unary counter: ``self._counted[r][k]`` is implied where steps r .. 1 cost more than k.
        """
        before: Literals = []
        self._counted = [before]
        for step in range(1, self._steps + 1):
            for robot in range(len(self._template.first_label)):
                for paid in self._paid(step, robot):
                    before = self._one_more(before, paid, most)
            self._counted.append(before)

    def _one_more(self, before: Literals, paid: int, most: int) -> Literals:
        after = [self._fresh() for _ in range(min(len(before) + 1, most + 1))]
        for place, literal in enumerate(before):
            if place < len(after):
                self._solver.add_clause([-literal, after[place]])
            if place + 1 < len(after):
                self._solver.add_clause([-literal, -paid, after[place + 1]])
        self._solver.add_clause([-paid, after[0]])
        return after

    def _paid(self, step: int, robot: int) -> Iterator[int]:
        """Literals, as many of which hold as the robot's label in a step costs."""
        costs = self.costs[robot]
        base = self._base[step] + self._template.first_label[robot]
        for least in range(1, int(costs.max(initial=0)) + 1):
            paid = self._fresh()
            for label in np.flatnonzero(costs >= least).tolist():
                self._solver.add_clause([-(base + label), paid])
            yield paid

    def _fresh(self) -> int:
        self._variables += 1
        return self._variables

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

    def require(self, literals: Sequence[int]) -> None:
        """Let literals be true from now on."""
        for literal in literals:
            self._solver.add_clause([literal])

    def holds(self, literals: Sequence[int]) -> bool:
        """Whether the formula holds with these literals."""
        self.calls += 1
        while True:
            effort = max(1, min(_SLICE, self.left))
            answer = solve_slice(self._solver, effort, literals)
            if answer is not None:
                return answer
            self.spend(effort)

    def spend(self, effort: int) -> None:
        """Take some of the effort away; raises `OutOfEffort` where it is used up."""
        self.left -= effort
        if self.left < 0:
            raise OutOfEffort

    def without_limit(self) -> None:
        """Answer every question from now on, however long it takes."""
        self.left = sys.maxsize

    @contextmanager
    def at_most(self, effort: int) -> Iterator[None]:
        """Spend no more than this inside, of what is left."""
        before = self.left
        self.left = min(effort, before)
        given = self.left
        try:
            yield
        finally:
            self.left = before - (given - self.left)

    def core(self, literals: Iterable[int]) -> Literals:
        """Of literals whose negations were assumed in the last question: those that refuted it."""
        refuted = {-literal for literal in self._solver.get_core() or ()}
        return sorted(refuted & set(literals))

    def core_of(self, literals: Iterable[int]) -> Literals:
        """Of literals that were assumed in the last question: those that were refuted together."""
        return sorted(set(self._solver.get_core() or ()) & set(literals))

    def any_of(self, literals: Literals) -> int:
        """A literal that is implied by each of these."""
        implied = self._fresh()
        for literal in literals:
            self._solver.add_clause([-literal, implied])
        return implied

    def counter(self, literals: Literals) -> Literals:
        """Literals, the k-th of which is implied where more than k of these hold: a totalizer."""
        if len(literals) == 1:
            return literals
        half = len(literals) // 2
        left, right = self.counter(literals[:half]), self.counter(literals[half:])
        sums = [self._fresh() for _ in literals]
        for k, literal in enumerate(sums):
            for mine in range(max(0, k + 1 - len(right)), min(len(left), k + 1) + 1):
                holding = [left[mine - 1]] if mine else []
                holding += [right[k - mine]] if k + 1 - mine else []
                self._solver.add_clause([*(-one for one in holding), literal])
        return sums

    def some_of(self, literals: Literals) -> int:
        """A literal that says: one of these holds."""
        asked = self._fresh()
        self._solver.add_clause([-asked, *literals])
        return asked

    def label(self, step: int, robot: int, label: int) -> int:
        """The variable of a robot's label in a step."""
        return self._base[step] + self._template.first_label[robot] + label

    def labels_chosen(self, steps: int) -> list[tuple[int, ...]]:
        """The robots' labels in the plan that the last answer found, from its first step on."""
        true = np.array(self._solver.get_model()) > 0
        found = []
        for step in range(steps, 0, -1):
            chosen = []
            for robot, first in enumerate(self._template.first_label):
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


def _moved(literal: int, base: int, following: int, size: int) -> int:
    number = abs(literal)
    place = number + base if number <= size else number - size + following
    return place if literal > 0 else -place


def _goal_clauses(model: JointModel, goal: Goal) -> Iterator[Literals]:
    if isinstance(goal, FullState):
        for fact in range(len(model.codec.facts)):
            yield [fact + 1 if fact in goal.facts else -(fact + 1)]
        return
    for clause in _clauses(model, goal, 0, 0):
        yield [lit[0] + 1 if lit[-1] else -(lit[0] + 1) for lit in sorted(clause)]


def _clauses(model: JointModel, formula: Formula, robot: int, label: int) -> list[Clause]:
    found = clauses(formula, model.evaluator, robot, label)
    if found is None:
        raise TooManyClauses
    return found


class _TemplateBuilder:
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

    def build(self, variables: Sequence[StateVariable], pairs: Sequence[Pair]) -> _Template:
        for variable in variables:
            self._exactly_one([fact + 1 for fact in variable.facts])
        known = {fact: number for number, own in enumerate(variables) for fact in own.facts}
        for one, other in pairs:
            if one == other:
                self.clauses.append((-(one + 1),))
            elif one not in known or known[one] != known.get(other):
                self.clauses.append((-(one + 1), -(other + 1)))
        for robot, own in enumerate(self._stepper.labelled):
            self._one_label(robot, len(own))
            for label, action in enumerate(own):
                if action is not None:
                    self._action(robot, label, action)
        for i, j in combinations(range(len(self._model.robots)), 2):
            self._apart(i, j)
        following = self._facts_follow()
        # Variables of the next state come after all of this step's.
        shifted = [
            tuple(self._next(lit) if is_next else lit for lit, is_next in clause)
            for clause in following
        ]
        return _Template(self._size, self.first_label, (*self.clauses, *shifted))

    def _next(self, literal: int) -> int:
        return literal + self._size if literal > 0 else literal - self._size

    def _fresh(self) -> int:
        self._size += 1
        return self._size

    def _label(self, robot: int, label: int) -> int:
        return self.first_label[robot] + label

    def _one_label(self, robot: int, count: int) -> None:
        labels = [self._label(robot, label) for label in range(count)]
        if not self._model.keeps_idle[robot]:
            self.clauses.append((-labels[0],))
        self._exactly_one(labels)

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
        for clause in _clauses(self._model, action.precondition, robot, label):
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
        for clause in _clauses(self._model, condition, robot, label):
            self.clauses.append((-fires, *map(self._literal, sorted(clause))))
        for clause in _clauses(self._model, negated(condition), robot, label):
            self.clauses.append((fires, -chosen, *map(self._literal, sorted(clause))))
        return fires

    def _apart(self, i: int, j: int) -> None:
        """Labels that may not share a step; those that exclude the same ones are one class."""
        table = self._stepper.tables[i, j]
        rows, row_class = np.unique(table, axis=0, return_inverse=True)
        columns, column_class = np.unique(rows, axis=1, return_inverse=True)
        mine = self._classes(i, row_class.reshape(-1), np.asarray(~columns.all(axis=1)))
        theirs = self._classes(j, column_class.reshape(-1), np.asarray(~columns.all(axis=0)))
        for one, other in np.argwhere(~columns).tolist():
            self.clauses.append((-mine[one], -theirs[other]))

    def _classes(self, robot: int, of_label: Ints, used: NDArray[np.bool_]) -> dict[int, int]:
        found = {}
        for number in np.flatnonzero(used).tolist():
            members = np.flatnonzero(of_label == number).tolist()
            if len(members) == 1:
                found[number] = self._label(robot, members[0])
                continue
            found[number] = self._fresh()
            self.clauses += [(-self._label(robot, label), found[number]) for label in members]
        return found

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
