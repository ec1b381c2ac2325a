# SPDX-License-Identifier: GPL-3.0-or-later
"""Heuristics against the true distances, and the estimate of a search against the whole search."""

from __future__ import annotations

from collections import Counter

import networkx as nx
import numpy as np
import pytest

from coordlang.commands.inspect import feasibility
from planners.joint.tables import Bools, Ints
from planners.loading import PlanningInstance
from planners.search.goals import FAR
from planners.search.heuristics import HEURISTICS, Bound, heuristic
from planners.search.mutexes import Exclusions, from_start, to_goal
from planners.search.optimal_plans import search
from planners.search.reachable import Space, explore
from planners.search.search_estimate import estimate
from planners.search.state_variables import StateVariable, state_variables
from planners.system.errors import BadInput, ProvedImpossible
from tests.support import thorough
from tests.support.domains import loaded_from
from tests.support.joint_twin import built
from tests.support.random_models import random_threes
from tests.support.random_pddl import random_model
from tests.support.random_spaces import explored, random_instance
from tests.support.texts import model_of


def check(bound: Bound, loaded: PlanningInstance, space: Space) -> Counter[int]:
    """How far below the true distance the bounds are; -1: it is said that there is no way."""
    model, task = loaded.model, loaded.tasks[0]
    true = distances(space, model.holds(task.goal, space.rows))
    least = heuristic(bound, model, task.goal, task.init)(space.rows)
    assert (least[true >= 0] <= true[true >= 0]).all()
    assert ((least == 0) == (true == 0)).all()
    assert (least[space.sources] <= least[space.target] + 1).all()
    gaps = Counter((true - least)[(true >= 0) & (least < FAR)].tolist())
    return gaps + Counter({-1: int((least >= FAR).sum())})


def distances(space: Space, ends: Bools, *, forward: bool = False) -> Ints:
    """The least joint steps from every state to one of the ends, or from it, -1: there is no way."""
    edges = (space.sources, space.target) if forward else (space.target, space.sources)
    graph = nx.DiGraph(zip(*(own.tolist() for own in edges), strict=True))
    graph.add_nodes_from(range(len(space)))
    reached = set(np.flatnonzero(ends).tolist())
    found = nx.multi_source_dijkstra_path_length(graph, reached) if reached else {}
    return np.array([found.get(state, -1) for state in range(len(space))])


def variables_of(loaded: PlanningInstance, space: Space) -> list[StateVariable]:
    """The variables, each with exactly one value in every reachable state."""
    variables = state_variables(loaded.model, loaded.tasks[0].init)
    truth = loaded.model.codec.truth(space.rows)
    for variable in variables:
        assert (truth[:, list(variable.facts)].sum(axis=1) == 1).all()
    return variables


def exclusions(loaded: PlanningInstance, space: Space) -> tuple[list[list[int]], int, int]:
    """Pairs of facts that no state has; how many more are excluded at the start and the goal."""
    model, task = loaded.model, loaded.tasks[0]
    start = from_start(model, task.init)
    assert (start == from_start(model, task.init, block=1)).all()
    left = to_goal(model, task.goal, start == FAR)
    assert (left == to_goal(model, task.goal, start == FAR, block=1)).all()
    begins = (space.rows == task.init).all(axis=1)
    truth, goals = model.codec.truth(space.rows), model.holds(task.goal, space.rows)
    both = (start, distances(space, begins, forward=True)), (left, distances(space, goals))
    for bounds, far in both:
        for state in np.flatnonzero(far >= 0):
            excluded = Exclusions.of(bounds).at(int(far[state]))
            assert not truth[state][excluded].all(axis=1).any(), "excluded facts are both true"
    never = start == FAR
    known = Exclusions.of(never.astype(int)).pairs.tolist()
    return known, *(len(Exclusions.of(np.where(never, 0, own)).at(0)) for own in (start, left))


def test_random_models() -> None:
    seen: Counter[object] = Counter()
    # In the start of the last one no fact is true.
    for loaded in (*map(random_instance, range(96)), built(random_threes(7))):
        if loaded is None or (space := explored(loaded)) is None or len(space) > 3_000:
            continue
        for name in ("blind", "projections", "relaxed"):
            seen += Counter(
                {(name, gap): n for gap, n in check(HEURISTICS[name], loaded, space).items()}
            )
        variables = variables_of(loaded, space)
        seen["with variables" if variables else "without"] += 1
        if not loaded.model.is_joint_action:
            mutexes, soon, late = exclusions(loaded, space)
            seen["mutexes"] += sum(
                not any({*pair} <= {*variable.facts} for variable in variables) for pair in mutexes
            )
            seen["soon"] += soon > 0
            seen["late"] += late > 0
    assert seen["with variables"] >= 20
    assert seen["without"] >= 5
    assert seen["mutexes"] >= 5, "of facts of different variables"
    assert min(seen["soon"], seen["late"]) >= 10
    assert all(seen[name, 1] > 5 for name in ("blind", "projections", "relaxed"))
    assert min(seen["projections", -1], seen["relaxed", -1]) > 5, "no dead end was found"


