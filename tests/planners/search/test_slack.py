# SPDX-License-Identifier: GPL-3.0-or-later
"""Plans within slack: the graph of (state, steps left) against the definition, which lists them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from planners.joint.model import JointModel, PlanningTask
from planners.loading import PlanningInstance, build, load
from planners.pddl.model_options import ModelOptions
from planners.search.optimal_plans import plan_spaces, search
from planners.search.plan_space import PlanSpace
from planners.search.plans import Plan, Plans
from planners.search.reachable import explore
from planners.system.errors import BadInput, ProvedImpossible, UsageError
from tests.support.domains import DOMAINS
from tests.support.naive_slack import Sequences, TooMany
from tests.support.random_models import random_model
from tests.support.slack_counts import SLACK_COUNTS


def loaded(folder: str, stem: str, slack: int, **options: object) -> PlanningInstance:
    return load(
        DOMAINS / folder / "domain.pddl",
        [DOMAINS / folder / f"{stem}.pddl"],
        ModelOptions(slack=slack, **options),  # type: ignore[arg-type]
    )


def listed(space: PlanSpace) -> set[Plan]:
    return set(Plans.of(space))


def nodes_are_states_and_steps_left(space: PlanSpace) -> bool:
    """No node of a task's graph stands for the same state and the same steps left twice."""
    pairs = np.column_stack((space.goal, space.state, space.layer))
    return len(np.unique(pairs, axis=0)) == len(space)


def random_task(seed: int, robots: int, slack: int) -> tuple[JointModel, PlanningTask] | None:
    domain, problem, options = random_model(seed, robots)
    sees, remembers = seed % 2 == 0, seed % 3 == 0
    options = replace(options, slack=slack, words_see_slack=sees, remember_actions=remembers)
    try:
        found = build(domain, [problem], options)
    except BadInput:
        return None
    return found.model, found.tasks[0]


def compared(seeds: range, robots: int) -> Iterator[tuple[set[Plan], PlanSpace]]:
    """The plans of random tasks by the definition, and their graphs; those that can wait."""
    for seed in seeds:
        for slack in (1, 2):
            found = random_task(seed, robots, slack)
            if found is None:
                continue
            model, task = found
            try:
                naive = Sequences(model, task).within(slack)
                if naive is None:
                    continue
                yield naive, search(model, task)
            except (TooMany, ProvedImpossible, UsageError):
                continue


def agree(seeds: range, robots: int) -> int:
    number = 0
    for naive, space in compared(seeds, robots):
        assert listed(space) == naive
        assert nodes_are_states_and_steps_left(space)
        number += len(naive) > 1
    return number


def test_random_tasks_have_the_plans_that_the_definition_lists() -> None:
    assert agree(range(8), 2) > 0
    assert agree(range(3), 3) > 0


@pytest.mark.thorough
def test_more_random_tasks_have_them() -> None:
    assert agree(range(8, 250), 2) > 20
    assert agree(range(3, 80), 3) > 5


@pytest.mark.thorough
@settings(max_examples=40, deadline=None)
@given(st.integers(1000, 5000))
def test_hypothesis_finds_no_task_with_others(seed: int) -> None:
    agree(range(seed, seed + 1), 2)


@pytest.mark.parametrize(("folder", "stem", "makespan", "counts"), SLACK_COUNTS[:3])
def test_counts_of_shipped_problems(
    folder: str, stem: str, makespan: int, counts: tuple[int, ...]
) -> None:
    compare_counts(folder, stem, makespan, counts)


@pytest.mark.thorough
@pytest.mark.parametrize(("folder", "stem", "makespan", "counts"), SLACK_COUNTS[3:])
def test_counts_of_larger_problems(
    folder: str, stem: str, makespan: int, counts: tuple[int, ...]
) -> None:
    compare_counts(folder, stem, makespan, counts)


def compare_counts(folder: str, stem: str, makespan: int, counts: tuple[int, ...]) -> None:
    for slack, count in enumerate(counts):
        found = loaded(folder, stem, slack)
        plans = Plans.of(search(found.model, found.tasks[0]))
        assert plans.count == count
        assert plans.space.least_makespan(0) == makespan


def test_one_pass_over_an_explored_space_finds_what_searches_find() -> None:
    for sees in (False, True):
        found = loaded("three-cells", "problem", 2, words_see_slack=sees)
        model, task = found.model, found.tasks[0]
        space = explore(model, task.init[None, :])
        (every,) = plan_spaces(space, [(task.goal, None)])
        for node in every.starts.tolist():
            row = every.rows[every.state[node]].copy()
            model.codec.clear(row[None, :], slice(None), model.slack_facts)
            own = search(model, replace(task, init=row))
            one = every.with_tasks(np.array([node]), np.zeros(1, np.int64))
            assert listed(one) == listed(own)
            assert len(one) == len(own)


def test_a_plan_is_longer_by_the_slack_at_most_and_its_rest_is_left_out() -> None:
    found = loaded("three-cells", "problem", 1)
    plans = Plans.of(search(found.model, found.tasks[0]))
    assert plans.space.least_makespan(0) == 2
    lengths = [len(plans.without_rest(plan)) for plan in plans]
    assert sorted(set(lengths)) == [2, 3]
    assert lengths.count(2) == 4  # the optimal ones are among them
    for plan in plans:
        short = plans.without_rest(plan)
        assert plans.padded(short) == plan
    assert plans.padded((*plans.unrank(0), (0, 0))) is None


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


def test_robots_that_cannot_wait_in_the_goal_are_refused(tmp_path: Path) -> None:
    found = loaded("grid-joint", "corners-3x3", 1)
    with pytest.raises(UsageError, match="must be able to wait") as error:
        search(found.model, found.tasks[0])
    assert error.value.exit_code == 2


@pytest.mark.parametrize("slack", [-1, True, "1"])
def test_what_is_no_slack_is_refused(slack: object) -> None:
    with pytest.raises(UsageError, match="--slack"):
        ModelOptions(slack=slack)  # type: ignore[arg-type]


def test_seeing_slack_needs_some() -> None:
    with pytest.raises(UsageError, match="belongs to --slack"):
        ModelOptions(words_see_slack=True)


BEEPING = """(define (domain beeping) (:types robot) (:predicates (on ?r - robot))
(:action light :agent ?r - robot :parameters () :precondition () :effect (on ?r))
(:action wait :agent ?r - robot :parameters () :precondition () :effect (and))
(:action beep :agent ?r - robot :parameters () :precondition () :effect (and)))"""


def test_different_plans_stay_different_without_their_rest(tmp_path: Path) -> None:
    """Who rests by waiting or by beeping has several plans: only the first way is left out."""
    domain, problem = tmp_path / "domain.pddl", tmp_path / "problem.pddl"
    domain.write_text(BEEPING)
    problem.write_text(
        "(define (problem p) (:domain beeping) (:objects r1 r2 - robot) (:init) (:goal (on r1)))"
    )
    found = load(domain, [problem], ModelOptions(slack=2))
    plans = Plans.of(search(found.model, found.tasks[0]))
    short = {plans.without_rest(plan) for plan in plans}
    assert len(short) == plans.count > 10
    assert {len(plan) for plan in short} == {1, 2, 3}
    assert {plans.padded(plan) for plan in short} == set(plans)


@pytest.mark.parametrize("slack", [1_000_001, 10**30])
def test_slack_beyond_any_memory_is_refused(slack: int) -> None:
    with pytest.raises(UsageError, match="more than 1,000,000 joint steps"):
        ModelOptions(slack=slack)
