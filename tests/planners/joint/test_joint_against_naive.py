# SPDX-License-Identifier: GPL-3.0-or-later
"""The fast joint model and plan search against brute force, on small random models of every kind."""

from __future__ import annotations

import pytest
from hypothesis import Phase, event, given, settings
from hypothesis import strategies as st

from planners.grounding.actions import idling_schemas
from tests.support import slow, thorough
from tests.support.joint_twin import built, check_model, twin_of
from tests.support.random_models import random_threes
from tests.support.random_pddl import KINDS, Kind, RandomModel, random_model


@pytest.mark.parametrize("number", [10, *thorough(40), *slow(600)])
@pytest.mark.parametrize("kind", KINDS)
def test_same_joint_steps_and_optimal_plans(kind: Kind, number: int) -> None:
    """Exactly the same joint steps in every reachable state, and exactly the same optimal plans."""

    @settings(max_examples=number, deadline=None, derandomize=True, phases=[Phase.generate])
    @given(seed=st.integers(0, 2**40))
    def compare(seed: int) -> None:
        check_model(random_model(seed, kind), event)

    compare()


@pytest.mark.parametrize("number", [6, *thorough(40), *slow(600)])
def test_same_joint_steps_where_a_third_robot_decides(number: int) -> None:
    for seed in range(number):
        check_model(random_threes(seed), lambda _: None)


# -- by hand: rules that random models meet rarely


@pytest.mark.parametrize(
    "effect",
    [
        # A negative formula does not link, wherever it stands: one deletes what two requires.
        ":precondition (and (p) (or (q) (not (one r1)) (not (one r2)))) :effect (n)",
        ":precondition (p) :effect (when (not (one r1)) (n))",
        ":precondition (p) :effect (when (not (not (one r1))) (n))",
        # In the condition of an effect it may speak of the acting robot, in a precondition not.
        ":precondition () :effect (and (q) (when (forall (?o - robot) (not (two ?o))) (n)))",
        ":precondition (forall (?o - robot) (or (not (two ?o)) (q))) :effect (n)",
        ":precondition () :effect (when (or (not (two ?r)) (p)) (n))",
        # Links by a positive formula lift all but delete against add.
        ":precondition (and (p) (exists (?o - robot) (one ?o))) :effect (n)",
        ":precondition (exists (?o - robot) (one ?o)) :effect (p)",
        ":precondition (one ?r) :effect (n)",
    ],
)
def test_formulas_about_the_joint_step(effect: str) -> None:
    domain = f"""(define (domain d) (:types robot) (:constants r1 r2 - robot) (:predicates (p) (q) (n))
      (:action one :agent ?r - robot :parameters () :effect (not (p)))
      (:action two :agent ?r - robot :parameters () {effect})
      (:action back :agent ?r - robot :parameters () :precondition (q) :effect (and (p) (not (q)) (not (n)))))"""
    problem = "(define (problem p) (:domain d) (:init (p) (q)) (:goal (and (n) (not (p)))))"
    check_model(RandomModel(domain, problem), note=lambda _: None)


# -- by hand: which actions are idling

_ROOMS = """(define (domain rooms) (:types robot place) (:predicates (at ?r - robot ?p - place) (ok ?r - robot))
  (:action move :agent ?r - robot :parameters (?from ?to - place) :precondition (at ?r ?from)
    :effect (and (not (at ?r ?from)) (at ?r ?to)))
  {more})"""
_TASK = """(define (problem p) (:domain rooms) (:objects r1 r2 - robot a b - place)
  (:init (at r1 a) (at r2 b) (ok r1)) (:goal (and (at r1 b) (at r2 b))))"""


#: An action that does nothing, where its precondition holds; actions that name it.
_WAIT = "(:action wait :agent ?r - robot :parameters ()"
_WATCH = "(:action watch :agent ?r - robot :parameters (?o - robot)"


@pytest.mark.parametrize(
    ("more", "is_left_out"),
    [
        (f"{_WAIT} :effect ())", True),
        (
            "(:action wait :agent ?r - robot :parameters (?p - place) :precondition (at ?r ?p))",
            True,
        ),
        # Whether its precondition ever holds does not count: idling is always possible.
        (f"{_WAIT} :precondition (ok ?r))", True),
        (f"{_WAIT} :precondition (not (ok ?r)))", True),
        # Nor does who owns it.
        ("(:action wait :parameters (?r ?q - robot))", True),
        # What it asks of others makes it no other action; what others ask of it does.
        (f"{_WAIT} :precondition (forall (?o - robot) (not (move ?o nowhere nowhere))))", True),
        (f"{_WAIT}) {_WATCH} :precondition (wait ?o) :effect (ok ?r))", False),
        (f"{_WAIT}) {_WATCH} :effect (when (not (wait ?o)) (ok ?r)))", False),
        (
            "(:action wait :agent ?r - robot :parameters (?p - place)) "
            "(:concurrency-constraint v :parameters (?p - place) :bounds (1 2) :actions ((wait 1)))",
            False,
        ),
        # Effects as written count, those that never come about among them.
        (f"{_WAIT} :effect (ok ?r))", False),
        (f"{_WAIT} :effect (when (at ?r nowhere) (ok ?r)))", False),
    ],
)
def test_an_action_that_is_idling_is_left_out(more: str, is_left_out: bool) -> None:
    domain = _ROOMS.format(more=more).replace("(:pred", "(:constants nowhere - place) (:pred")
    text = RandomModel(domain, _TASK)
    loaded = built(text)
    expected = {"wait"} if is_left_out else set()
    assert any("wait" in label for own in loaded.model.labels for label in own) != is_left_out
    assert idling_schemas(loaded.domain) == expected
    rules = twin_of(loaded).rules
    assert {s.name for s in loaded.domain.schemas if rules.is_idling(s)} == expected
    check_model(text, note=lambda _: None)


def test_an_effect_on_every_object() -> None:
    """A universal effect whose variable has no type but ``object``."""
    check_model(
        RandomModel(
            """(define (domain d) (:types robot) (:predicates (p ?x) (q ?x))
            (:action all :agent ?r - robot :parameters () :effect (forall (?x) (p ?x)))
            (:action none :agent ?r - robot :parameters () :precondition (p ?r)
              :effect (forall (?x - object) (when (not (q ?x)) (and (q ?x) (not (p ?x)))))))""",
            "(define (problem p) (:domain d) (:objects r1 r2 - robot o) (:init) (:goal (and (q o) (not (p r1)))))",
        ),
        note=lambda _: None,
    )
