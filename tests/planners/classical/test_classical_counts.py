# SPDX-License-Identifier: GPL-3.0-or-later
"""The optimal plans of both plain forms stand one to one for the optimal joint plans."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace

import pytest
from hypothesis import event, example, given, reject, settings
from hypothesis import strategies as st

from planners.classical import compile_classical
from planners.joint.model import JointModel, PlanningTask
from planners.loading import PlanningInstance
from planners.pddl.model_options import Cost
from planners.search.optimal_plans import search
from planners.search.plans import Plans
from planners.search.reachable import explore
from planners.system.errors import BadInput, ProvedImpossible
from tests.support.classical_models import (
    COSTS,
    FORMS,
    MODELS,
    WAYS,
    random_state,
    read,
    written,
)
from tests.support.naive_classical import optimal_plans
from tests.support.random_pddl import KINDS, Kind, random_model
from tests.support.random_threes import random_threes

#: Two ground actions of joint-action PDDL with the same parts: where both are possible they are one
#: joint action.
TWICE = """
(define (domain twice)
  (:types lamp)
  (:constants b - lamp)
  (:predicates (lit ?l - lamp) (far) (done))
  (:functions (total-cost) (price ?l - lamp))
  (:action walk
    ; subaction r1 (walk)
    ; subaction r2 idle
    :parameters (?l - lamp) :precondition (lit ?l) :effect (and (far) (increase (total-cost) (price ?l))))
  (:action stop
    ; subaction r1 idle
    ; subaction r2 (stop)
    :parameters () :precondition (far) :effect (done))
  (:action break-b
    ; subaction r1 (walk)
    ; subaction r2 (break)
    :parameters () :precondition () :effect (and (far) (not (lit b)))))
"""
TWICE_TASK = """(define (problem p) (:domain twice) (:objects a - lamp)
  (:init (lit a) (lit b) (= (price a) 2) (= (price b) 1)) (:goal (done)))"""
#: A goal in disjunctions, several of which hold at the end.
ANYWAY = """
(define (domain anyway) (:types robot)
  (:predicates (done ?r - robot) (warm))
  (:action work :agent ?r - robot :parameters ()
    :precondition (or (not (done ?r)) (warm) (exists (?o - robot) (and (not (= ?o ?r)) (not (done ?o)))))
    :effect (and (done ?r) (when (or (warm) (not (done ?r)) (exists (?o - robot) (done ?o))) (warm)))))
"""
ANYWAY_TASK = """(define (problem p) (:domain anyway) (:objects r1 r2 - robot) (:init)
  (:goal (or (and (done r1) (or (done r2) (warm))) (warm) (and (done r2) (warm)))))"""


def ours(loaded: PlanningInstance) -> int:
    return Plans.of(search(loaded.model, loaded.tasks[0])).count


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("cost", [*COSTS, "makespan+cost"])
@pytest.mark.parametrize("name", [*MODELS, "twice", "anyway"])
def test_every_plan_once(name: str, cost: Cost, form: str) -> None:
    texts = {**MODELS, "twice": (TWICE, TWICE_TASK), "anyway": (ANYWAY, ANYWAY_TASK)}[name]
    loaded = read(*texts, cost)
    plain = compile_classical(loaded.model, loaded.tasks[0], FORMS[form])
    assert plain.form == form
    assert optimal_plans(plain).count() == ours(loaded)


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("cost", COSTS)
@pytest.mark.parametrize("name", MODELS)
def test_every_plan_once_however_it_is_written(name: str, cost: Cost, way: str) -> None:
    loaded = read(*MODELS[name], cost)
    with written(way):
        plain = compile_classical(loaded.model, loaded.tasks[0], 0)
    assert optimal_plans(plain).count() == ours(loaded)


def test_what_is_applied_at_once_takes_fewer_states() -> None:
    """In the corridor all is, in the relay what is handed over is not."""
    for name in ("corridor", "relay"):
        loaded = read(*MODELS[name])
        states = []
        for way in ("usual", "tidied", "nothing at once"):
            with written(way):
                plain = compile_classical(loaded.model, loaded.tasks[0], 0)
            states.append(len(optimal_plans(plain).edges))
        assert states == sorted(set(states)), name


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("name", MODELS)
def test_what_the_form_says_of_a_step_ends_only_where_it_is_known_true(name: str, way: str) -> None:
    """Else planners without conditional effects could not read it: "if true, false"."""
    loaded = read(*MODELS[name])
    with written(way):
        plain = compile_classical(loaded.model, loaded.tasks[0], 0)
    own = set(range(len(loaded.model.codec.facts), len(plain.facts)))
    for action in plain.actions:
        true = {fact for fact, positive in action.preconditions if positive}
        assert own & {*action.deletes} <= true, action.name


def test_one_joint_action_in_two_guises() -> None:
    loaded = read(TWICE, TWICE_TASK, "makespan+cost")
    space = search(loaded.model, loaded.tasks[0])
    assert (space.cost_of(0), Plans.of(space).count) == ((2, 0), 1)
    assert ours(read(TWICE, TWICE_TASK)) == 2


@settings(max_examples=25, deadline=None, derandomize=True)
@given(seed=st.integers(0, 100_000), kind=st.sampled_from(KINDS), cost=st.sampled_from(COSTS))
def test_every_plan_of_random_models_once(seed: int, kind: Kind, cost: Cost) -> None:
    text = random_model(seed, kind)
    try:
        loaded = read(text.domain, text.problem, cost, text.unowned)
        space = explore(loaded.model, random_state(loaded, seed)[None, :])
    except BadInput:  # one label tuple, two results
        reject()
    last = space.model.full_state(space.rows[seed % len(space)])
    task = replace(loaded.tasks[0], init=random_state(loaded, seed), goal=last)
    assert every_plan_once(loaded.model, task)


@settings(max_examples=60, deadline=None, derandomize=True)
@given(seed=st.integers(0, 100_000), cost=st.sampled_from(COSTS))
@example(seed=82, cost="makespan").via("a third action makes one delete what another adds")
@example(seed=331, cost="makespan+actions").via("the same, and no plan was left")
def test_every_plan_once_where_a_third_robot_decides(seed: int, cost: Cost) -> None:
    text = random_threes(seed)
    loaded = read(text.domain, text.problem, cost)
    every_plan_once(loaded.model, loaded.tasks[0])


def every_plan_once(model: JointModel, task: PlanningTask) -> int:
    """That all forms have the plans of a task, and as cheap ones; how many there are."""
    expected: tuple[tuple[int, int] | None, int] = (None, 0)
    with suppress(ProvedImpossible):
        space = search(model, task)
        expected = (space.cost_of(0), Plans.of(space).count)
    event(f"plans: {expected[1] if expected[1] < 3 else 'many'}")
    for limit, ways in ((100_000, WAYS[:1]), (0, WAYS)):
        for way in ways:
            with written(way):
                plain = compile_classical(model, task, limit)
            found = optimal_plans(plain)
            cost = None if found.cost is None else plain.cost(found.cost)
            assert (cost, found.count()) == expected, (way, limit)
    return expected[1]
