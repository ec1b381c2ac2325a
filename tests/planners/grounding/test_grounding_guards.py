# SPDX-License-Identifier: GPL-3.0-or-later
"""Quantifiers that look up static facts give the formulas that trying every object gives, in the
same order.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import pytest

import planners.grounding.bindings
from planners.grounding import ground_actions
from planners.grounding.actions import GroundAction
from planners.grounding.bindings import Bindings
from planners.grounding.instantiate import _Grounder
from planners.pddl.formula_tree import literals
from planners.pddl.lifted import FALSE, Formula, StepAtom
from planners.pddl.model_options import ModelOptions, Unowned
from planners.pddl.robots import find_team
from tests.support.naive_grounding import NaiveGrounding, without_impossible
from tests.support.random_pddl import random_model
from tests.support.texts import model_of, parsed

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
    lifted, read = parsed(domain, problem)
    return ground_actions(lifted, read, find_team(lifted, read, ModelOptions(unowned=unowned)))


def both(
    domain: str, problem: str, unowned: Unowned = "error"
) -> tuple[tuple[GroundAction, ...], tuple[GroundAction, ...]]:
    """The ground actions, and the same ones with preconditions and effects by definition."""
    lifted, read = parsed(domain, problem)
    team = find_team(lifted, read, ModelOptions(unowned=unowned))
    twin = NaiveGrounding(lifted, read, team)
    schemas = {schema.name: schema for schema in lifted.schemas}
    fast = ground_actions(lifted, read, team)
    return fast, tuple(
        replace(
            action,
            precondition=twin.precondition(schemas[action.schema], action.args),
            effects=twin.effects(schemas[action.schema], action.args),
        )
        for action in fast
    )


@pytest.mark.parametrize("condition", CONDITIONS)
def test_the_same_formulas_by_hand(condition: str) -> None:
    fast, slow = both(DOMAIN.format(condition=condition), PROBLEM)
    assert fast == slow


def test_random_models() -> None:
    for seed in range(25):
        text = random_model(seed, ("agent", "plain")[seed % 2])
        fast, slow = both(text.domain, text.problem, text.unowned)
        assert fast == slow


def test_actions_share_their_atoms() -> None:
    text = DOMAIN.format(condition="(not (lit ?p)) (or (lit home) (exists (?x) (lit ?x)))")
    leaves = [leaf for a in grounded(text, PROBLEM) for leaf, _ in literals(a.precondition)]
    assert len({*map(id, leaves)}) == len({*leaves}) < len(leaves)


STEP_CONDITIONS = [
    "(forall (?o - robot ?x - place) (not (act ?o ?x)))",
    "(forall (?x - place) (not (act ?r ?x)))",
    "(forall (?o - robot ?x) (or (= ?o ?r) (not (way ?p ?x)) (not (act ?o ?x))))",
    "(forall (?o - robot ?x - place) (imply (act ?o ?x) (lit ?x)))",
    "(forall (?o - robot ?x - place) (and (lit ?x) (not (act ?o ?x))))",
    "(not (exists (?o - robot) (and (act ?o ?p) (not (lit ?p)))))",
    "(exists (?o - robot ?x - place) (and (not (= ?o ?r)) (act ?o ?x)))",
    "(not (forall (?x - place) (not (act ?r ?x))))",
    "(or (lit home) (not (exists (?o - robot ?x - place) (and (not (= ?o ?r)) (act ?o ?x)))))",
]


@pytest.mark.parametrize("condition", STEP_CONDITIONS)
def test_only_possible_subactions_are_tried_where_there_are_many(
    condition: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    # Not every subaction is possible: from some places there is no way.
    domain = DOMAIN.format(condition=f"(way ?p home) {condition}").replace("(at ?r ?p)", "")
    _, slow = both(domain, PROBLEM)
    monkeypatch.setattr(planners.grounding.bindings, "_MANY", 0)
    fast, _ = both(domain, PROBLEM)
    possible = frozenset(StepAtom(action.schema, action.args) for action in slow)

    def simplified(actions: Sequence[GroundAction]) -> dict[str, Formula]:
        found = {a.label: without_impossible(a.precondition, possible) for a in actions}
        return {label: formula for label, formula in found.items() if formula != FALSE}

    assert simplified(fast) == simplified(slow)
    assert [a.label for a in fast] == [a.label for a in slow if a.label in simplified(fast)]
    assert [a.effects for a in fast] == [a.effects for a in slow if a.label in simplified(fast)]


def test_what_is_possible_is_looked_up(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of 9,000 subactions that a precondition forbids, the few that can be done are looked at."""
    asked: list[str] = []
    original = _Grounder._step_atom

    def counting(self: _Grounder, name: str, *rest: object) -> object:
        asked.append(name)
        return original(self, name, *rest)  # type: ignore[arg-type]

    monkeypatch.setattr(_Grounder, "_step_atom", counting)
    places = " ".join(f"q{n}" for n in range(3000))
    problem = PROBLEM.replace("p1 - place", f"p1 {places} - place")
    domain = DOMAIN.format(
        condition="(way ?p home) (forall (?o - robot ?x - place) (not (act ?o ?x)))"
    ).replace("(at ?r ?p)", "")
    actions = grounded(domain, problem)
    assert actions
    assert 0 < asked.count("act") < 100


def test_the_facts_are_looked_up(monkeypatch: pytest.MonkeyPatch) -> None:
    """Few instances are tried: one for each way, not one for each object."""
    tried = 0
    original = _Grounder._state_literal

    def counting(self: _Grounder, *arguments: object) -> object:
        nonlocal tried
        tried += 1
        return original(self, *arguments)  # type: ignore[arg-type]

    monkeypatch.setattr(_Grounder, "_state_literal", counting)
    places = " ".join(f"q{n}" for n in range(200))
    problem = PROBLEM.replace("p1 - place", f"p1 {places} - place")
    grounded(DOMAIN.format(condition=CONDITIONS[0]), problem)
    few, tried = tried, 0
    monkeypatch.setattr(Bindings, "_known", lambda *_: ())
    grounded(DOMAIN.format(condition=CONDITIONS[0]), problem)
    assert 20 * few < tried


def test_it_is_used_by_the_model() -> None:
    loaded = model_of(DOMAIN.format(condition=CONDITIONS[0]), PROBLEM)
    assert {a.label for a in loaded.model.actions} >= {"(act r1 p1)"}