@pytest.mark.parametrize(
    "problem",
    [
        *("grid/corners-3x3", "grid/gwb5-3x3", "grid-joint/corners-3x3", "corridor/problem"),
        *("push-box/around", "charger/queue", "elevator/two-calls", "handover/exchange"),
        *("vans/one-van", "two-arms/exchange", "lock/let-in", "tray/serve"),
    ],
)
def test_shipped_domains(problem: str) -> None:
    folder, _, stem = problem.partition("/")
    loaded = loaded_from(folder, stem)
    space = explore(loaded.model, loaded.tasks[0].init[None, :])
    for name in HEURISTICS:
        gaps = check(HEURISTICS[name], loaded, space)
        if name == "relaxed" and problem.startswith("grid"):
            # On an open map robots are seldom in each other's way.
            assert gaps[0] > sum(gaps.values()) / 2


@pytest.mark.parametrize(
    ("folder", "problem", "variables", "facts"),
    [
        ("grid", "corners-4x4", 2, 32),  # where each robot is
        ("handover", "exchange", 4, 12),  # and who has a parcel
        ("push-box", "around", 2, 8),  # not the box: two robots push it together
    ],
)
def test_variables_of_domains(folder: str, problem: str, variables: int, facts: int) -> None:
    loaded = loaded_from(folder, problem)
    found = variables_of(loaded, explore(loaded.model, loaded.tasks[0].init[None, :]))
    assert (len(found), sum(len(variable.facts) for variable in found)) == (variables, facts)


# ---- the first layers of a search, and what inspect says of it

MANY = 10**9

WALK = """(define (domain walk) (:types robot place) (:predicates (at ?r - robot ?p - place) (next ?a ?b - place))
  (:action go :agent ?r - robot :parameters (?from ?to - place)
    :precondition (and (at ?r ?from) (next ?from ?to)) :effect (and (not (at ?r ?from)) (at ?r ?to))))"""


def walking(robots: int, places: int, goal: str) -> PlanningInstance:
    """Robots that do not meet, on a line: each of them as far as it likes."""
    lines = [f"(next p{k} p{k + 1})" for k in range(places - 1)]
    starts = [f"(at r{k} p0)" for k in range(robots)]
    problem = f"""(define (problem p) (:domain walk)
      (:objects {" ".join(f"r{k}" for k in range(robots))} - robot {" ".join(f"p{k}" for k in range(places))} - place)
      (:init {" ".join(lines + starts)}) (:goal {goal}))"""
    return model_of(WALK, problem)


@pytest.mark.parametrize("style", ["agent", *thorough("plain"), "joint"])
def test_layers_bounds_and_choices_are_those_of_the_whole_search(style: str) -> None:
    solved = unsolved = 0
    for seed in range(40):
        text = random_model(seed, style)  # type: ignore[arg-type]
        loaded = built(text)
        model, task = loaded.model, loaded.tasks[0]
        try:
            found, layers = estimate(model, task, MANY, MANY)
        except BadInput:  # two joint actions of the same parts that do different things
            continue
        assert found.next_steps is None
        space = explore(model, task.init[None, :])
        begins = (space.rows == task.init).all(axis=1)
        sizes = np.bincount(distances(space, begins, forward=True)).tolist()
        assert list(found.layers) == sizes == [len(rows) for rows in layers if len(rows)]
        assert found.states == len(space)
        assert model.stepper.most_steps(space.rows) >= len(space.labels)
        start = model.successors(task.init[None, :]).labels
        for own, robot in zip(start.T, model.robots, strict=True):
            assert found.choices[robot] >= len(np.unique(own))
        try:
            makespan = search(model, task).layer.max()
        except ProvedImpossible:
            unsolved += 1
            assert found.solvable is False
            continue
        solved += 1
        assert found.solvable
        assert found.makespan == makespan == found.hmax
        short, _ = estimate(model, task, 0, 0)
        assert short.hmax is not None
        assert short.hmax <= makespan
    assert solved >= 5
    assert unsolved >= 1


def test_no_layer_is_begun_that_exceeds_the_work() -> None:
    """Twelve robots, 2^12 joint steps at the start: nothing of it is composed."""
    loaded = walking(12, 20, "(at r0 p19)")
    found, layers = estimate(loaded.model, loaded.tasks[0], steps=4_000)
    assert found.layers == (1,)
    assert found.next_steps == 2**12
    assert found.choices == {f"r{k}": 2 for k in range(12)}
    assert found.hmax == 19
    assert len(layers) == 1
    found, _ = estimate(loaded.model, loaded.tasks[0], steps=5_000)
    assert found.layers == (1, 2**12 - 1)


def said(robots: int, places: int, goal: str) -> dict[str, str]:
    loaded = walking(robots, places, goal)
    found, _ = estimate(loaded.model, loaded.tasks[0])
    return dict(feasibility(found))


def test_what_is_said() -> None:
    small = said(2, 3, "(at r0 p2)")
    assert small["first layers"] == "1, 3, 5 states, and no other can be reached"
    assert small["this task"] == "makespan 2: plans, coordination and build are feasible"
    assert small["--tasks all"] == "9 states, at most 72 tasks: every method is feasible"
    assert "try" not in small
    assert said(2, 3, "(next p2 p0)")["this task"] == "no plan: the goal cannot be reached"
    large = said(7, 60, "(and (at r0 p59) (at r1 p59))")
    assert large["this task"].startswith("makespan 59 at least: about ")
    assert large["try"].startswith("fewer robots (r0 has most choices), fewer objects")
    wide = said(30, 3, "(at r0 p2)")
    assert wide["first layers"].endswith("with at most about 1,073,741,824 joint steps into it")
    assert wide["bound"].startswith("relaxed: makespan 2 at least, by which 1 of these states")
    assert "whether plans ends is not known" in said(17, 3, "(at r0 p2)")["this task"]
