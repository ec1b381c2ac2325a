# SPDX-License-Identifier: GPL-3.0-or-later
"""What the solver says of optimal plans, against the plans that blind search finds."""

from __future__ import annotations

from collections import Counter
from contextlib import closing
from functools import partial
from itertools import pairwise, product

import numpy as np
import pytest

from planners.joint.model import JointModel, PlanningTask
from planners.joint.tables import Rows
from planners.loading import PlanningInstance
from planners.pddl.model_options import Cost
from planners.search.cheapest import label_costs, least_cost
from planners.search.dominated_labels import dominated_pairs
from planners.search.exact_bound import ExactBound, exact_bound
from planners.search.mutexes import mutexes
from planners.search.optimal_states import OptimalStates
from planners.search.plan_formula import PlanFormula, TooManyClauses
from planners.search.questions import OutOfEffort
from planners.search.reachable import PIECES
from planners.search.state_variables import state_variables
from planners.system.errors import BadInput, ProvedImpossible
from tests.support import blind_search
from tests.support.random_instances import random_instance

#: The robots' labels, step by step.
Labels = tuple[tuple[int, ...], ...]
#: Plans and beginnings of plans that are listed of one task.
_MANY = 2_000


def small(seed: int, cost: Cost = "makespan+actions") -> PlanningInstance | None:
    """A random model whose joint steps are composed."""
    loaded = random_instance(seed, cost)
    return None if loaded is None or loaded.model.is_joint_action else loaded


def plans(model: JointModel, task: PlanningTask) -> list[Labels] | None:
    """The optimal plans as labels; None if there is none, or too many."""
    try:
        space = blind_search.search(model, task)
    except (ProvedImpossible, BadInput):
        return None
    found: list[Labels] = []
    todo: list[tuple[int, Labels]] = [(int(space.starts[0]), ())]
    while todo and len(found) + len(todo) < _MANY:
        node, so_far = todo.pop()
        edges = range(space.first[node], space.first[node + 1])
        if not edges:
            found.append(so_far)
        todo += [(int(space.target[e]), (*so_far, tuple(space.labels[e].tolist()))) for e in edges]
    return None if todo else found


def bound_of(model: JointModel, task: PlanningTask) -> ExactBound | None:
    variables = state_variables(model, task.init)
    return exact_bound(model, task, variables, 0, PIECES)


def beginnings(model: JointModel, task: PlanningTask, depth: int) -> np.ndarray:
    """Ways of so many joint steps from the start, at most `_MANY` of them."""
    found: list[Labels] = [()]
    rows = task.init[None, :]
    for _ in range(depth):
        steps = model.successors(rows)
        found = [
            (*found[k], tuple(labels))
            for k, labels in zip(steps.source.tolist(), steps.labels.tolist(), strict=True)
        ]
        found, rows = found[:_MANY], steps.result[:_MANY]
    return np.array(found, np.int32).reshape(len(found), depth, len(model.robots))


def compared(seeds: range) -> Counter[str]:
    met: Counter[str] = Counter()
    for seed in seeds:
        loaded = small(seed)
        expected = loaded and plans(loaded.model, loaded.tasks[0])
        if loaded is None or not expected or not expected[0]:
            continue
        model, task = loaded.model, loaded.tasks[0]
        bound = bound_of(model, task)
        if bound is None:  # a condition with too many clauses
            continue
        with closing(bound.plans):
            assert bound.makespan == len(expected[0])
            for step, robot in product(range(bound.makespan), range(len(model.robots))):
                labels = np.flatnonzero(bound.used[step][robot]).tolist()
                assert labels == sorted({plan[step][robot] for plan in expected})
                met["labels"] += len(labels)
            states = OptimalStates(bound.plans, PIECES.question)
            for depth in range(1, min(2, bound.makespan) + 1):
                ways = beginnings(model, task, depth)
                known = {plan[:depth] for plan in expected}
                right = [tuple(map(tuple, way)) in known for way in ways.tolist()]
                assert states.may_pass(ways).tolist() == right
                met["beginnings"] += sum(right)
                met["others"] += len(right) - sum(right)
        met["tasks"] += 1
    return met


def test_labels_and_beginnings_are_those_of_optimal_plans() -> None:
    met = compared(range(80))
    assert min(met.values()) >= 10


