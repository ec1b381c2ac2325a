# SPDX-License-Identifier: GPL-3.0-or-later
"""Plans of a given number of joint steps as a propositional formula, for a SAT solver.

Planning as satisfiability (Kautz and Selman 1992) with the joint steps of this model: every robot
has exactly one label in a step, labels that may not share a step exclude each other, a fact changes
only where an effect changes it.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Container, Sequence
from itertools import accumulate, combinations

import numpy as np

from planners.grounding.actions import GroundAction
from planners.joint.composition import ComposingStepper
from planners.joint.model import FullState, Goal, JointModel, PlanningTask
from planners.joint.tables import Bools, Ints, unique_rows
from planners.pddl.formula_tree import conjuncts, negated, signed, substituted
from planners.pddl.lifted import FALSE, TRUE, And, Atom, Formula, Or, StepAtom, Truth
from planners.search.goals import FAR
from planners.search.mutexes import Exclusions, from_start, to_goal
from planners.search.questions import FixedPlans, Literals
from planners.search.sat import flat_clauses
from planners.search.state_variables import StateVariable, state_variables


class PlanFormula:
    """The clauses of one ``step`` of a plan of a task, and of its goal, over ``stepper``'s labels.

    Variable k (from 1) of a step is fact k - 1, true in the state before it, then come labels,
    robot by robot, then helping variables; ``size`` is how many there are.  ``size + k`` is
    variable k of the next step.  States have one value of each of the state variables.  The last
    variable implies that the task begins in the state before the step.
    """

    def __init__(self, model: JointModel, task: PlanningTask) -> None:
        stepper = model.stepper
        assert isinstance(stepper, ComposingStepper)
        self._model, self.stepper, facts = model, stepper, len(model.codec.facts)
        *self._first_label, end = accumulate(map(len, model.labels), initial=facts + 1)
        self.size = end - 1
        self.step: list[tuple[int, ...]] = []
        #: By fact and value the literals that give it this value in the next state.
        self._makers: dict[tuple[int, bool], Literals] = defaultdict(list)
        #: Per robot and some of its labels, as bytes, the variable that they imply.
        self._implied: dict[tuple[int, bytes], int] = {}
        start = from_start(model, task.init)
        left = to_goal(model, task.goal, start >= FAR)
        never = (start >= FAR) | (left >= FAR)
        #: What facts exclude each other soon after the start, and shortly before the goal.
        self._soon = Exclusions.of(np.where(never, 0, start))
        self._late = Exclusions.of(np.where(never, 0, left))
        variables = state_variables(model, task.init)
        for variable in variables:
            self._exactly_one([fact + 1 for fact in variable.facts])
        for robot, actions in enumerate(stepper.labelled):
            self._exactly_one([self._label(robot, label) for label in range(len(actions))])
            for label, action in enumerate(actions):
                if action is not None:
                    self._action(robot, label, action)
        for i, j in combinations(range(len(model.robots)), 2):
            self._apart(i, j)
        self._never_together(variables, never)
        goal = self._goal_clauses(task.goal)
        begins = self._fresh()
        begin = self._just(set(model.codec.true_facts(task.init)))
        self.step += [(-begins, literal) for literal in begin]
        self._facts_follow()
        self._flat_step, self._goal = flat_clauses(self.step), flat_clauses(goal)

    def plans(self) -> FixedPlans:
        """The plans of no step, that is, the goal, as a formula to be closed."""
        return FixedPlans(self._goal, [len(own) for own in self._model.labels])

    def lengthen(self, plans: FixedPlans, at_least: int) -> int:
        """Add a step before the others; the literal that says that the task begins there.

        What a solver has learned of the way to the goal stays true of longer plans.  What follows
        for states soon after the start is said of plans of ``at_least`` so many steps.
        """
        steps = plans.steps + 1
        before = self.size * steps
        number = np.abs(self._flat_step)
        number[number > self.size] -= 2 * self.size
        step = np.sign(self._flat_step) * (number + before)
        clauses, begins = [step, _excluding(self._late.at(steps), before)], before + self.size
        if steps >= at_least:
            clauses += [
                _excluding(self._soon.at(depth), self.size * (steps - depth), begins)
                for depth in range(1, steps + 1)
            ]
        plans.put_before(np.concatenate(clauses), before + np.array(self._first_label))
        return begins

    def _fresh(self) -> int:
        self.size += 1
        return self.size

    def _label(self, robot: int, label: int) -> int:
        return self._first_label[robot] + label

    def _exactly_one(self, variables: Literals) -> None:
        """Of some variables; at most one, by a chain: "one of those up to here"."""
        self.step.append(tuple(variables))
        before = variables[0]
        for variable in variables[1:]:
            self.step.append((-before, -variable))
            so_far = self._fresh()
            self.step += [(-before, so_far), (-variable, so_far)]
            before = so_far

    def _saying(self, formula: Formula, robot: int = 0, label: int = 0) -> list[Literals]:
        """The clauses that say that a condition holds, where a robot has this label."""
        facts, subactions = self._model.codec.facts, self._model.evaluator.subactions

        def value(leaf: Atom | StepAtom) -> Formula:
            if isinstance(leaf, Atom):
                return leaf if leaf in facts else FALSE
            known = subactions.get(leaf)
            if known is None or known[0] == robot:
                return Truth(known == (robot, label))
            return leaf

        return self._clauses(substituted(formula, value))

    def _clauses(self, formula: Formula) -> list[Literals]:
        """The clauses of a simplified condition; a conjunction in it gets a variable."""
        found = []
        for part in conjuncts(formula):
            clause = []
            for way in part.parts if isinstance(part, Or) else (part,):
                if isinstance(way, And):
                    clause.append(self._fresh())
                    found += [[-clause[-1], *said] for said in self._clauses(way)]
                elif way != FALSE:
                    clause.append(self._literal(*signed(way)))
            found.append(sorted(clause, key=abs))
        return found

    def _literal(self, leaf: Formula, wanted: bool) -> int:
        if isinstance(leaf, StepAtom):
            variable = self._label(*self._model.evaluator.subactions[leaf])
        else:
            assert isinstance(leaf, Atom)
            variable = self._model.codec.facts.index[leaf] + 1
        return variable if wanted else -variable

    def _action(self, robot: int, label: int, action: GroundAction) -> None:
        chosen = self._label(robot, label)
        self.step += [(-chosen, *said) for said in self._saying(action.precondition, robot, label)]
        index = self._model.codec.facts.index
        for effect in action.effects:
            if effect.atom not in index:
                continue
            fires = chosen
            if effect.condition != TRUE:
                fires = self._fires(robot, label, effect.condition)
            self._makers[index[effect.atom], effect.adds].append(fires)

    def _fires(self, robot: int, label: int, condition: Formula) -> int:
        """A variable for: the label is chosen, and the condition of an effect holds."""
        chosen, fires = self._label(robot, label), self._fresh()
        self.step.append((-fires, chosen))
        self.step += [(-fires, *said) for said in self._saying(condition, robot, label)]
        otherwise = self._saying(negated(condition), robot, label)
        self.step += [(fires, -chosen, *said) for said in otherwise]
        return fires

    def _apart(self, i: int, j: int) -> None:
        """Labels that may not share a step; those that exclude the same ones are one class."""
        rows, row_class = _unique(~self.stepper.tables[i, j])
        columns, column_class = _unique(rows.T)
        theirs = [0] * len(columns)
        for one, apart in enumerate(columns.T):
            others = np.flatnonzero(apart).tolist()
            mine = self._one_of(i, np.flatnonzero(row_class == one)) if others else 0
            for other in others:
                if not theirs[other]:
                    theirs[other] = self._one_of(j, np.flatnonzero(column_class == other))
                self.step.append((-mine, -theirs[other]))

    def _one_of(self, robot: int, labels: Ints) -> int:
        """A variable that is implied by each of a robot's labels."""
        if len(labels) == 1:
            return self._label(robot, int(labels[0]))
        key = (robot, labels.tobytes())
        if key not in self._implied:
            self._implied[key] = self._fresh()
            self.step += [
                (-self._label(robot, label), self._implied[key]) for label in labels.tolist()
            ]
        return self._implied[key]

    def _never_together(self, variables: Sequence[StateVariable], never: Bools) -> None:
        """Pairs of facts that no plan has together, of different variables."""
        known = {fact: number for number, own in enumerate(variables) for fact in own.facts}
        for one, other in Exclusions.of(never.astype(np.int64)).pairs.tolist():
            if one == other:
                self.step.append((-(one + 1),))
            elif one not in known or known[one] != known.get(other):
                self.step.append((-(one + 1), -(other + 1)))

    def _facts_follow(self) -> None:
        """What is true in the next state; added facts are, whatever deletes them, too."""
        for fact in range(len(self._model.codec.facts)):
            now, adders, deleters = fact + 1, self._makers[fact, True], self._makers[fact, False]
            then = now + self.size
            self.step += [(-adder, then) for adder in adders]
            self.step += [(-deleter, *adders, -then) for deleter in deleters]
            self.step += [(-then, now, *adders), (then, -now, *deleters)]

    def _goal_clauses(self, goal: Goal) -> list[list[int]]:
        if isinstance(goal, FullState):
            return [[literal] for literal in self._just(set(goal.facts))]
        return self._saying(goal)

    def _just(self, true: Container[int]) -> Literals:
        """The literals of the one state in which these facts are true."""
        facts = range(1, len(self._model.codec.facts) + 1)
        return [fact if fact - 1 in true else -fact for fact in facts]


def _excluding(pairs: Ints, before: int, where: int = 0) -> Ints:
    """Clauses that exclude pairs of facts in a state, whose variables come after ``before``.

    Only ``where`` a literal holds.
    """
    clauses = np.zeros((len(pairs), 4), np.int64)
    clauses[:, 0] = -where
    clauses[:, 1:3] = -(pairs + 1 + before)
    return clauses[:, 0 if where else 1 :].reshape(-1)


def _unique(table: Bools) -> tuple[Bools, Ints]:
    """The different rows of a table, sorted, and each row's number among them."""
    found, number = unique_rows(np.packbits(table, axis=1))
    return np.unpackbits(found, axis=1, count=table.shape[1]).astype(np.bool_), number
