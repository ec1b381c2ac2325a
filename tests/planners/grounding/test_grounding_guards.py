# SPDX-License-Identifier: GPL-3.0-or-later
"""Quantifiers that look up static facts give the formulas that trying every object gives, in the
same order.
"""

from __future__ import annotations

import pytest

from planners.grounding import ground_actions
from planners.grounding.actions import GroundAction
from planners.grounding.bindings import Bindings
from planners.grounding.instantiate import _Grounder
from planners.loading import build
from planners.pddl import parse_domain, parse_problem
from planners.pddl.robots import RobotSelection, Unowned, find_team
from planners.pddl.sexpr import Source
from tests.support.random_pddl import random_model

DOMAIN = """(define (domain halls) (:types robot place - thing hall - place)
  (:constants home - hall)
  (:predicates (at ?r - robot ?p - place) (way ?a ?b) (way ?a) (lit ?p - place) (loop ?a ?b ?c))
  (:action act :agent ?r - robot :parameters (?p - place)
    :precondition (and (at ?r ?p) {condition})
    :effect (and (lit ?p) (forall (?x - place) (when (and (way ?p ?x) (not (lit ?x))) (lit ?x))))))"""
PROBLEM = """(define (problem p) (:domain halls) (:objects r1 r2 - robot p10 p2 p1 - place h - hall)
  (:init (at r1 p1) (at r2 home) (way p1 p2) (way p2 p1) (way p2 p10) (way p1 home) (way home h) (way p1 r2) (way p2 p2)
         (way r1 p1) (way p10) (way home) (loop p1 p1 p2) (loop p1 p1 p1) (loop h home h))
  (:goal (lit home)))"""

CONDITIONS = [
    "(exists (?x - place) (and (way ?p ?x) (lit ?x)))",
    "(exists (?x) (and (lit ?x) (way ?x ?p)))",
    "(exists (?x - hall) (and (way ?p ?x) (not (lit ?x))))",
    "(forall (?x - place) (or (not (way ?p ?x)) (lit ?x)))",
    "(forall (?x - place) (imply (and (way ?p ?x) (way ?x ?p)) (lit ?x)))",
    "(forall (?x ?y - place) (or (not (way ?p ?x)) (not (way ?x ?y)) (lit ?y)))",
    "(exists (?x ?y - place) (and (way ?x ?y) (way ?y ?p) (lit ?x)))",
    "(not (exists (?x - place) (and (way ?p ?x) (lit ?x))))",
    "(not (forall (?x - place) (or (not (way ?p ?x)) (lit ?x))))",
    "(exists (?x - place) (and (way ?x ?x) (lit ?x)))",
    "(exists (?x - place) (and (loop ?x ?x ?p) (lit ?x)))",
    "(exists (?x - place ?y - hall) (and (loop ?y home ?y) (lit ?x)))",
    "(exists (?x - place) (and (way home ?x) (lit ?x)))",
    "(exists (?x - place) (and (way ?x) (lit ?x)))",
    # The inner ?p is another one.
    "(exists (?p - place) (and (way ?p home) (lit ?p)))",
    "(forall (?x - place) (exists (?p - place) (and (way ?x ?p) (not (way ?p ?x)) (lit ?p))))",
    # A guard that is one part of a disjunction is none.
    "(exists (?x - place) (or (way ?p ?x) (lit ?x)))",
    "(forall (?x - place) (and (not (way ?p ?x)) (lit ?x)))",
    "(or (lit home) (forall (?x - place) (and (way ?p ?x) (lit ?x))))",
    # Guards that speak of a step.
    "(forall (?o - robot ?x - place) (or (= ?o ?r) (not (way ?x ?p)) (not (act ?o ?x))))",
    "(exists (?o - robot ?x - place) (and (not (= ?o ?r)) (way ?p ?x) (act ?o ?x)))",
    "(exists (?x) (and (at ?r ?p) (way home ?x) (not (= ?x home))))",
]


def grounded(domain: str, problem: str, unowned: Unowned = "error") -> tuple[GroundAction, ...]:
    lifted = parse_domain(Source("d", domain))
    read = parse_problem(Source("p", problem), lifted)
    return ground_actions(lifted, read, find_team(lifted, read, RobotSelection(unowned=unowned)))


def both(
    domain: str, problem: str, unowned: Unowned = "error"
) -> tuple[tuple[GroundAction, ...], ...]:
    fast = grounded(domain, problem, unowned)
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(Bindings, "_facts_of", lambda *_: None)
        return fast, grounded(domain, problem, unowned)


@pytest.mark.parametrize("condition", CONDITIONS)
def test_the_same_formulas_by_hand(condition: str) -> None:
    fast, slow = both(DOMAIN.format(condition=condition), PROBLEM)
    assert fast == slow


def test_random_models() -> None:
    for seed in range(25):
        text = random_model(seed, ("agent", "plain")[seed % 2])
        fast, slow = both(text.domain, text.problem, text.unowned)
        assert fast == slow


def test_the_facts_are_looked_up(monkeypatch: pytest.MonkeyPatch) -> None:
    """Few instances are tried: one for each way, not one for each object."""
    tried = 0
    original = _Grounder._atom

    def counting(self: _Grounder, *arguments: object) -> object:
        nonlocal tried
        tried += 1
        return original(self, *arguments)  # type: ignore[arg-type]

    monkeypatch.setattr(_Grounder, "_atom", counting)
    places = " ".join(f"q{n}" for n in range(200))
    problem = PROBLEM.replace("p1 - place", f"p1 {places} - place")
    grounded(DOMAIN.format(condition=CONDITIONS[0]), problem)
    few, tried = tried, 0
    monkeypatch.setattr(Bindings, "_facts_of", lambda *_: None)
    grounded(DOMAIN.format(condition=CONDITIONS[0]), problem)
    assert 20 * few < tried


def test_it_is_used_by_the_model() -> None:
    lifted = parse_domain(Source("d", DOMAIN.format(condition=CONDITIONS[0])))
    loaded = build(lifted, [parse_problem(Source("p", PROBLEM), lifted)])
    assert {a.label for a in loaded.model.actions} >= {"(act r1 p1)"}