@pytest.mark.slow
def test_labels_and_beginnings_are_those_of_optimal_plans_of_many_models() -> None:
    met = compared(range(5_000, 6_500))
    print(dict(met))
    assert met["tasks"] >= 200


def cheapest_compared(seeds: range) -> Counter[str]:
    """The literals of `least_cost` hold in the cheapest of the shortest plans, and in no others."""
    met: Counter[str] = Counter()
    for seed in seeds:
        loaded, shortest = small(seed), small(seed, "makespan")
        if loaded is None or shortest is None:
            continue
        task, model = loaded.tasks[0], loaded.model
        every = plans(shortest.model, shortest.tasks[0])
        if not every or not every[0]:
            continue
        steps = len(every[0])
        variables = state_variables(model, task.init)
        try:
            formula = PlanFormula(
                model, task.goal, variables, partial(mutexes, model, task.init), PIECES.effort
            )
        except TooManyClauses:
            continue
        with closing(formula):
            own_costs = label_costs(model)
            costs = [
                sum(int(own_costs[r][label]) for step in plan for r, label in enumerate(step))
                for plan in every
            ]
            assert formula.solvable(task.init, steps)
            fixed = formula.fixed(task.init, steps)
        with closing(fixed):
            cheap = least_cost(fixed, model, task)
            dominated = dominated_pairs(model, variables)
            for plan, cost in zip(every, costs, strict=True):
                chosen = [
                    fixed.label(k, robot, label)
                    for k, step in enumerate(plan)
                    for robot, label in enumerate(step)
                ]
                saves = any(
                    own[one[robot], two[robot]]
                    for one, two in pairwise(plan)
                    for robot, own in enumerate(dominated)
                )
                assert fixed.holds(chosen) == (not saves)
                assert fixed.holds([*chosen, *cheap]) == (cost == min(costs))
        met["one cost" if min(costs) == max(costs) else "more costs"] += 1
    return met


def test_literals_of_the_least_cost_hold_in_the_cheapest_plans() -> None:
    met = cheapest_compared(range(60))
    assert min(met["one cost"], met["more costs"]) >= 3


@pytest.mark.slow
def test_literals_of_the_least_cost_hold_in_the_cheapest_plans_of_many_models() -> None:
    met = cheapest_compared(range(7_000, 8_500))
    print(dict(met))
    assert min(met["one cost"], met["more costs"]) >= 50


def reached(model: JointModel, task: PlanningTask, plan: Labels) -> bool:
    """Whether a plan, step by step, ends in a goal state."""
    rows = task.init[None, :]
    for labels in plan:
        steps = model.successors(rows)
        rows = steps.result[(steps.labels == labels).all(axis=1)]
        assert len(rows) == 1
    return bool(model.holds(task.goal, rows)[0])


def undecided(self: PlanFormula, row: Rows, steps: int) -> bool:
    """What `PlanFormula.solvable` does with a hard question."""
    raise OutOfEffort


@pytest.mark.parametrize("hard", [False, True])
def test_a_solver_that_knows_one_state_says_what_the_other_says(
    hard: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of every small number of steps; blind search knows the least one that is enough."""
    solvable = PlanFormula.solvable
    if hard:
        monkeypatch.setattr(PlanFormula, "solvable", undecided)
    met: Counter[bool] = Counter()
    for seed in range(60):
        loaded = small(seed)
        if loaded is None:
            continue
        task, model = loaded.tasks[0], loaded.model
        try:
            least = blind_search.search(model, task).cost_of(0)[0]
        except (ProvedImpossible, BadInput):
            least = None
        variables = state_variables(model, task.init)
        pairs = partial(mutexes, model, task.init)
        try:
            formula = PlanFormula(model, task.goal, variables, pairs, PIECES.effort)
        except TooManyClauses:
            continue
        with closing(formula):
            for steps in range(5):
                plan = formula.plan(task.init, steps)
                assert (plan is not None) == solvable(formula, task.init, steps)
                assert plan is None or (len(plan) == steps and reached(model, task, tuple(plan)))
                assert plan is None or (least is not None and least <= steps)
                assert plan is not None or steps != least
                met[plan is not None] += 1
    assert min(met[True], met[False]) >= 20
