# SPDX-License-Identifier: GPL-3.0-or-later
"""Plans within slack: the graph of (state, steps left) against the definition, which lists them."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from planners.loading import PlanningInstance, build
from planners.pddl.model_options import ModelOptions
from planners.search.optimal_plans import plan_spaces, search
from planners.search.plans import Plans, texts
from planners.search.reachable import explore
from planners.system.errors import BadInput, ProvedImpossible, UsageError
from tests.support import thorough
from tests.support.domains import loaded_from
from tests.support.naive_joint_steps import Labels, Price, Twin
from tests.support.random_models import random_model
from tests.support.texts import model_of

#: Problems, their least makespans, and their numbers of plans within slack 0, 1 and 2 (the sums
#: are those of K* in its top-quality mode).
COUNTS = [
    ("t-map/problem", 4, (2, 18, 114)),
    ("three-cells/problem", 2, (4, 20, 104)),
    ("grid/gw1-2x2", 2, (2, 18, 140)),
    ("grid/corners-3x3", 4, (18, 514, 11554)),
    ("grid/corners-4x4", 6, (236, 12860, 500744)),
    ("corridor/problem", 10, (32, 1920, 70680)),
    ("handover/exchange", 10, (128, 3392, 55904)),
]


def by_definition(
    found: PlanningInstance, price: Price = lambda _: 0
) -> set[tuple[Labels, ...]] | None:
    """The plans within slack, with a rest at the end; None if there is none, or too many."""
    (problem,) = found.problems
    twin = Twin(found.domain, problem, found.team)
    if found.model.cost == "makespan+actions":
        price = twin.actions
    listed = twin.optimal(problem.goal, price, found.model.slack)
    return None if listed is None or listed.count > 4_000 else {*listed.plans}


def loaded(folder: str, stem: str, slack: int, **options: object) -> PlanningInstance:
    return loaded_from(folder, stem, ModelOptions(slack=slack, **options))  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("robots", "seeds"),
    [(2, range(8)), (3, range(3)), *thorough((2, range(8, 250)), (3, range(3, 80)))],
)
def test_random_tasks_have_the_plans_that_the_definition_lists(robots: int, seeds: range) -> None:
    """And no node of a task's graph stands for the same state and the same steps left twice."""
    several = shorter = 0
    for seed, slack in product(seeds, (1, 2)):
        domain, problem, options = random_model(seed, robots)
        sees, remembers = seed % 2 == 0, seed % 3 == 0
        options = replace(options, slack=slack, words_see_slack=sees, remember_actions=remembers)
        try:
            found = build(domain, [problem], options)
            naive = by_definition(found)
            if naive is None:
                continue
            space = search(found.model, found.tasks[0])
        except (BadInput, ProvedImpossible, UsageError):
            continue
        plans = Plans.of(space)
        assert {texts(found.model, plan) for plan in plans} == naive
        assert len(naive) == plans.count
        short = {plans.steps(plan) for plan in plans}
        assert len(short) == plans.count
        assert {plans.of_steps(plan) for plan in short} == {*plans}
        shorter += len({*map(len, short)}) > 1
        nodes = np.column_stack((space.goal, space.state, space.layer))
        assert len(np.unique(nodes, axis=0)) == len(space)
        several += len(naive) > 1
    assert min(several, shorter) > len(seeds) // 20


@pytest.mark.parametrize(
    ("name", "makespan", "counts"),
    [*COUNTS[:3], *thorough(*COUNTS[3:])],
)
def test_counts_of_shipped_problems(name: str, makespan: int, counts: tuple[int, ...]) -> None:
    folder, stem = name.split("/")
    for slack, count in enumerate(counts):
        found = loaded(folder, stem, slack)
        plans = Plans.of(search(found.model, found.tasks[0]))
        assert plans.count == count
        assert slack == 0 or plans.of_steps((*plans.unrank(0), (0, 0))) is None
        assert plans.space.least_makespan(0) == makespan


