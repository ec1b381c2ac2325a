# SPDX-License-Identifier: GPL-3.0-or-later
"""Exact bounds from a SAT solver: what is left after them is on optimal plans, and nothing else.

First the least makespan, then the least second component, then the labels that some optimal plan
has in each step; then, state by state, whether an optimal plan passes through it
(`planners.search.optimal_states`).  The solver's models are only hints (states and costs come from
the joint model); its refutations are trusted.  A question that is not decided with some effort is
answered with yes: more is searched then.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass
from functools import partial
from itertools import product

import numpy as np

from planners.joint.model import JointModel, Options, PlanningTask
from planners.joint.tables import Bools, Rows
from planners.search.cheapest import cheapest
from planners.search.mutexes import mutexes
from planners.search.plan_formula import PlanFormula, TooManyClauses
from planners.search.questions import FixedPlans, Literals, OutOfEffort, Plan
from planners.search.reachable import PieceSizes
from planners.search.state_variables import StateVariable
from planners.system.limits import reaching

#: What a makespan that is refuted at once costs for each of its steps, in conflicts; the clauses of
#: one step more are counted, too: of a task without plan there would be ever more.
_EASY = 20
#: What to try besides a larger limit.
SMALLER = "a task with a shorter plan, fewer objects or fewer robots"


@dataclass(frozen=True, slots=True)
class ExactBound:
    """The least makespan of one task, and what its optimal plans consist of.

    ``used[k][robot]`` (labels) says which labels occur in step k of some optimal plan; ``plans``
    are what they satisfy, to be closed by whoever asked for the bound.
    """

    plans: FixedPlans
    makespan: int
    used: list[list[Bools]]

    def only(self, depth: int, rows: Rows, options: Options) -> Options:
        """The robots' options in states after ``depth`` steps, without labels that are not used."""
        found = []
        for (first, label), used in zip(options, self.used[depth], strict=True):
            good = used[label]
            state = np.repeat(np.arange(len(rows)), np.diff(first))[good]
            found.append((np.searchsorted(state, np.arange(len(rows) + 1)), label[good]))
        return found


def exact_bound(
    model: JointModel,
    task: PlanningTask,
    variables: Sequence[StateVariable],
    at_least: int,
    pieces: PieceSizes,
) -> ExactBound | None:
    """The bound of a task; None where it is not found with the effort that is spent.

    ``at_least`` is a lower bound on the makespan; ``pieces`` say how many conflicts of the solver
    are spent.  Of a task without plan none is found.
    """
    try:
        pairs = partial(mutexes, model, task.init)
        formula = PlanFormula(model, task.goal, variables, pairs, pieces.effort)
    except TooManyClauses:
        return None
    try:
        with closing(formula), reaching(formula.so_far, SMALLER):
            plan = _shortest(formula, task, at_least)
            plans = formula.fixed(task.init, len(plan))
    except OutOfEffort:
        return None
    try:
        with reaching(plans.so_far, SMALLER):
            if model.cost != "makespan":
                plan, cheap = cheapest(plans, model, task, plan)
                plans.require(cheap)
            plans.without_limit()
            used = _used(plans, model, plan, pieces.question)
            plans.simplify()
            return ExactBound(plans, len(plan), used)
    except BaseException:
        plans.close()
        raise


def _shortest(formula: PlanFormula, task: PlanningTask, at_least: int) -> Plan:
    makespan = at_least
    while (plan := formula.plan(task.init, makespan)) is None:
        formula.spend(_EASY * makespan + formula.clauses_of_step)
        makespan += 1
    return plan


def _used(plans: FixedPlans, model: JointModel, plan: Plan, effort: int) -> list[list[Bools]]:
    """Which labels occur where in optimal plans: each that is found shows one a robot and step.

    First those that occur in no step at all are looked for: one refutation does for all steps.
    """
    found = _Used(plans, [len(own) for own in model.labels], plan, effort)
    robots = range(len(model.robots))
    steps = range(plans.steps)
    for robot in robots:
        found.ask(robot, steps)
    for step, robot in product(steps, robots):
        found.ask(robot, [step])
    return found.used


class _Used:
    """The labels that were found in optimal plans: ``used[k][robot]`` (labels)."""

    def __init__(self, plans: FixedPlans, sizes: Sequence[int], plan: Plan, effort: int) -> None:
        self._plans, self._effort = plans, effort
        self.used = [[np.zeros(size, np.bool_) for size in sizes] for _ in plan]
        self._enter(plan)

    def _enter(self, plan: Plan) -> None:
        for own, labels in zip(self.used, plan, strict=True):
            for used, label in zip(own, labels, strict=True):
                used[label] = True

    def ask(self, robot: int, steps: Sequence[int]) -> None:
        """Find, or refute, all labels that a robot has in none of some steps, as far as is known.

        If that is not decided for one step, they may all occur there.
        """
        while others := self._unknown(robot, steps):
            try:
                with self._plans.at_most(self._effort):
                    holds = self._plans.holds([self._plans.some_of(others)])
            except OutOfEffort:
                if len(steps) == 1:
                    self.used[steps[0]][robot][:] = True
                break
            if not holds:
                self._plans.require([-literal for literal in others])
                break
            self._enter(self._plans.labels_chosen())

    def _unknown(self, robot: int, steps: Sequence[int]) -> Literals:
        """The literals of labels that the robot was not found to have in any of these steps."""
        unknown = ~np.any([self.used[step][robot] for step in steps], axis=0)
        labels = np.flatnonzero(unknown).tolist()
        return [self._plans.label(step, robot, label) for step in steps for label in labels]
