# SPDX-License-Identifier: GPL-3.0-or-later
"""Exact bounds from a SAT solver: what is left after them is on optimal plans, and nothing else.

First the least makespan, then the least second component, then the labels that some optimal plan
has in each step; then, state by state, whether an optimal plan passes through it.  The solver's
models are only hints (states and costs come from the joint model); its refutations are trusted.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from planners.joint.model import JointModel, Options, PlanningTask
from planners.search.cheapest import least_cost
from planners.search.plan_formula import OutOfEffort, PlanFormula, TooManyClauses, countable
from planners.search.state_variables import StateVariable
from planners.tables import Bools, Ints, Rows

#: States that are asked for to see whether exact bounds pay, and the share on optimal plans above
#: which they do not.
_SAMPLE, _MOST = 50, 0.5
#: Conflicts for the first tries to find the least cost.
_FIRST, _SECOND = 50_000, 300_000
#: What a makespan that is refuted at once costs for each of its steps, in conflicts; the clauses of
#: one step more are counted, too: of a task without plan there would be ever more.
_EASY = 20
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
    some: tuple[Rows, int],
) -> ExactBound | None:
    """The bound of a task; None where it is not found with the effort that is spent, or not needed.

    ``at_least`` is a lower bound on the makespan, ``effort`` are the solver's conflicts to be
    spent.  Of a task without plan none is found.  ``some`` are states that a search met within the
    bound ``at_least``, and how many steps they are from the start: if the bound is the makespan,
    costs do not count, and optimal plans pass through most of them, the search does as well alone.
    """
    try:
        formula = PlanFormula(model, task.goal, variables, effort)
    except TooManyClauses:
        return None
    try:
        makespan, plan = _shortest(formula, task, at_least)
        if model.cost == "makespan" and makespan == at_least and _mostly_pass(formula, plan, some):
            formula.close()
            return None
        return _bound(formula, task, plan)
    except OutOfEffort:
        formula.close()
        return None
    except BaseException:
        formula.close()
        raise


def _mostly_pass(formula: PlanFormula, plan: Plan, some: tuple[Rows, int]) -> bool:
    """Whether optimal plans pass through most of some states."""
    rows, depth = some
    sample = rows[:: -(-len(rows) // _SAMPLE)]
    passing = sum(formula.solvable(row, len(plan) - depth) for row in sample)
    return passing > _MOST * len(sample)


def _bound(formula: PlanFormula, task: PlanningTask, plan: Plan) -> ExactBound:
    cost = None
    if formula.model.cost != "makespan" and countable(formula.model):
        with suppress(OutOfEffort):
            cost, plan = _cheapest(formula, task, plan)
    formula.without_limit()
    return ExactBound(formula, len(plan), cost, _used(formula, task, cost, plan))


def _shortest(formula: PlanFormula, task: PlanningTask, at_least: int) -> tuple[int, Plan]:
    makespan = at_least
    while not formula.solvable(task.init, makespan):
        formula.spend(_EASY * makespan + formula.clauses_of_step)
        makespan += 1
    return makespan, formula.labels_chosen(makespan)


def _cheapest(formula: PlanFormula, task: PlanningTask, plan: Plan) -> tuple[int, Plan]:
    """The least cost, and a plan that has it.

    From above, and from below by cores: neither is always the faster one, so both are tried.
    """
    best = plan
    formula.count_costs(_cost_of(formula, plan))

    def from_above() -> Plan:
        nonlocal best
        while (cost := _cost_of(formula, best)) and formula.solvable(
            task.init, len(best), cost - 1
        ):
            best = formula.labels_chosen(len(best))
        return best

    def from_below() -> Plan:
        least_cost(formula, task, len(plan))
        return formula.labels_chosen(len(plan))

    ways = [(from_above, _FIRST), (from_below, _SECOND), (from_above, formula.left)]
    if any(int(own.max(initial=0)) > 1 for own in formula.costs):
        ways = ways[-1:]
    for number, (way, effort) in enumerate(ways):
        try:
            with formula.at_most(effort):
                cheapest = way()
        except OutOfEffort:
            if number == len(ways) - 1:
                raise
        else:
            return _cost_of(formula, cheapest), cheapest
    raise AssertionError("the last way ended or raised")


def _cost_of(formula: PlanFormula, plan: Plan) -> int:
    costs = formula.costs
    return sum(int(costs[robot][label]) for step in plan for robot, label in enumerate(step))


def _used(
    formula: PlanFormula, task: PlanningTask, cost: int | None, plan: Plan
) -> list[list[Bools]]:
    """Which labels occur where in optimal plans: each that is found shows one a robot and step."""
    makespan = len(plan)
    sizes = [len(own) for own in formula.model.labels]
    used = [[np.zeros(size, np.bool_) for size in sizes] for _ in range(makespan)]

    def enter(found: Plan) -> None:
        for depth, labels in enumerate(found):
            for robot, label in enumerate(labels):
                used[depth][robot][label] = True

    enter(plan)
    for depth in range(makespan):
        for robot in range(len(sizes)):
            while not (own := used[depth][robot]).all():
                step = makespan - depth
                others = [formula.label(step, robot, k) for k in np.flatnonzero(~own).tolist()]
                if not formula.solvable(task.init, makespan, cost, [formula.some_of(others)]):
                    break
                enter(formula.labels_chosen(makespan))
    return used
