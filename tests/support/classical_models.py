# SPDX-License-Identifier: GPL-3.0-or-later
"""Small models by hand for the plain forms of a joint model."""

from __future__ import annotations

import random
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache

import pytest

from planners.classical import selection
from planners.joint.tables import Rows
from planners.loading import PlanningInstance
from planners.pddl.model_options import Cost, ModelOptions, Unowned
from tests.support.texts import model_of

COSTS: tuple[Cost, ...] = ("makespan", "makespan+actions")
FORMS = {"explicit": 100_000, "select-then-apply": 0}
#: Ways to write select-then-apply: what no other robot sees is applied at once, or nothing is; the
#: actions that end a step delete what is left of it, or one more action does.
WAYS = ("usual", "nothing at once", "tidied")

CORRIDOR = """
(define (domain corridor)
  (:types robot place)
  (:predicates (at ?r - robot ?p - place) (next ?a ?b - place))
  (:action move :agent ?r - robot :parameters (?a ?b - place)
    :precondition (and (at ?r ?a) (next ?a ?b)
      (forall (?o - robot) (not (at ?o ?b)))
      (forall (?o - robot) (not (move ?o ?b ?a)))
      (forall (?o - robot ?c - place) (not (move ?o ?c ?b))))
    :effect (and (at ?r ?b) (not (at ?r ?a)))))
"""
CORRIDOR_TASK = """
(define (problem swap) (:domain corridor)
  (:objects r1 r2 - robot a b c d - place)
  (:init (at r1 a) (at r2 c) (next a b) (next b a) (next b c) (next c b) (next b d) (next d b))
  (:goal (and (at r1 c) (at r2 a))))
"""

#: Partners (positive formulas) that would interfere if the formula did not link them, an effect
#: that only a partner brings about, an action without effects, a disjunction.
PARTNERS = """
(define (domain partners)
  (:types robot table)
  (:predicates (high ?t - table) (open) (tired ?r - robot) (dirty ?t - table) (spare))
  (:action lift :agent ?r - robot :parameters (?t - table)
    :precondition (and (not (tired ?r)) (not (high ?t)) (exists (?o - robot) (and (not (= ?o ?r)) (lift ?o ?t))))
    :effect (and (high ?t) (tired ?r)))
  (:action press :agent ?r - robot :parameters () :precondition () :effect ())
  (:action enter :agent ?r - robot :parameters ()
    :precondition (and (not (open)) (or (spare) (exists (?o - robot) (and (not (= ?o ?r)) (press ?o)))))
    :effect (open))
  (:action rest :agent ?r - robot :parameters ()
    :precondition (tired ?r)
    :effect (and (when (exists (?o - robot) (and (not (= ?o ?r)) (rest ?o))) (not (tired ?r)))
                 (when (not (open)) (spare))))
  (:action wipe :agent ?r - robot :parameters (?t - table)
    :precondition (and (dirty ?t) (not (tired ?r)) (imply (high ?t) (open)))
    :effect (and (not (dirty ?t)) (when (high ?t) (dirty ?t)))))
"""
PARTNERS_TASK = """
(define (problem both) (:domain partners)
  (:objects r1 r2 - robot t1 t2 - table)
  (:init (dirty t1) (dirty t2))
  (:goal (and (high t1) (high t2) (open) (not (dirty t1)) (not (dirty t2)) (not (tired r1)))))
"""

#: Robots are objects: an action with two robots is shared; three robots, one of which is needed by
#: both others.
RELAY = """
(define (domain relay)
  (:requirements :strips :typing :negative-preconditions :disjunctive-preconditions)
  (:types robot box)
  (:predicates (has ?r - robot ?b - box) (busy ?r - robot) (near ?r ?s - robot) (on-floor ?b - box) (done ?b - box))
  (:action pick :parameters (?r - robot ?b - box)
    :precondition (and (on-floor ?b) (not (busy ?r)))
    :effect (and (has ?r ?b) (busy ?r) (not (on-floor ?b))))
  (:action give :parameters (?r ?s - robot ?b - box)
    :precondition (and (has ?r ?b) (not (busy ?s)) (near ?r ?s))
    :effect (and (has ?s ?b) (busy ?s) (not (has ?r ?b)) (not (busy ?r))))
  (:action put :parameters (?r - robot ?b - box)
    :precondition (has ?r ?b)
    :effect (and (done ?b) (not (has ?r ?b)) (not (busy ?r)))))
"""
RELAY_TASK = """
(define (problem relay-1) (:domain relay)
  (:objects r1 r2 r3 - robot b1 b2 - box)
  (:init (on-floor b2) (has r1 b1) (busy r1) (near r1 r2) (near r2 r3) (near r3 r2) (near r2 r1))
  (:goal (and (has r3 b1) (or (done b2) (and (has r1 b2) (or (done b1) (not (busy r2))))))))
"""

#: What one robot may both delete and conditionally add must not wipe out what another adds: adds
#: win over all deletes.
BLINK = """
(define (domain blink)
  (:types robot)
  (:predicates (lamp) (ready ?r - robot) (seen) (switcher ?r - robot))
  (:action flash :agent ?r - robot :parameters () :precondition (and (ready ?r) (not (switcher ?r)))
    :effect (and (not (lamp)) (when (seen) (lamp)) (not (ready ?r))))
  (:action switch :agent ?r - robot :parameters () :precondition (and (ready ?r) (switcher ?r))
    :effect (and (lamp) (not (ready ?r))))
  (:action look :agent ?r - robot :parameters () :precondition (not (ready ?r)) :effect (seen)))
"""
BLINK_TASK = """
(define (problem blink-1) (:domain blink) (:objects r1 r2 - robot)
  (:init (ready r1) (ready r2) (lamp) (switcher r1))
  (:goal (and (lamp) (not (ready r1)) (not (ready r2)))))
"""

