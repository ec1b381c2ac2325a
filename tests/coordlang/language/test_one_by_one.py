# SPDX-License-Identifier: GPL-3.0-or-later
"""Listed tasks searched one by one are those of the explored space; what is checked of starts."""

from __future__ import annotations

import warnings
from collections import Counter

import numpy as np
import pytest

from coordlang.language import candidates as room
from coordlang.language.candidates import Candidates, describe, from_listed
from coordlang.language.listed import ListedTask, goal_text
from planners.joint.model import JointModel, PlanningTask
from planners.joint.tables import Rows
from planners.pddl import parse_domain, parse_problem, read_domain, read_problem
from planners.pddl.lifted import Domain, Problem
from planners.pddl.model_options import ModelOptions
from planners.pddl.sexpr import Source
from planners.search import kept_plans, optimal_plans
from planners.search.plan_space import PlanSpace
from planners.search.plans import Plans, counts
from planners.search.reachable import explore
from planners.system.errors import BadInput, Note, ProvedImpossible
from tests.support.domains import DOMAINS
from tests.support.joint_twin import built
from tests.support.random_pddl import random_model

GRID = DOMAINS / "grid" / "domain.pddl"
CORNERS = DOMAINS / "grid" / "gw4-3x3.pddl"


@pytest.fixture
def large(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every space is too large to be explored."""
    monkeypatch.setattr(room, "MOST_STATES", 0)


@pytest.fixture
def searches(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    done: list[str] = []

    class Counting:
        joined = staticmethod(optimal_plans.joined)

        @staticmethod
        def search(model: JointModel, task: PlanningTask) -> PlanSpace:
            done.append(task.name)
            return optimal_plans.search(model, task)

    monkeypatch.setattr(kept_plans, "optimal_plans", Counting)
    return done


def grid() -> tuple[Domain, list[Problem]]:
    domain = read_domain(GRID)
    return domain, [read_problem(CORNERS, domain)]


def answers(candidates: Candidates) -> Counter[tuple[object, ...]]:
    """Of each task its cost and all its plans, as labels and states."""
    found: Counter[tuple[object, ...]] = Counter()
    for space in candidates.spaces:
        for task in range(len(space.starts)):
            plans = Plans.of(space, task)
            listed = sorted(
                (
                    tuple(map(tuple, plan)),
                    tuple(map(space.model.state_text, _rows(space, plans, n))),
                )
                for n, plan in enumerate(plans)
            )
            found[describe(space, task), space.cost_of(task), tuple(listed)] += 1
    return found


def _rows(space: PlanSpace, plans: Plans, number: int) -> list[Rows]:
    return [space.rows[state] for state in plans.states(plans.unrank(number))]


def some_tasks(model: JointModel, start: np.ndarray, most: int) -> list[ListedTask]:
    """Pairs of reachable states and a partial goal, some of them without a plan."""
    space = explore(model, start[None, :])
    rows = model.codec.facts_part(space.rows)[:: max(1, len(space) // most)][:most]
    states = [tuple(model.codec.facts.texts[f] for f in model.codec.true_facts(r)) for r in rows]
    never = (states[0][0], f"(not {states[0][0]})") if states[0] else ()
    goals = [*(own[:2] for own in states[::2]), never]
    return [ListedTask(init, goal) for init in states for goal in goals]


@pytest.mark.parametrize("kind", ["agent", "plain"])
def test_random_tasks_have_the_same_plans(
    kind: str, monkeypatch: pytest.MonkeyPatch, searches: list[str]
) -> None:
    compared = shared = skipped = 0
    for seed in range(8):
        text = random_model(seed, kind)  # type: ignore[arg-type]
        domain = parse_domain(Source("d", text.domain))
        problem = parse_problem(Source("p", text.problem), domain)
        world = built(text)
        listed = some_tasks(world.model, world.tasks[0].init, 4)
        for remember, cost in ((False, "makespan"), (True, "makespan+actions")):
            options = ModelOptions(
                unowned=text.unowned,
                cost=cost,  # type: ignore[arg-type]
                remember_actions=remember,
            )
            with warnings.catch_warnings(), monkeypatch.context() as patched:
                warnings.simplefilter("ignore", Note)
                try:
                    explored = from_listed(domain, [problem], listed, options, skip_unsolvable=True)
                except ProvedImpossible:
                    continue
                if sum(sum(counts(space)) for space in explored.spaces) > 2000:
                    continue  # plans are listed one by one
                patched.setattr(room, "MOST_STATES", 0)
                before = len(searches)
                single = from_listed(domain, [problem], listed, options, skip_unsolvable=True)
            assert (explored.states is None, single.states) == (False, None)
            assert answers(single) == answers(explored)
            assert single.count == explored.count
            assert single.skipped == explored.skipped
            assert single.listed == explored.listed
            compared += single.count
            shared += single.count + len(single.skipped) - (len(searches) - before)
            skipped += len(single.skipped)
    assert min(compared, shared, skipped) > 10


def test_tasks_on_one_plan_share_its_search(large: None, searches: list[str]) -> None:
    domain, problems = grid()
    cells = ["c0-0", "c0-1", "c0-2", "c1-2"]
    tasks = [ListedTask((f"(at r1 {c})", "(at r2 c2-0)"), ("(at r1 c2-2)",)) for c in cells]
    with pytest.warns(Note, match="4 of 4 tasks start elsewhere .* is not checked"):
        found = from_listed(domain, problems, tasks)
    assert searches == ["1"]
    costs = [found.spaces[0].cost_of(task)[0] for task in range(4)]
    assert costs == [4, 3, 2, 1]
    assert [goal_text(found.model, goal) for goal in found.spaces[0].goals] == ["(at r1 c2-2)"] * 4


@pytest.mark.parametrize(
    "init", [("(at r1 c0-0)",), ("(at r1 c0-0)", "(at r1 c0-1)", "(at r2 c1-1)"), ()]
)
def test_a_robot_that_is_nowhere_or_in_two_places_is_a_mistake(
    large: None, init: tuple[str, ...]
) -> None:
    domain, problems = grid()
    good = ListedTask(("(at r1 c0-0)", "(at r2 c1-1)"), ())
    with pytest.raises(BadInput, match=r"task 2: the state .* cannot be reached from the initial"):
        from_listed(domain, problems, [good, ListedTask(init, ())])
