# SPDX-License-Identifier: GPL-3.0-or-later
"""Pairs of labels that no cheapest plan has, against the joint steps of the model."""

from __future__ import annotations

from collections import Counter
from random import Random

import numpy as np
import pytest

from planners.joint.model import JointModel
from planners.joint.tables import Rows, unique_rows
from planners.loading import PlanningInstance, build
from planners.pddl import parse_domain, parse_problem
from planners.pddl.model_options import ModelOptions
from planners.pddl.sexpr import Source
from planners.search.cheapest import label_costs
from planners.search.dominated_labels import dominated_pairs
from planners.search.state_variables import state_variables
from planners.system.errors import BadInput
from tests.support.random_instances import random_instance

#: States of one model that are looked at.
_MANY = 8

ROBOTS = """(define (domain rooms) (:types robot place door)
  (:predicates (at ?r - robot ?p - place) (way ?r - robot ?p ?q - place) (open ?d - door)
    (behind ?p - place ?d - door) (lit ?p - place) (low ?r - robot) (full ?r - robot)
    (short ?p ?q - place))
  (:functions (total-cost) - number)
  (:action go :agent ?r - robot :parameters (?p ?q - place)
    :precondition (and (at ?r ?p) (way ?r ?p ?q))
    :effect (and (not (at ?r ?p)) (at ?r ?q) (increase (total-cost) 1)))
  (:action stumble :agent ?r - robot :parameters (?p ?q - place)
    :precondition (and (at ?r ?p) (way ?r ?p ?q))
    :effect (and (not (at ?r ?p)) (at ?r ?q) (low ?r)))
  (:action pass :agent ?r - robot :parameters (?p ?q - place ?d - door)
    :precondition (and (at ?r ?p) (short ?p ?q) (behind ?q ?d) (open ?d))
    :effect (and (not (at ?r ?p)) (at ?r ?q) (increase (total-cost) 2)))
  (:action run :agent ?r - robot :parameters (?p ?q - place)
    :precondition (and (at ?r ?p) (short ?p ?q) (not (low ?r)))
    :effect (and (not (at ?r ?p)) (at ?r ?q) (low ?r) (increase (total-cost) 1)))
  (:action light :agent ?r - robot :parameters (?p - place)
    :precondition (and (at ?r ?p) SIGN) :effect (and (lit ?p) (increase (total-cost) 1)))
  (:action dim :agent ?r - robot :parameters (?p - place)
    :precondition (and (at ?r ?p) (lit ?p)) :effect (not (lit ?p)))
  (:action push :agent ?r - robot :parameters (?p - place ?d - door)
    :precondition (and (at ?r ?p) (open ?d)) :effect DOOR)
  (:action pull :agent ?r - robot :parameters (?p - place ?d - door)
    :precondition (at ?r ?p) :effect (open ?d))
  (:action tire :agent ?r - robot :parameters (?p - place)
    :precondition (at ?r ?p) :effect (and (low ?r) (increase (total-cost) 1)))
  (:action rest :agent ?r - robot :parameters (?p - place)
    :precondition (and (at ?r ?p) SEEN)
    :effect (and (full ?r) (not (low ?r)) (increase (total-cost) 1)))
  (:action eat :agent ?r - robot :parameters (?p - place)
    :precondition (at ?r ?p) :effect (full ?r))
  (:action look :agent ?r - robot :parameters (?p - place)
    :precondition (at ?r ?p) :effect LOOKS))"""

#: What parts of the domain may be.
_PARTS = {
    "SIGN": ("(not (lit ?p))", "(lit ?p)", ""),
    "SEEN": (
        "(low ?r)",
        "(low ?r)",
        "(exists (?o - robot) (and (not (= ?o ?r)) (low ?o)))",
        "(not (exists (?o - robot ?q - place) (and (not (= ?o ?r)) (tire ?o ?q))))",
    ),
    "DOOR": ("(not (open ?d))", "(open ?d)"),
    "LOOKS": (
        "(when (lit ?p) (full ?r))",
        "(when (lit ?p) (full ?r))",
        "(forall (?o - robot) (when (low ?o) (lit ?p)))",
    ),
}


def rooms(seed: int) -> PlanningInstance:
    """Robots that go about by themselves, and switch lights and doors for all."""
    random = Random(seed)
    robots, places, doors = ["r1", "r2"], ["p1", "p2", "p3"], ["d1", "d2"]
    facts = [f"(at {robot} {random.choice(places)})" for robot in robots]
    pairs = [(p, q) for p in places for q in places]
    facts += [f"(way {r} {p} {q})" for r in robots for p, q in pairs if random.random() < 0.5]
    facts += [f"(short {p} {q})" for p, q in pairs if random.random() < 0.5]
    facts += [f"(behind {p} {random.choice(doors)})" for p in places]
    facts += [f"({kind} {r})" for r in robots for kind in ("low", "full") if random.random() < 0.4]
    facts += ["(lit p1)", "(open d1)", "(= (total-cost) 0)"]
    text = ROBOTS
    for part, choices in _PARTS.items():
        text = text.replace(part, random.choice(choices))
    domain = parse_domain(Source("domain", text))
    problem = (
        f"(define (problem p) (:domain rooms) (:objects {' '.join(robots)} - robot "
        f"{' '.join(places)} - place {' '.join(doors)} - door)"
        f" (:init {' '.join(facts)}) (:goal (and (at r1 p1) (lit p1))))"
    )
    options = ModelOptions(cost=random.choice(("makespan+actions", "makespan+cost")))
    return build(domain, [parse_problem(Source("problem", problem), domain)], options)


