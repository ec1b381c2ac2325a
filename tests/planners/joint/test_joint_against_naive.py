# SPDX-License-Identifier: GPL-3.0-or-later
"""The fast joint model and plan search against brute force, on small random models of every kind."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any
from unittest.mock import patch

import pytest
from hypothesis import Phase, event, given, settings
from hypothesis import strategies as st

from planners.grounding import instantiate
from planners.grounding.reachability import reachable_arguments
from planners.joint.model import own_text
from planners.loading import PlanningInstance
from planners.pddl.lifted import Atom, Domain
from planners.search.optimal_plans import search
from planners.search.plans import Plans
from tests.support.joint_twin import built, check_idling_adds_nothing, check_model, twin_of
from tests.support.random_pddl import KINDS, Kind, RandomModel, random_model
from tests.support.random_threes import random_threes


@pytest.fixture(autouse=True, scope="module")
def one_reachability_per_model() -> Iterator[None]:
    """Every model is built for two costs: compile and run Tarski's program once."""
    asked: dict[str, dict[str, list[tuple[str, ...]]]] = {}

    def remembered(
        domain: Domain, objects: dict[str, tuple[str, ...]], init: Iterable[Atom]
    ) -> Any:
        init = list(init)
        key = domain.source.text + str((objects, init))
        if key not in asked:
            asked.clear()
            asked[key] = reachable_arguments(domain, objects, init)
        return asked[key]

    with patch.object(instantiate, "reachable_arguments", remembered):
        yield


@pytest.mark.parametrize("number", [60, pytest.param(600, marks=pytest.mark.slow)])
@pytest.mark.parametrize("kind", KINDS)
def test_same_joint_steps_and_optimal_plans(kind: Kind, number: int) -> None:
    """Exactly the same joint steps in every reachable state, and exactly the same optimal plans."""

    @settings(max_examples=number, deadline=None, derandomize=True, phases=[Phase.generate])
    @given(seed=st.integers(0, 2**40))
    def compare(seed: int) -> None:
        check_model(random_model(seed, kind), event)

    compare()


@pytest.mark.parametrize("number", [40, pytest.param(600, marks=pytest.mark.slow)])
def test_same_joint_steps_where_a_third_robot_decides(number: int) -> None:
    for seed in range(number):
        check_model(random_threes(seed), lambda _: None)


# -- by hand: rules that random models meet rarely
# ---------------------------------------------------------------


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


# -- by hand: when a robot may not idle
# ---------------------------------------------------------------------------

_ROOMS = """(define (domain rooms) (:types robot place) (:predicates (at ?r - robot ?p - place) (ok ?r - robot))
  (:action move :agent ?r - robot :parameters (?from ?to - place) :precondition (at ?r ?from)
    :effect (and (not (at ?r ?from)) (at ?r ?to)))
  {more})"""
_TASK = """(define (problem p) (:domain rooms) (:objects r1 r2 - robot a b - place)
  (:init (at r1 a) (at r2 b) (ok r1)) (:goal (and (at r1 b) (at r2 b))))"""


def _rooms(*more: str) -> PlanningInstance:
    return built(RandomModel(_ROOMS.format(more=" ".join(more)), _TASK))


_WAIT = "(:action wait :agent ?r - robot :parameters () {precondition} :effect ())"


