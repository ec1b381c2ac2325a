# SPDX-License-Identifier: GPL-3.0-or-later
"""Pairs of facts that are said never to be true together never are, and are those of the twin."""

from __future__ import annotations

from collections import Counter
from itertools import combinations, product
from math import prod

import pytest

from planners.joint.composition import ComposingStepper
from planners.joint.conditions import split_condition
from planners.joint.model import JointModel
from planners.joint.tables import Rows
from planners.loading import PlanningInstance, build
from planners.pddl import parse_domain, parse_problem
from planners.pddl.lifted import TRUE, Formula
from planners.pddl.sexpr import Source
from planners.search.mutexes import mutexes
from planners.search.state_variables import state_variables
from tests.support.random_instances import explored, random_instance

#: Joint labels beyond which a model that remembers them has too many states to explore.
_MOST_STEPS = 5_000

Way = tuple[tuple[int, int] | None, frozenset[int], frozenset[int], frozenset[int]]


def ways(model: JointModel) -> list[Way]:
    """(robot and label, needs, adds, deletes); facts that stay true are chosen by nobody."""
    assert isinstance(model.stepper, ComposingStepper)
    index = model.codec.facts.index

    def positive(*formulas: Formula) -> frozenset[int]:
        found = [split_condition(formula, model.evaluator)[0] for formula in formulas]
        return frozenset(fact for own in found for fact, value in own if value)

    found: list[Way] = [
        (None, frozenset({fact}), frozenset({fact}), frozenset()) for fact in index.values()
    ]
    for robot, own in enumerate(model.stepper.labelled):
        for label, action in enumerate(own):
            if action is None:
                continue
            effects = [e for e in action.effects if e.atom in index]
            adds = {index[e.atom] for e in effects if e.adds and e.condition == TRUE}
            lost = {index[e.atom] for e in effects if not e.adds and e.condition == TRUE} - adds
            conditions: list[tuple[Formula, frozenset[int]]] = [(TRUE, frozenset(adds))]
            conditions += [(e.condition, frozenset({index[e.atom]})) for e in effects if e.adds]
            for condition, added in conditions:
                needs = positive(action.precondition, condition)
                found.append(((robot, label), needs, added, frozenset(lost)))
    return found


def together(model: JointModel, one: Way, other: Way) -> bool:
    """Whether two ways may share a step."""
    assert isinstance(model.stepper, ComposingStepper)
    if one[0] is None or other[0] is None:
        return not (one[1] & other[3] if one[0] is None else other[1] & one[3])
    if one[0][0] == other[0][0]:
        return one[0] == other[0]
    (i, a), (j, b) = sorted((one[0], other[0]))
    return bool(model.stepper.tables[i, j][a, b])


def naive(model: JointModel, init: Rows) -> list[tuple[int, int]]:
    """The definition, with sets of pairs."""
    true = model.codec.true_facts(model.codec.facts_part(init))
    may = set(product(true, true))
    every = ways(model)
    fitting = [
        (one[1] | other[1], set(product(one[2], other[2])))
        for one, other in product(every, every)
        if together(model, one, other)
    ]
    grown = True
    while grown:
        before = len(may)
        for needs, made in fitting:
            if set(product(needs, needs)) <= may:
                may |= made
        grown = len(may) > before
    facts = range(len(model.codec.facts))
    never = {fact for fact in facts if (fact, fact) not in may}
    apart = {(p, q) for p, q in combinations(facts, 2) if (p, q) not in may and not {p, q} & never}
    return sorted(apart | {(fact, fact) for fact in never})


def compared(seeds: range) -> Counter[str]:
    met: Counter[str] = Counter()
    for seed in seeds:
        loaded = random_instance(seed)
        if loaded is None or loaded.model.is_joint_action:
            continue
        steps = prod(map(len, loaded.model.labels))
        if loaded.model.remembers and steps > _MOST_STEPS:
            continue  # each step leads to a state of its own
        space = explored(loaded)
        if space is None:
            continue
        init = loaded.tasks[0].init
        found = mutexes(loaded.model, init)
        assert found == naive(loaded.model, init)
        truth = loaded.model.codec.truth(space.rows)
        for one, other in found:
            assert not (truth[:, one] & truth[:, other]).any()
        variable = {
            fact: number
            for number, own in enumerate(state_variables(loaded.model, init))
            for fact in own.facts
        }
        met["models"] += 1
        met["pairs"] += len(found)
        met["pairs of different variables"] += sum(
            p != q and variable.get(p, -1) != variable.get(q, -2) for p, q in found
        )
        met["never true"] += sum(p == q for p, q in found)
    return met


def test_mutexes_hold_and_are_those_of_the_definition() -> None:
    met = compared(range(70, 160))
    assert met["models"] >= 30
    assert min(met["pairs of different variables"], met["never true"]) >= 2


@pytest.mark.slow
def test_mutexes_hold_in_many_models() -> None:
    met = compared(range(1_000, 3_000))
    print(dict(met))
    assert met["models"] >= 500


DOMAIN = """
(define (domain hands) (:requirements :typing :multi-agent)
  (:types hand thing)
  (:predicates (empty ?h - hand) (holds ?h - hand ?t - thing) (lies ?t - thing) (near ?t - thing))
  (:action take :agent ?h - hand :parameters (?t - thing)
    :precondition (and (empty ?h) (lies ?t))
    :effect (and (holds ?h ?t) (not (empty ?h)) (not (lies ?t)) (not (near ?t))))
  (:action put :agent ?h - hand :parameters (?t - thing) :precondition (holds ?h ?t)
    :effect (and (empty ?h) (lies ?t) (near ?t) (not (holds ?h ?t)))))
"""
PROBLEM = """
(define (problem two) (:domain hands) (:objects l r - hand a b - thing)
  (:init (empty l) (empty r) (lies a) (lies b) (near a)) (:goal (near b)))
"""


def hands() -> PlanningInstance:
    domain = parse_domain(Source("domain", DOMAIN))
    return build(domain, [parse_problem(Source("problem", PROBLEM), domain)])


def test_what_is_held_is_not_near() -> None:
    loaded = hands()
    atoms = [(atom.predicate, *atom.args) for atom in loaded.model.codec.facts.atoms]
    found = mutexes(loaded.model, loaded.tasks[0].init)
    named = {frozenset((atoms[p], atoms[q])) for p, q in found}
    for hand, thing in product("lr", "ab"):
        assert {("holds", hand, thing), ("near", thing)} in named
    assert not any(p == q for p, q in found)
    assert found == naive(loaded.model, loaded.tasks[0].init)


def test_too_many_ways_are_not_looked_at_and_blocks_change_nothing() -> None:
    loaded = hands()
    init = loaded.tasks[0].init
    found = mutexes(loaded.model, init)
    assert found
    assert mutexes(loaded.model, init, most=3) == []
    assert mutexes(loaded.model, init, block=1) == found