def some_states(model: JointModel, start: Rows) -> Rows:
    """The first reachable states."""
    seen = start[None, :]
    for _ in range(4):
        seen, _ = unique_rows(np.concatenate((seen, model.successors(seen).result)))
        if len(seen) > _MANY:
            break
    order = np.random.default_rng(0).permutation(len(seen))
    return seen[order[:_MANY]]


def wrong_pairs(loaded: PlanningInstance) -> tuple[list[str], Counter[str]]:
    """Wasteful pairs after which nothing cheaper would have led to the same state, by definition.

    Every two joint steps in a row that a robot has such a pair in are looked at.
    """
    model, task = loaded.model, loaded.tasks[0]
    pairs = dominated_pairs(model, state_variables(model, task.init))
    costs = label_costs(model)
    wrong: list[str] = []
    met = Counter({"pairs": sum(int(own.sum()) for own in pairs)})
    if not met["pairs"]:
        return wrong, met
    step: dict[tuple[bytes, tuple[int, ...]], bytes] = {}
    #: What is true in a state, whatever robots did before: some models remember that.
    facts: dict[bytes, bytes] = {}

    def out_of(states: Rows) -> Rows:
        found = model.successors(states)
        for source, labels, result in zip(
            found.source.tolist(), found.labels.tolist(), found.result, strict=True
        ):
            step[states[source].tobytes(), tuple(labels)] = result.tobytes()
            facts[result.tobytes()] = model.codec.facts_part(result[None, :]).tobytes()
        return unique_rows(found.result)[0]

    states = some_states(model, task.init)
    following = out_of(states)
    out_of(following)
    after: dict[bytes, list[tuple[tuple[int, ...], bytes]]] = {}
    for (state, labels), result in step.items():
        after.setdefault(state, []).append((labels, result))
    for start in sorted({row.tobytes() for row in states}):
        for one, between in after.get(start, ()):
            for two, end in after.get(between, ()):
                for robot, own in enumerate(pairs):
                    if not own[one[robot], two[robot]]:
                        continue
                    met["steps"] += 1
                    paid = costs[robot][one[robot]] + costs[robot][two[robot]]
                    idle = (*two[:robot], 0, *two[robot + 1 :])
                    instead = [
                        step.get((step[start, first], idle))
                        for label in np.flatnonzero(costs[robot] < paid).tolist()
                        if (start, first := (*one[:robot], label, *one[robot + 1 :])) in step
                    ]
                    if facts[end] not in {facts[other] for other in instead if other is not None}:
                        names = model.labels[robot]
                        wrong.append(f"{names[one[robot]]} {names[two[robot]]}")
    return wrong, met


def checked(seeds: range) -> Counter[str]:
    met: Counter[str] = Counter()
    for seed in seeds:
        for loaded in (rooms(seed), random_instance(seed, "makespan+actions")):
            if loaded is None or loaded.model.is_joint_action:
                continue
            try:
                wrong, own = wrong_pairs(loaded)
            except BadInput:
                continue
            assert not wrong
            met += own
    return met


def test_instead_of_a_dominated_pair_something_cheaper_leads_to_the_same_state() -> None:
    met = checked(range(12))
    assert met["pairs"] > 200
    assert met["steps"] > 500


@pytest.mark.slow
def test_instead_of_a_dominated_pair_something_cheaper_leads_there_in_many_models() -> None:
    met = checked(range(1_000, 1_400))
    print(dict(met))
    assert met["steps"] > 10_000


def test_to_drive_on_without_a_stop_and_to_turn_back_are_dominated() -> None:
    text = """(define (domain drive) (:types robot place)
      (:predicates (at ?r - robot ?p - place) (way ?p ?q - place) (seen ?p - place)
        (lucky ?r - robot) (glad ?r - robot))
      (:action luck :agent ?r - robot :parameters () :effect (lucky ?r))
      (:action hop :agent ?r - robot :parameters (?p ?q - place)
        :precondition (and (at ?r ?p) (way ?p ?q))
        :effect (and (not (at ?r ?p)) (at ?r ?q) (when (lucky ?r) (glad ?r))))
      (:action go :agent ?r - robot :parameters (?p ?q - place)
        :precondition (and (at ?r ?p) (way ?p ?q)) :effect (and (not (at ?r ?p)) (at ?r ?q)))
      (:action see :agent ?r - robot :parameters (?p - place)
        :precondition (at ?r ?p) :effect (seen ?p)))"""
    problem = """(define (problem p) (:domain drive) (:objects r1 r2 - robot a b c d - place)
      (:init (at r1 a) (at r2 a) (way a b) (way b a) (way b c) (way a c) (way c d))
      (:goal (and (seen c) (seen d))))"""
    domain = parse_domain(Source("domain", text))
    options = ModelOptions(cost="makespan+actions")
    loaded = build(domain, [parse_problem(Source("problem", problem), domain)], options)
    model = loaded.model
    found = dominated_pairs(model, state_variables(model, loaded.tasks[0].init))
    for robot, own in enumerate(found):
        name, labels = model.robots[robot], model.labels[robot]
        pairs = {(labels[one], labels[two]) for one, two in np.argwhere(own).tolist()}
        go = {f"{p}{q}": f"(go {name} {p} {q})" for p, q in ("ab", "ba", "bc", "ac", "cd")}
        # From b by a to c there is a way, too; from a by c to d, and from b by c to d, there is none.
        assert pairs == {
            (go[one], go[two])
            for one, two in (("ab", "ba"), ("ba", "ab"), ("ab", "bc"), ("ba", "ac"))
        }
    shortest = build(domain, [parse_problem(Source("problem", problem), domain)], ModelOptions())
    none = dominated_pairs(shortest.model, ())
    assert not any(own.any() for own in none)