def test_one_pass_over_an_explored_space_finds_what_searches_find() -> None:
    for sees in (False, True):
        found = loaded("three-cells", "problem", 2, words_see_slack=sees)
        model, task = found.model, found.tasks[0]
        space = explore(model, task.init[None, :])
        (every,) = plan_spaces(space, [(task.goal, None)])
        for node in every.starts.tolist():
            row = model.forgetting_slack(every.rows[every.state[node]])
            own = search(model, replace(task, init=row))
            one = every.with_tasks(np.array([node]), np.zeros(1, np.int64))
            assert {*Plans.of(one)} == {*Plans.of(own)}
            assert len(one) == len(own)


def test_states_say_what_is_left_only_if_asked() -> None:
    blind = loaded("three-cells", "problem", 1)
    space = search(blind.model, blind.tasks[0])
    assert len(np.unique(space.state)) < len(space)
    seeing = loaded("three-cells", "problem", 1, words_see_slack=True)
    seen = search(seeing.model, seeing.tasks[0])
    assert len(np.unique(seen.state)) == len(seen) == len(space)
    keys = {seen.model.codec.key(seen.rows[state]) for state in seen.state}
    assert all(("(slack-left 0)" in key) != ("(slack-left 1)" in key) for key in keys)
    start = seen.model.codec.key(seen.rows[seen.state[seen.starts[0]]])
    assert "(slack-left 1)" in start


def test_the_cheapest_within_the_bound_under_a_second_cost() -> None:
    """With time to spare one robot makes the detour alone: fewer subactions than in least time."""
    costs = []
    for slack in (0, 1, 2):
        found = loaded("t-map", "problem", slack, cost="makespan+actions")
        space = search(found.model, found.tasks[0])
        costs.append(space.cost_of(0))
    assert [steps for steps, _ in costs] == [costs[0][0] + slack for slack in (0, 1, 2)]
    assert [second for _, second in costs] == sorted((s for _, s in costs), reverse=True)


#: A step in which both robots idle that reaches the goal, and idling that costs more than doing.
TICK = """(define (domain d) (:constants r1 r2) (:predicates (a) (done))
 (:action tick :parameters () ; subaction r1 idle
  ; subaction r2 idle
  :precondition (a) :effect (done))
 (:action go :parameters () ; subaction r1 (go r1)
  ; subaction r2 idle
  :precondition () :effect (a)))"""
DEAR = """(define (domain d) (:types robot) (:constants r1 r2 - robot)
 (:predicates (a ?r - robot) (done)) (:functions (total-cost) - number)
 (:action wait :agent ?r - robot :parameters () :effect (increase (total-cost) 2))
 (:action do :agent ?r - robot :parameters () :effect (and (done) (increase (total-cost) 1)))
 (:action nop :agent ?r - robot :parameters () :effect (a ?r)))"""


@pytest.mark.parametrize(("domain", "rest", "lengths"), [(TICK, 0, [2, 3, 3]), (DEAR, 2, [2] * 4)])
def test_a_rest_is_in_the_goal_and_may_be_dear(domain: str, rest: int, lengths: list[int]) -> None:
    problem = "(define (problem p) (:domain d) (:goal (done)))"
    found = model_of(domain, problem, ModelOptions(slack=1, cost="makespan+cost"))
    plans = Plans.of(search(found.model, found.tasks[0]))
    price = {None: rest, "(do r1)": 1, "(do r2)": 1}
    naive = by_definition(found, lambda step: sum(price.get(text, 0) for text in step))
    assert {texts(found.model, plan) for plan in plans} == naive
    assert sorted(len(plans.steps(plan)) for plan in plans) == lengths


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"slack": 1_000_001}, "more than 1,000,000 joint steps"),
        ({"slack": 10**30}, "more than 1,000,000 joint steps"),
        ({"words_see_slack": True}, "belongs to --slack"),
    ],
)
def test_what_is_no_slack_is_refused(options: dict[str, object], message: str) -> None:
    with pytest.raises(UsageError, match=message):
        ModelOptions(**options)  # type: ignore[arg-type]
    robots_cannot_wait = loaded("grid-joint", "corners-3x3", 1)
    with pytest.raises(UsageError, match="must be able to wait"):
        search(robots_cannot_wait.model, robots_cannot_wait.tasks[0])
