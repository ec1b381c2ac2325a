# SPDX-License-Identifier: GPL-3.0-or-later
"""Exact bounds from a SAT solver: what is left after them is on optimal plans, and nothing else.

First the least makespan, then the least second component, then the labels that some optimal plan
has in each step; then, state by state, whether an optimal plan passes through it.  The solver's
models are only hints (states and costs come from the joint model); its refutations are trusted.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from planners.joint.model import JointModel, Options, PlanningTask
from planners.search.plan_formula import OutOfEffort, PlanFormula, TooManyClauses, countable
from planners.search.state_variables import StateVariable
from planners.tables import Bools, Ints, Rows

#: The robots' labels, step by step.
Plan = list[tuple[int, ...]]


@dataclass(slots=True)
class ExactBound:
    """The optimal cost of one task, and what its optimal plans consist of.

    ``used[k][robot]`` (labels) says which labels occur in step k of some optimal plan.
    """

    formula: PlanFormula
    makespan: int
    cost: int | None
    used: list[list[Bools]]

    def may_pass(self, rows: Rows, steps: int, paid: Ints) -> Bools:
        """Through which states optimal plans pass, ``steps`` before the end, ``paid`` so far."""
        answers = [
            self.formula.solvable(row, steps, None if self.cost is None else self.cost - own)
            for row, own in zip(rows, paid.tolist(), strict=True)
        ]
        return np.array(answers, np.bool_)

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
    effort: int,
) -> ExactBound | None:
    """The bound of a task; None where it is not found with the effort that is spent on it.

    ``at_least`` is a lower bound on the makespan, ``effort`` are the solver's conflicts to be
    spent.  Of a task without plan none is found.
    """
    try:
        formula = PlanFormula(model, task.goal, variables, effort)
        makespan, plan = _shortest(formula, task, at_least)
    except (TooManyClauses, OutOfEffort):
        return None
    cost = None
    if model.cost != "makespan" and countable(model):
        try:
            cost, plan = _cheapest(formula, task, plan)
        except OutOfEffort:
            cost = None
    try:
        used = _used(formula, task, makespan, cost, plan)
    except OutOfEffort:
        used = [[np.ones(len(own), np.bool_) for own in model.labels]] * makespan
    formula.without_limit()
    return ExactBound(formula, makespan, cost, used)


def _shortest(formula: PlanFormula, task: PlanningTask, at_least: int) -> tuple[int, Plan]:
    makespan = at_least
    while not formula.solvable(task.init, makespan):
        makespan += 1
    return makespan, formula.labels_chosen(makespan)


def _cheapest(formula: PlanFormula, task: PlanningTask, plan: Plan) -> tuple[int, Plan]:
    """Cheaper and cheaper plans until there is none."""
    cost = _cost_of(formula, plan)
    formula.count_costs(cost)
    while cost and formula.solvable(task.init, len(plan), cost - 1):
        plan = formula.labels_chosen(len(plan))
        cost = _cost_of(formula, plan)
    return cost, plan


def _cost_of(formula: PlanFormula, plan: Plan) -> int:
    costs = formula.costs
    return sum(int(costs[robot][label]) for step in plan for robot, label in enumerate(step))


def _used(
    formula: PlanFormula,
    task: PlanningTask,
    makespan: int,
    cost: int | None,
    plan: Plan,
) -> list[list[Bools]]:
    """Which labels occur where in optimal plans: each that is found shows one a robot and step."""
    sizes = [len(own) for own in formula.model.labels]
    used = [[np.zeros(size, np.bool_) for size in sizes] for _ in range(makespan)]

    def enter(found: Plan) -> None:
        for depth, labels in enumerate(found):
            for robot, label in enumerate(labels):
                used[depth][robot][label] = True

    enter(plan)
    for depth in range(makespan):
        for robot, size in enumerate(sizes):
            for label in range(size):
                if not used[depth][robot][label]:
                    wanted = formula.label(makespan - depth, robot, label)
                    if formula.solvable(task.init, makespan, cost, [wanted]):
                        enter(formula.labels_chosen(makespan))
    return used