JOINT = """
(define (domain joint)
  (:requirements :strips :typing :negative-preconditions :conditional-effects)
  (:types cell)
  (:predicates (at1 ?c - cell) (at2 ?c - cell) (next ?a ?b - cell) (flag))
  (:action both
    ; subaction r1 (move ?a ?b)
    ; subaction r2 (move ?c ?d)
    :parameters (?a ?b ?c ?d - cell)
    :precondition (and (at1 ?a) (next ?a ?b) (at2 ?c) (next ?c ?d) (not (= ?b ?d)) (not (and (= ?a ?d) (= ?b ?c))))
    :effect (and (not (at1 ?a)) (not (at2 ?c)) (at1 ?b) (at2 ?d)))
  (:action first
    ; subaction r1 (move ?a ?b)
    ; subaction r2 idle
    :parameters (?a ?b - cell)
    :precondition (and (at1 ?a) (next ?a ?b) (or (not (at2 ?b)) (flag)))
    :effect (and (not (at1 ?a)) (at1 ?b) (when (not (at2 ?b)) (flag)))))
"""
JOINT_TASK = """
(define (problem joint-1) (:domain joint) (:objects a b c d - cell)
  (:init (at1 a) (at2 b) (next a b) (next b a) (next b c) (next c b) (next c d) (next d c) (next a d) (next d a))
  (:goal (and (at1 b) (at2 b))))
"""

#: Interference alone makes this take three steps and not one.
TOOL = """
(define (domain tool)
  (:types robot)
  (:predicates (free) (done ?r - robot))
  (:action work :agent ?r - robot :parameters () :precondition (free) :effect (and (done ?r) (not (free))))
  (:action release :agent ?r - robot :parameters () :precondition (not (free)) :effect (free)))
"""
TOOL_TASK = """
(define (problem tool-1) (:domain tool) (:objects r1 r2 - robot) (:init (free)) (:goal (and (done r1) (done r2))))
"""

#: Only a negative formula keeps the two from singing at once.
SOLO = """
(define (domain solo)
  (:types robot)
  (:predicates (done ?r - robot))
  (:action sing :agent ?r - robot :parameters ()
    :precondition (forall (?o - robot) (not (sing ?o))) :effect (done ?r)))
"""
SOLO_TASK = """
(define (problem solo-1) (:domain solo) (:objects r1 r2 - robot) (:init) (:goal (and (done r1) (done r2))))
"""

#: A shared action of which nobody reads what it does: a robot is needed for it all the same.
LIFT = """
(define (domain lift)
  (:types robot box)
  (:predicates (up ?b - box) (near ?r ?s - robot))
  (:action lift :parameters (?r ?s - robot ?b - box)
    :precondition (near ?r ?s) :effect (up ?b)))
"""
LIFT_TASK = """
(define (problem lift-1) (:domain lift) (:objects r1 r2 r3 - robot b1 b2 - box)
  (:init (near r1 r2) (near r2 r3) (near r3 r1)) (:goal (and (up b1) (up b2))))
"""

#: What the last robot deletes if both others do their part, one of these adds: no two of them
#: interfere, for the condition needs all three, and what is added is there after the step.
BASIN = """
(define (domain basin)
  (:types robot)
  (:constants r1 r2 r3 - robot)
  (:predicates (full) (done ?r - robot))
  (:action fill :agent ?r - robot :parameters () :precondition (= ?r r1) :effect (and (full) (done ?r)))
  (:action stir :agent ?r - robot :parameters () :precondition (= ?r r2) :effect (done ?r))
  (:action drain :agent ?r - robot :parameters () :precondition (= ?r r3)
    :effect (and (done ?r) (when (and (fill r1) (stir r2)) (not (full))))))
"""
BASIN_TASK = """
(define (problem basin-1) (:domain basin) (:objects) (:init)
  (:goal (and (full) (done r1) (done r2) (done r3))))
"""

MODELS = {
    "tool": (TOOL, TOOL_TASK),
    "solo": (SOLO, SOLO_TASK),
    "corridor": (CORRIDOR, CORRIDOR_TASK),
    "partners": (PARTNERS, PARTNERS_TASK),
    "relay": (RELAY, RELAY_TASK),
    "blink": (BLINK, BLINK_TASK),
    "lift": (LIFT, LIFT_TASK),
    "joint-action": (JOINT, JOINT_TASK),
    "basin": (BASIN, BASIN_TASK),
}


@contextmanager
def written(way: str) -> Iterator[None]:
    """Let select-then-apply be written in one of `WAYS`."""
    with pytest.MonkeyPatch.context() as patch:
        if way == "nothing at once":
            patch.setattr(selection, "_may_be_at_once", lambda *_: False)
        if way == "tidied":
            patch.setattr(selection, "_MANY", -1)
        yield


@cache
def read(
    domain_text: str, problem_text: str, cost: Cost = "makespan", unowned: Unowned = "error"
) -> PlanningInstance:
    return model_of(domain_text, problem_text, ModelOptions(unowned=unowned, cost=cost))


def random_state(loaded: PlanningInstance, seed: int) -> Rows:
    """The given initial state, or another one."""
    rng = random.Random(seed)
    if seed % 4 == 0:
        return loaded.tasks[0].init
    return loaded.model.codec.encode(
        fact for fact in loaded.model.codec.facts.texts if rng.random() < 0.6
    )
