# SPDX-License-Identifier: GPL-3.0-or-later
"""Optimal plans of both plain forms: one for each optimal joint plan, at the same cost."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from itertools import product

import pytest
from hypothesis import event, example, given, reject, settings
from hypothesis import strategies as st

from planners.classical import compile_classical
from planners.classical.task import to_pddl
from planners.joint.model import JointModel, PlanningTask
from planners.pddl.model_options import Cost, ModelOptions
from planners.search.optimal_plans import search
from planners.search.plans import Plans
from planners.search.reachable import explore
from planners.system.errors import BadInput, ProvedImpossible
from tests.support.classical_models import (
    CORRIDOR,
    CORRIDOR_TASK,
    COSTS,
    FORMS,
    MODELS,
    WAYS,
    random_state,
    read,
    written,
)
from tests.support.naive_classical import optimal_plans
from tests.support.random_models import random_threes
from tests.support.random_pddl import KINDS, Kind, random_model
from tests.support.texts import model_of, parsed

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
#: What forbids another action is a disjunction, but for what is never true.
GATE = """
(define (domain gate) (:types robot gate)
  (:constants a b - gate)
  (:predicates (in ?r - robot) (wide ?g - gate))
  (:action widen :agent ?r - robot :parameters (?g - gate) :precondition (= ?g a) :effect (wide ?g))
  (:action enter :agent ?r - robot :parameters ()
    :precondition (forall (?o - robot) (or (= ?o ?r) (not (enter ?o)) (wide b))) :effect (in ?r)))
"""
GATE_TASK = """(define (problem p) (:domain gate) (:objects r1 r2 - robot) (:init)
  (:goal (and (in r1) (in r2))))"""
#: Makespans and numbers of actions of `MODELS`.
LEAST = [(3, 3), (2, 2), (6, 6), (6, 11), (2, 3), (1, 2), (2, 2), (3, 3), (1, 3)]
TEXTS = {
    **MODELS,
    "twice": (TWICE, TWICE_TASK),
    "anyway": (ANYWAY, ANYWAY_TASK),
    "gate": (GATE, GATE_TASK),
}


def every_plan_once(model: JointModel, task: PlanningTask) -> tuple[tuple[int, int] | None, int]:
    """All forms have the plans of a task, and as cheap ones; their cost, and how many there are."""
    expected: tuple[tuple[int, int] | None, int] = (None, 0)
    with suppress(ProvedImpossible):
        space = search(model, task)
        expected = (space.cost_of(0), Plans.of(space).count)
    for form, ways in (("explicit", WAYS[:1]), ("select-then-apply", WAYS)):
        for way in ways:
            with written(way):
                plain = compile_classical(model, task, FORMS[form])
            found = optimal_plans(plain)
            cost = None if found.cost is None else plain.cost(found.cost)
            assert plain.form == form
            assert (cost, found.count()) == expected, (way, form)
    return expected


@pytest.mark.parametrize(("name", "cost"), [*product(TEXTS, COSTS), ("twice", "makespan+cost")])
def test_every_plan_once(name: str, cost: Cost) -> None:
    loaded = read(*TEXTS[name], cost)
    found, number = every_plan_once(loaded.model, loaded.tasks[0])
    if cost == "makespan+actions" and name in MODELS:  # they are not trivial
        assert found == dict(zip(MODELS, LEAST, strict=True))[name]
    if name == "twice" and cost != "makespan+actions":  # one joint action in two guises
        assert number == (1 if cost == "makespan+cost" else 2)


@pytest.mark.parametrize(
    ("goal", "cost"),
    [
        ("(or (at r1 a) (at r1 b))", (0, 0)),
        ("(and (at r1 c) (at r2 c))", None),
        ("(and (at r1 a) (or (next a d) (at r1 b)) (not (at r1 a)))", None),
    ],
)
def test_goals_that_hold_at_the_start_or_never(goal: str, cost: tuple[int, int] | None) -> None:
    loaded = read(CORRIDOR, CORRIDOR_TASK.replace("(and (at r1 c) (at r2 a))", goal))
    assert every_plan_once(loaded.model, loaded.tasks[0])[0] == cost


def test_full_states_as_goals_and_remembered_actions() -> None:
    loaded = model_of(CORRIDOR, CORRIDOR_TASK, ModelOptions(remember_actions=True))
    plain = compile_classical(loaded.model, loaded.tasks[0], 0)
    assert plain.cost(optimal_plans(plain).cost or 0) == (6, 0)
    loaded = read(CORRIDOR, CORRIDOR_TASK)
    model, task = loaded.model, loaded.tasks[0]
    last = search(model, task)
    row = last.rows[last.state[0]]
    every_plan_once(model, replace(task, goal=model.full_state(row)))
    every_plan_once(model, replace(task, init=row, goal=model.full_state(task.init)))


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
    event(f"plans: {min(every_plan_once(loaded.model, task)[1], 3)}")


@settings(max_examples=25, deadline=None, derandomize=True)
@given(seed=st.integers(0, 100_000), cost=st.sampled_from(COSTS))
@example(seed=82, cost="makespan").via("a third action makes one delete what another adds")
@example(seed=331, cost="makespan+actions").via("the same, and no plan was left")
def test_every_plan_once_where_a_third_robot_decides(seed: int, cost: Cost) -> None:
    text = random_threes(seed)
    loaded = read(text.domain, text.problem, cost)
    every_plan_once(loaded.model, loaded.tasks[0])


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


def test_few_joint_actions_are_written_explicitly_and_many_are_not() -> None:
    loaded = read(*MODELS["tool"])
    plain = compile_classical(loaded.model, loaded.tasks[0], 5)
    assert sorted(action.name for action in plain.actions) == [
        "(release r1) idle",
        "(work r1) idle",
        "idle (release r2)",
        "idle (work r2)",
        "idle idle",
    ]
    assert compile_classical(loaded.model, loaded.tasks[0], 4).form == "select-then-apply"


def test_a_second_cost_that_outgrows_the_step_cost_is_noticed() -> None:
    loaded = read(CORRIDOR, CORRIDOR_TASK, "makespan+actions")
    plain = compile_classical(loaded.model, loaded.tasks[0], 0, longest=2)
    total = optimal_plans(plain).cost
    assert total is not None
    assert plain.cost(total) is None
    enough = compile_classical(loaded.model, loaded.tasks[0], 0, longest=total // plain.step_cost)
    assert enough.cost(optimal_plans(enough).cost or 0) == (6, 6)


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("name", MODELS)
def test_the_pddl_says_the_same(name: str, form: str) -> None:
    loaded = read(*MODELS[name])
    plain = compile_classical(loaded.model, loaded.tasks[0], FORMS[form])
    domain_text, problem_text = to_pddl(plain)
    domain, problem = parsed(domain_text, problem_text)
    assert len(domain.predicates) == len(plain.facts)
    assert len(problem.init) == len(plain.init)
    changed = [(len(a.adds) + len(a.deletes), a.cost) for a in plain.actions]
    assert [(len(schema.effects), schema.cost) for schema in domain.schemas] == changed
    for user_name in (*plain.facts, *(action.name for action in plain.actions)):
        assert f"; {user_name}\n" in domain_text
