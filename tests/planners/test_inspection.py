# SPDX-License-Identifier: GPL-3.0-or-later
"""`coordlang inspect`: whatever was misread has to show there."""

from __future__ import annotations

import re

from planners.inspection import inspect
from planners.joint.composition import ComposingStepper
from planners.loading import PlanningInstance
from planners.pddl.model_options import ModelOptions
from planners.search.reachable import explore
from tests.support.random_pddl import random_model
from tests.support.texts import model_of

PUSHING = """(define (domain pushing) (:types robot place heavy light)
  (:predicates (at ?r - robot ?p - place) (in ?x - (either heavy light) ?p - place) (glows ?p - place) (seen ?p - place))
  (:action push :agent ?r - robot :parameters (?x - heavy ?from ?to - place)
    :precondition (and (at ?r ?from) (in ?x ?from) (not (= ?from ?to))
                       (exists (?o - robot) (and (not (= ?o ?r)) (push ?o ?x ?from ?to))))
    :effect (and (not (at ?r ?from)) (at ?r ?to) (not (in ?x ?from)) (in ?x ?to)))
  (:action carry :agent ?r - robot :parameters (?x - light ?from ?to - place)
    :precondition (and (at ?r ?from) (in ?x ?from) (not (= ?from ?to)))
    :effect (and (not (at ?r ?from)) (at ?r ?to) (not (in ?x ?from)) (in ?x ?to)))
  (:action look :agent ?r - robot :parameters (?p - place)
    :precondition (and (at ?r ?p) (forall (?o - robot) (not (look ?o ?p)))) :effect (seen ?p))
  (:action melt :agent ?r - robot :parameters (?x - heavy ?p - place)
    :precondition (and (at ?r ?p) (glows ?p)) :effect (not (in ?x ?p))))"""
TASK = """(define (problem p) (:domain pushing) (:objects r1 r2 - robot a b - place anvil - heavy)
  ; (:goal (in anvil a)) is what it is not
  (:init (at r1 a) (at r2 a) (in anvil a))
  ( :goal (forall (?x - heavy) (or (in ?x b) (not (seen a))))))"""


def test_what_can_never_be_is_shown() -> None:
    found = inspect(model_of(PUSHING, TASK))
    assert found.impossible == ("carry", "melt")
    assert found.never == ("glows",)
    assert found.objects == {"heavy": 1, "place": 2, "robot": 2}
    assert found.start == {"at": 2, "in": 1}


def test_formulas_are_shown_with_what_is_there() -> None:
    assert inspect(model_of(PUSHING, TASK)).formulas == (
        "(push r1 anvil a b) speaks of (push r2 anvil a b) in the same step",
        "(look r1 a) forbids (look r2 a) in the same step",
    )
    # The partner's places in the wrong order: it would have to push the other way from where the
    # anvil is not.
    misread = PUSHING.replace("(push ?o ?x ?from ?to)", "(push ?o ?x ?from ?from)")
    shown = inspect(model_of(misread, TASK)).formulas
    assert (
        "(push r1 anvil a b) speaks of (push r2 anvil a a), which no robot can ever do, in the same step"
        in shown
    )


def test_the_goal_is_the_one_that_was_understood() -> None:
    assert (
        inspect(model_of(PUSHING, TASK)).goal
        == "(forall (?x - heavy) (or (in ?x b) (not (seen a))))"
    )


def both_possible(loaded: PlanningInstance, first: str, second: str) -> bool:
    """Whether different robots can choose these subactions in one reachable state, each for itself."""
    model = loaded.model
    assert isinstance(model.stepper, ComposingStepper)
    space = explore(model, loaded.tasks[0].init[None, :])
    choices = model.stepper.choices(space.rows)
    for state in range(len(space)):
        texts = [
            {own[label] for label in labels[begin[state] : begin[state + 1]]}
            for own, (begin, labels) in zip(model.labels, choices, strict=True)
        ]
        if any(
            first in a and second in b
            for i, a in enumerate(texts)
            for j, b in enumerate(texts)
            if i != j
        ):
            return True
    return False


def named(loaded: PlanningInstance, example: str) -> tuple[str, str]:
    labels = {text for own in loaded.model.labels for text in own}
    first, second = [text for text in re.findall(r"\([^()]*\)", example) if text in labels]
    return first, second


def test_the_example_can_happen_in_random_models() -> None:
    shown = hidden = 0
    for seed in range(60):
        text = random_model(seed, ("agent", "plain")[seed % 2])
        loaded = model_of(text.domain, text.problem, ModelOptions(unowned=text.unowned))
        found = inspect(loaded)
        if found.example is None:
            hidden += found.interfering > 0
            continue
        shown += 1
        assert both_possible(loaded, *named(loaded, found.example)), (seed, found.example)
    assert shown >= 15
    assert hidden >= 2, "some clash only between what is never possible together"
