# SPDX-License-Identifier: GPL-3.0-or-later
"""Plans within slack: the graph of (state, steps left) against the definition, which lists them."""

from __future__ import annotations

from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np
import pytest

from planners.classical import ClassicalAction, ClassicalTask, compile_classical, to_pddl
from planners.loading import PlanningInstance, build, load
from planners.pddl.model_options import ModelOptions
from planners.search.optimal_plans import plan_spaces, search
from planners.search.plans import Plans
from planners.search.reachable import explore
from planners.system.errors import BadInput, ProvedImpossible, UsageError
from tests.support.domains import DOMAINS
from tests.support.naive_slack import Sequences, TooMany
from tests.support.random_models import random_model

#: Problems, their least makespans, and their numbers of plans within slack 0, 1 and 2.
COUNTS = [
    ("t-map/problem", 4, (2, 18, 114)),
    ("three-cells/problem", 2, (4, 20, 104)),
    ("grid/gw1-2x2", 2, (2, 18, 140)),
    ("grid/corners-3x3", 4, (18, 514, 11554)),
    ("grid/corners-4x4", 6, (236, 12860, 500744)),
    ("corridor/problem", 10, (32, 1920, 70680)),
    ("handover/exchange", 10, (128, 3392, 55904)),
]


def loaded(folder: str, stem: str, slack: int, **options: object) -> PlanningInstance:
    return load(
        DOMAINS / folder / "domain.pddl",
        [DOMAINS / folder / f"{stem}.pddl"],
        ModelOptions(slack=slack, **options),  # type: ignore[arg-type]
    )


@pytest.mark.parametrize(
    ("robots", "seeds"),
    [
        (2, range(8)),
        (3, range(3)),
        pytest.param(2, range(8, 250), marks=pytest.mark.thorough),
        pytest.param(3, range(3, 80), marks=pytest.mark.thorough),
    ],
)
def test_random_tasks_have_the_plans_that_the_definition_lists(robots: int, seeds: range) -> None:
    """And no node of a task's graph stands for the same state and the same steps left twice."""
    several = 0
    for seed, slack in product(seeds, (1, 2)):
        domain, problem, options = random_model(seed, robots)
        sees, remembers = seed % 2 == 0, seed % 3 == 0
        options = replace(options, slack=slack, words_see_slack=sees, remember_actions=remembers)
        try:
            found = build(domain, [problem], options)
            naive = Sequences(found.model, found.tasks[0]).within(slack)
            if naive is None:
                continue
            space = search(found.model, found.tasks[0])
        except (BadInput, TooMany, ProvedImpossible, UsageError):
            continue
        assert {*Plans.of(space)} == naive
        nodes = np.column_stack((space.goal, space.state, space.layer))
        assert len(np.unique(nodes, axis=0)) == len(space)
        several += len(naive) > 1
    assert several > len(seeds) // 20


@pytest.mark.parametrize(
    ("name", "makespan", "counts"),
    [pytest.param(*row, marks=[pytest.mark.thorough] * (n > 2)) for n, row in enumerate(COUNTS)],
)
def test_counts_of_shipped_problems(name: str, makespan: int, counts: tuple[int, ...]) -> None:
    folder, stem = name.split("/")
    for slack, count in enumerate(counts):
        found = loaded(folder, stem, slack)
        plans = Plans.of(search(found.model, found.tasks[0]))
        assert plans.count == count
        assert plans.space.least_makespan(0) == makespan


def ticking(task: ClassicalTask) -> ClassicalTask:
    """The same plans, one to one, of actions that change something: each makes a fact true, or
    false again.

    The translator that K* uses drops operators without effects, as a step in which all wait is.
    """
    tick = len(task.facts)

    def twice(action: ClassicalAction) -> tuple[ClassicalAction, ...]:
        on = (*action.preconditions, (tick, False)), (*action.adds, tick), action.deletes
        off = (*action.preconditions, (tick, True)), action.adds, (*action.deletes, tick)
        return tuple(
            replace(action, name=f"{action.name} {name}", preconditions=p, adds=a, deletes=d)
            for name, (p, a, d) in (("tick", on), ("tock", off))
        )

    actions = tuple(both for action in task.actions for both in twice(action))
    return replace(task, facts=(*task.facts, "(tick)"), actions=actions)


@pytest.mark.slow
@pytest.mark.parametrize("slack", [0, 1, 2])
@pytest.mark.parametrize(("name", "makespan", "counts"), COUNTS)
def test_k_star_counts_the_same_plans(
    name: str,
    makespan: int,
    counts: tuple[int, ...],
    slack: int,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """An independent planner, in its top-quality mode (``pip install '.[oracles]'``).

    It counts every sequence of actions within the bound that ends in the goal: the sum of ours over
    the slacks up to this one.
    """
    planners = pytest.importorskip(
        "kstar_planner.planners", reason="K* is not installed (extra oracles)"
    )
    wanted = sum(counts[: slack + 1])
    if wanted > 100_000:
        pytest.skip("more plans than K* lists in reasonable time")
    folder, stem = name.split("/")
    found = loaded(folder, stem, 0)
    plain = ticking(compile_classical(found.model, found.tasks[0], limit=100_000))
    assert plain.form == "explicit"
    domain, problem = tmp_path / "d.pddl", tmp_path / "p.pddl"
    for path, text in zip((domain, problem), to_pddl(plain), strict=True):
        path.write_text(text)
    monkeypatch.chdir(tmp_path)
    bound = (makespan + slack + 0.001) / makespan  # a little more: it compares floats
    answer = planners.plan_topq(domain, problem, quality_bound=bound, timeout=600)
    assert "search exit code: 0" in answer["planner_output"]
    assert len({tuple(plan["actions"]) for plan in answer["plans"]}) == wanted


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
            assert {*Plans.of(one)} == {*Plans.of(own)}
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


BEEPING = """(define (domain beeping) (:types robot) (:predicates (on ?r - robot))
(:action light :agent ?r - robot :parameters () :precondition () :effect (on ?r))
(:action wait :agent ?r - robot :parameters () :precondition () :effect (and))
(:action beep :agent ?r - robot :parameters () :precondition () :effect (and)))"""


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"slack": -1}, "--slack"),
        ({"slack": True}, "--slack"),
        ({"slack": "1"}, "--slack"),
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
