# SPDX-License-Identifier: GPL-3.0-or-later
"""Heuristics against the true distances: admissible, consistent, zero exactly at the goals."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

from planners.joint.model import Goal, JointModel
from planners.joint.tables import Rows
from planners.loading import PlanningInstance, build, load
from planners.search.goals import FAR
from planners.search.heuristics import HEURISTICS, heuristic
from planners.search.reachable import Space, explore
from planners.system.errors import UsageError
from tests.support.domains import DOMAINS
from tests.support.random_models import random_model


def check(name: str, model: JointModel, goal: Goal, init: Rows, space: Space) -> Counter[int]:
    """How far below the true distance the bounds are."""
    true = distances(space, model.holds(goal, space.rows).tolist())
    bound = heuristic(name, model, goal, init)(space.rows)
    assert (bound[true >= 0] <= true[true >= 0]).all()
    assert ((bound == 0) == (true == 0)).all()
    source = np.repeat(np.arange(len(space)), np.diff(space.first))
    assert (bound[source] <= bound[space.target] + 1).all()
    return Counter((true - bound)[(true >= 0) & (bound < FAR)].tolist()) + Counter(
        {-1: int((bound >= FAR).sum())}
    )


def distances(space: Space, goals: list[bool]) -> np.ndarray:
    """The least joint steps from every state to a goal, -1 where there is no way: layer by layer,
    backward.
    """
    before: dict[int, set[int]] = {}
    for state in range(len(space)):
        for target in space.target[space.first[state] : space.first[state + 1]].tolist():
            before.setdefault(target, set()).add(state)
    found = {state: 0 for state, reached in enumerate(goals) if reached}
    layer, steps = set(found), 0
    while layer:
        steps += 1
        layer = {s for t in layer for s in before.get(t, ())} - found.keys()
        found.update(dict.fromkeys(layer, steps))
    return np.array([found.get(state, -1) for state in range(len(space))])


def of(loaded: PlanningInstance) -> tuple[JointModel, Goal, Rows, Space]:
    task = loaded.tasks[0]
    return loaded.model, task.goal, task.init, explore(loaded.model, task.init[None, :])


@pytest.mark.parametrize("name", ["blind", "projections", "relaxed"])
def test_random_models(name: str) -> None:
    seen: Counter[int] = Counter()

    for seed in range(120):
        domain, problem, options = random_model(seed, 2 + seed % 2)
        seen.update(check(name, *of(build(domain, [problem], options))))
    assert seen[1] > 5
    assert name == "blind" or seen[-1] > 5, "no dead end was found"


@pytest.mark.parametrize(
    "problem",
    [
        "grid/corners-3x3",
        "grid/gwb5-3x3",
        "grid-joint/corners-3x3",
        "corridor/problem",
        "push-box/around",
        "charger/queue",
        "elevator/two-calls",
        "handover/exchange",
        "vans/one-van",
        "two-arms/exchange",
        "lock/let-in",
        "tray/serve",
    ],
)
def test_shipped_domains(problem: str) -> None:
    folder = DOMAINS / problem.split("/")[0]
    loaded = load(folder / "domain.pddl", [DOMAINS / f"{problem}.pddl"])
    for name in HEURISTICS:
        try:
            gaps = check(name, *of(loaded))
        except UsageError:
            assert name == "manhattan"
            assert folder.name not in ("grid", "grid-joint", "corridor")
            continue
        if name == "relaxed" and problem.startswith("grid"):
            assert gaps[0] > sum(gaps.values()) / 2, (
                "on an open map robots are seldom in each other's way"
            )


def test_manhattan_is_the_distance_on_the_map() -> None:
    loaded = load(DOMAINS / "grid" / "domain.pddl", [DOMAINS / "grid" / "corners-4x4.pddl"])
    bound = heuristic("manhattan", loaded.model, loaded.tasks[0].goal, loaded.tasks[0].init)
    assert bound(loaded.tasks[0].init[None, :]).tolist() == [6]
    row = loaded.model.codec.parse_key("(at r1 c3-3) (at r2 c1-0)")
    assert bound(row[None, :]).tolist() == [1]


JUMPS = """(define (domain jumps) (:types robot place) (:predicates (at ?r - robot ?x - place) (way ?x ?y - place))
(:action go :agent ?r - robot :parameters (?x ?y - place) :precondition (and (at ?r ?x) (way ?x ?y))
  :effect (and (at ?r ?y) (not (at ?r ?x))))
{more})"""
AROUND = """(define (problem p) (:domain jumps) (:objects r1 r2 - robot c0-0 c0-3 c0-6 c0-7 - place)
(:init (at r1 c0-0) (at r2 c0-0) (way c0-0 c0-3) (way c0-3 c0-6) (way c0-6 c0-7)) (:goal (and (at r1 c0-7) (at r2 c0-3))))"""


def test_manhattan_is_admissible_where_robots_jump() -> None:
    """Three cells a step: seven cells are three steps; and nothing is known of a robot that turns
    up anywhere.
    """
    from planners.pddl import parse_domain, parse_problem
    from planners.pddl.sexpr import Source

    for more, expected in [
        ("", 3),
        ("(:action beam :agent ?r - robot :parameters (?x - place) :effect (at ?r ?x))", None),
    ]:
        domain = parse_domain(Source("d", JUMPS.format(more=more)))
        loaded = build(domain, [parse_problem(Source("p", AROUND), domain)])
        model, goal, init, space = of(loaded)
        if expected is None:
            with pytest.raises(UsageError, match="Manhattan"):
                heuristic("manhattan", model, goal, init)
            continue
        check("manhattan", model, goal, init, space)
        assert heuristic("manhattan", model, goal, init)(
            loaded.tasks[0].init[None, :]
        ).tolist() == [expected]
