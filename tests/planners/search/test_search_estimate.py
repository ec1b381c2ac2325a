# SPDX-License-Identifier: GPL-3.0-or-later
"""The first layers of a search, and what `inspect` says of it, against the whole search."""

from __future__ import annotations

import numpy as np
import pytest

from coordlang.commands.inspect import feasibility
from planners.joint.model import JointModel
from planners.joint.tables import Rows, find_rows, unique_rows
from planners.loading import PlanningInstance
from planners.search.optimal_plans import search
from planners.search.reachable import explore
from planners.search.search_estimate import estimate
from planners.system.errors import BadInput, ProvedImpossible
from tests.support.joint_twin import built
from tests.support.random_pddl import random_model
from tests.support.texts import model_of

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


def naive_layers(model: JointModel, init: Rows) -> list[int]:
    """The definition: states by their least number of joint steps from the start."""
    seen = init[None, :]
    sizes = [1]
    while True:
        after, _ = unique_rows(model.successors(seen).result)
        new = after[find_rows(seen, after) < 0]
        if not len(new):
            return sizes
        sizes.append(len(new))
        seen, _ = unique_rows(np.concatenate((seen, new)))


@pytest.mark.parametrize("style", ["agent", "plain", "joint"])
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
        assert (
            list(found.layers)
            == naive_layers(model, task.init)
            == [len(rows) for rows in layers if len(rows)]
        )
        space = explore(model, task.init[None, :])
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