@pytest.mark.parametrize(
    ("more", "keeps_idle"),
    [
        ("", (True, True)),
        (_WAIT.format(precondition=""), (False, False)),
        # One of a group of facts always holds: every action that ends one makes another one true.
        (
            "(:action stay :agent ?r - robot :parameters (?p - place) :precondition (at ?r ?p))",
            (False, False),
        ),
        # Only r1 is ok at the start, and nobody ever stops being ok.
        (
            _WAIT.format(precondition=":precondition (ok ?r)")
            + "(:action heal :agent ?r - robot :parameters () :effect (ok ?r))",
            (False, True),
        ),
        (
            _WAIT.format(precondition=":precondition (ok ?r)")
            + "(:action fall :agent ?r - robot :parameters () :effect (not (ok ?r)))",
            (True, True),
        ),
        (
            _WAIT.format(precondition=":precondition (not (ok ?r))")
            + "(:action heal :agent ?r - robot :parameters () :effect (ok ?r))",
            (True, True),
        ),
        # A formula needs it.
        (
            _WAIT.format(precondition="")
            + "(:action watch :agent ?r - robot :parameters (?o - robot) :precondition (wait ?o) :effect (ok ?r))",
            (True, True),
        ),
        # It does something.
        (_WAIT.format(precondition="").replace(":effect ()", ":effect (ok ?r)"), (True, True)),
    ],
)
def test_when_idling_is_dropped(more: str, keeps_idle: tuple[bool, bool]) -> None:
    loaded = _rooms(more)
    assert loaded.model.keeps_idle == keeps_idle
    # r1 walks over, r2 stays where it is: one plan, and not one more for every way to do nothing.
    if not any(keeps_idle):
        plans = [
            [loaded.model.texts(step) for step in plan]
            for plan in Plans.of(search(loaded.model, loaded.tasks[0]))
        ]
        assert all(label is not None for plan in plans for step in plan for label in step)


def test_a_shared_do_nothing_action_is_nobodys_own() -> None:
    text = RandomModel(
        """(define (domain d) (:types robot) (:predicates (p ?r - robot))
        (:action meet :parameters (?r ?q - robot))
        (:action go :parameters (?r - robot) :effect (p ?r)))""",
        "(define (problem p) (:domain d) (:objects r1 r2 - robot) (:init) (:goal (p r1)))",
    )
    # (meet r1 r1) belongs to r1 alone; without it there is only meeting the other one.
    assert built(text).model.keeps_idle == (False, False)
    apart = text.domain.replace(
        "(?r ?q - robot))", "(?r ?q - robot) :precondition (not (= ?r ?q)))"
    )
    assert built(RandomModel(apart, text.problem)).model.keeps_idle == (True, True)


def test_a_wait_that_others_disturb_does_not_replace_idling() -> None:
    """r1 pushes r2 away, which deletes what r2's ``stay`` requires: r2 must be able to idle."""
    text = RandomModel(
        """(define (domain push) (:types robot place) (:predicates (at ?r - robot ?p - place) (next ?p ?q - place))
        (:action stay :agent ?r - robot :parameters (?p - place) :precondition (at ?r ?p))
        (:action push :agent ?r - robot :parameters (?o - robot ?from ?to - place)
          :precondition (and (at ?o ?from) (next ?from ?to) (not (= ?r ?o)))
          :effect (and (not (at ?o ?from)) (at ?o ?to))))""",
        """(define (problem p) (:domain push) (:objects r1 r2 - robot a b - place)
        (:init (at r1 a) (at r2 a) (next a b)) (:goal (and (at r1 a) (at r2 b))))""",
    )
    loaded = built(text)
    twin = twin_of(loaded, text)
    check_idling_adds_nothing(twin)
    plans = Plans.of(search(loaded.model, loaded.tasks[0]))
    assert [[loaded.model.texts(step) for step in plan] for plan in plans] == [
        [("(push r1 r2 a b)", None)]
    ]


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


@pytest.mark.parametrize(
    ("text", "robot", "own"),
    [
        ("(move r1 a b)", "r1", "move a b"),
        ("(pass r1 r2 ball)", "r1", "pass r2 ball"),
        ("(pass r1 r2 ball)", "r2", "pass r1 ball"),
        ("(move a b)", "r1", "move a b"),
        ("(point r1 r1)", "r1", "point r1"),
        ("(r1 r1 a)", "r1", "r1 a"),
        ("(wait)", "r1", "wait"),
        ("none", "r1", "none"),
    ],
)
def test_a_label_without_the_robots_name(text: str, robot: str, own: str) -> None:
    assert own_text(text, robot) == own
