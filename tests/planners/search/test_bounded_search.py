# SPDX-License-Identifier: GPL-3.0-or-later
"""The bounded search against the blind one: the same plan space, whatever it is bounded by."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import fields, replace
from itertools import product
from random import Random

import numpy as np
import pytest

from planners.joint.model import FullState, JointModel, PlanningTask
from planners.loading import PlanningInstance, build, load
from planners.pddl import parse_domain, parse_problem
from planners.pddl.lifted import Atom
from planners.pddl.model_options import Cost, ModelOptions
from planners.pddl.sexpr import Source
from planners.search.heuristics import CHOICES
from planners.search.optimal_plans import search, search_with_effort
from planners.search.plan_space import PlanSpace
from planners.search.projections import Projections
from planners.search.reachable import PIECES
from planners.search.state_variables import state_variables
from planners.system.errors import BadInput, ProvedImpossible
from tests.support import blind_search
from tests.support.classical_models import read
from tests.support.domains import DOMAINS
from tests.support.random_models import random_model
from tests.support.random_pddl import random_model as random_pddl
from tests.support.random_threes import random_threes

#: Searches that ask the solver at once, with effort for all or some of its answers, and one that
#: composes steps again on the way back.
PIECE_SIZES = (
    PIECES,
    replace(PIECES, probe=0, effort=3_000),
    replace(PIECES, probe=0, effort=100_000, kept=0, states=3),
    replace(PIECES, kept=0, states=2, steps=5),
    replace(PIECES, probe=0, question=0),
    replace(PIECES, probe=0, effort=300, question=0),
)
#: What needs no places: manhattan is compared on a grid.
GENERAL = [name for name in CHOICES if name != "manhattan"]
COSTS: tuple[Cost, ...] = ("makespan", "makespan+actions", "makespan+cost")


def instances(seeds: range, robots: int | None) -> Iterator[PlanningInstance]:
    """Random models; ``robots`` None: MA-PDDL with formulas, shared actions, joint actions."""
    for seed in seeds:
        random = Random(seed)
        options = ModelOptions(cost=random.choice(COSTS), remember_actions=random.random() < 0.2)
        try:
            if robots is not None:
                domain, problem, _ = random_model(seed, robots)
            else:
                text = random_pddl(seed, random.choice(["agent", "plain", "joint"]))
                domain = parse_domain(Source("domain", text.domain))
                problem = parse_problem(Source("problem", text.problem), domain)
                options = replace(options, unowned=text.unowned)
            yield build(domain, [problem], options)
        except BadInput:
            continue


def equal(one: PlanSpace, other: PlanSpace) -> None:
    """Every column is the same; of the table of states, what nodes stand for."""
    assert (one.rows[one.state] == other.rows[other.state]).all()
    for field in fields(PlanSpace):
        a, b = getattr(one, field.name), getattr(other, field.name)
        if isinstance(a, np.ndarray) and field.name not in ("rows", "state"):
            assert a.shape == b.shape, field.name
            assert (a == b).all(), field.name


def expected(model: JointModel, task: PlanningTask) -> PlanSpace | None:
    try:
        return blind_search.search(model, task)
    except ProvedImpossible:
        return None


def compared(models: Iterable[PlanningInstance]) -> Counter[str]:
    met: Counter[str] = Counter()
    for number, loaded in enumerate(models):
        task = loaded.tasks[0]
        try:
            twin = expected(loaded.model, task)
        except BadInput:  # joint actions that no robot can tell apart, somewhere
            continue
        for heuristic in GENERAL:
            pieces = PIECE_SIZES[number % len(PIECE_SIZES)]
            if twin is None:
                with pytest.raises(ProvedImpossible):
                    search(loaded.model, task, pieces, heuristic)
            else:
                equal(search(loaded.model, task, pieces, heuristic), twin)
        met["unsolvable" if twin is None else "solved" if len(twin) > 1 else "at the goal"] += 1
    return met


@pytest.mark.parametrize(("robots", "number"), [(2, 40), (3, 30), (None, 90)])
def test_bounds_lose_no_optimal_plan(robots: int | None, number: int) -> None:
    met = compared(instances(range(number), robots))
    assert met["solved"] >= 10
    assert met["unsolvable"] >= 1


def test_bounds_lose_no_optimal_plan_where_a_third_robot_decides() -> None:
    texts = [random_threes(seed) for seed in range(60)]
    met = compared(
        read(text.domain, text.problem, COSTS[seed % 2]) for seed, text in enumerate(texts)
    )
    assert min(met["solved"], met["unsolvable"]) >= 10


@pytest.mark.slow
@pytest.mark.parametrize("robots", [2, 3, 4, None])
def test_bounds_lose_no_optimal_plan_of_many_models(robots: int | None) -> None:
    met = compared(instances(range(10_000, 10_800), robots))
    print(robots or "any", "robots:", dict(met))
    assert min(met["solved"], met["unsolvable"]) >= 20


# The cost that is left


def test_the_cost_that_is_left_is_a_lower_bound() -> None:
    checked = tight = 0
    for loaded in [*instances(range(60), 2), *instances(range(110), None)]:
        model, task = loaded.model, loaded.tasks[0]
        try:
            space = expected(model, task)
        except BadInput:  # joint actions that no robot can tell apart, somewhere
            continue
        if space is None or model.cost == "makespan":
            continue
        left = np.zeros(len(space), np.int64)
        for layer in space.edges_by_layer():
            left[layer.source] = space.cost[layer.edges] + left[layer.target]
        projections = Projections(model, task.goal, state_variables(model, task.init))
        bound = projections.cost_left(space.rows[space.state])
        assert (bound <= left).all()
        checked += len(space)
        tight += int((bound[left > 0] == left[left > 0]).sum())
    assert tight > 5
    assert checked > 50


def test_steps_are_composed_again_however_many_there_were() -> None:
    """Those on the way back count for no limit of the way there."""
    files = DOMAINS / "grid" / "domain.pddl", [DOMAINS / "grid" / "corners-6x6.pddl"]
    again = 0
    for cost, probe in product(COSTS, (100, 200, 300)):
        loaded = load(*files, ModelOptions(cost=cost))
        pieces = replace(PIECES, probe=probe, kept=0)
        found, effort = search_with_effort(loaded.model, loaded.tasks[0], pieces)
        again += effort.steps > probe and "SAT" not in effort.heuristic
        equal(found, blind_search.search(loaded.model, loaded.tasks[0]))
    assert again


@pytest.mark.parametrize(
    ("init", "goal", "cost", "rounds"),
    [
        # Each goes its own way, and nobody pays for more.
        (("c0-0", "c2-0"), ("c0-2", "c2-2"), (2, 4), (1, 1)),
        # r2 is at its goal, and makes way: two actions more.
        (("c0-0", "c0-1"), ("c0-2", "c0-1"), (2, 4), (2, 2)),
        # They trade places, and one goes round: the least makespan is not what bounds say.
        (("c0-0", "c0-2"), ("c0-2", "c0-0"), (4, 6), (3, 99)),
    ],
)
def test_cheap_plans_first(
    init: tuple[str, str], goal: tuple[str, str], cost: tuple[int, int], rounds: tuple[int, int]
) -> None:
    files = DOMAINS / "grid" / "domain.pddl", [DOMAINS / "grid" / "gw4-3x3.pddl"]
    model = load(*files, ModelOptions(cost="makespan+actions")).model

    def state(cells: tuple[str, str]) -> frozenset[Atom]:
        return frozenset(Atom("at", (f"r{k}", cell)) for k, cell in enumerate(cells, 1))

    goals = FullState(tuple(model.codec.true_facts(model.state(state(goal)))))
    task = PlanningTask("by hand", model.state(state(init)), goals)
    found, effort = search_with_effort(model, task, heuristic="projections")
    assert found.cost_of(0) == cost
    assert rounds[0] <= effort.rounds <= rounds[1]
    twin = blind_search.search(model, task)
    equal(found, twin)
    equal(search(model, task, heuristic="manhattan"), twin)
