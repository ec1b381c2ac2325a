# SPDX-License-Identifier: GPL-3.0-or-later
"""What an unsolvable task is blamed on: actions that a robot can never do, and what they lack."""

from __future__ import annotations

import pytest

from planners.loading import PlanningInstance
from planners.pddl.lifted import Atom
from planners.pddl.robots import static_atoms
from planners.search.optimal_plans import search
from planners.search.reachable import explore
from planners.system.errors import ProvedImpossible
from tests.support.joint_twin import built
from tests.support.random_pddl import Kind, random_model
from tests.support.texts import model_of

CARRY = """(define (domain carry) (:types robot box room)
 (:predicates (at ?r - robot ?x - room) (in ?b - box ?x - room) (empty ?r - robot)
  (holds ?r - robot ?b - box) (strong ?r - robot))
 (:action go :agent ?r - robot :parameters (?x ?y - room)
  :precondition (at ?r ?x) :effect (and (at ?r ?y) (not (at ?r ?x))))
 (:action lift :agent ?r - robot :parameters (?b - box ?x - room)
  :precondition (and (at ?r ?x) (in ?b ?x) (strong ?r) (empty ?r))
  :effect (and (holds ?r ?b) (not (empty ?r)) (not (in ?b ?x))))
 (:action put :agent ?r - robot :parameters (?b - box ?x - room)
  :precondition (and (at ?r ?x) (holds ?r ?b))
  :effect (and (in ?b ?x) (empty ?r) (not (holds ?r ?b)))))"""
ALL = "(at r1 a) (at r2 a) (in b1 a) (in b2 a) (empty r1) (empty r2) (strong r1) (strong r2)"
#: Nobody can hold two boxes.
TWO = "(and (holds r1 b1) (holds r1 b2))"


def carry(init: str, goal: str) -> PlanningInstance:
    return model_of(
        CARRY,
        "(define (problem p) (:domain carry) (:objects r1 r2 - robot b1 b2 - box a b - room)"
        f" (:init {init}) (:goal {goal}))",
    )


LIFT = "Action lift of r1 is never possible: nothing makes (empty r1) true."
PUT = "Action put of r1 is never possible: nothing makes (holds r1 ?b) true."


@pytest.mark.parametrize(
    ("forgotten", "goal", "said"),
    [
        ("(empty r1)", TWO, ["needs (holds r1 b1), and nothing makes it true.", LIFT, PUT]),
        ("(empty r1)", "(and (holds r2 b1) (holds r2 b2))", [LIFT, PUT]),
        (
            "(at r1 a)",
            "(and (holds r2 b1) (holds r2 b2))",
            ["Action go of r1 is never possible: nothing makes (at r1 ?x)"],
        ),
        (
            "(strong r1)",
            TWO,
            ["needs (holds r1 b1)", "r1 is never possible: nothing makes (strong r1)", PUT],
        ),
        # Perhaps it is meant to be weak: not said of a goal that is about another robot.
        ("(strong r1)", "(and (holds r2 b1) (holds r2 b2))", []),
        ("(at r9 a)", TWO, []),
    ],
)
def test_what_is_said(forgotten: str, goal: str, said: list[str]) -> None:
    loaded = carry(ALL.replace(forgotten, ""), goal)
    with pytest.raises(ProvedImpossible) as caught:
        search(loaded.model, loaded.tasks[0])
    text = caught.value.remedy or ""
    for part in (LIFT, PUT, "never possible", *said):
        assert (part in text) == any(part in one for one in said), text


def test_an_unreachable_goal_comes_with_the_interference_met_most_often() -> None:
    loaded = model_of(
        """(define (domain tables) (:types robot) (:predicates (level) (up ?r - robot))
         (:action lift :agent ?r :parameters () :precondition (level)
          :effect (and (up ?r) (not (level)))))""",
        "(define (problem t) (:domain tables) (:objects r1 r2 - robot) (:init (level))"
        " (:goal (and (up r1) (up r2))))",
    )
    with pytest.raises(ProvedImpossible) as caught:
        search(loaded.model, loaded.tasks[0])
    said = "(1 of 1 states looked at): (lift r1) deletes (level), which (lift r2) needs."
    assert said in str(caught.value.remedy)


@pytest.mark.parametrize("kind", ["agent", "plain"])
def test_in_random_models_what_is_said_is_true_of_every_reachable_state(kind: Kind) -> None:
    told = 0
    for seed in range(80):
        loaded = built(random_model(seed, kind))
        model = loaded.model
        space = explore(model, loaded.tasks[0].init[None, :])
        facts = {
            model.codec.facts.atoms[f] for row in space.rows for f in model.codec.true_facts(row)
        }
        facts |= static_atoms(loaded.domain, loaded.problems[0])
        for one in model.impossible:
            told += 1
            robot = model.robots.index(one.robot)
            used = {model.labels[robot][k] for k in space.labels[:, robot].tolist()}
            assert not any(text.startswith(f"({one.action} ") for text in used)
            assert not any(matches(one.atom, fact) for fact in facts)
    assert told >= 10


def matches(atom: Atom, fact: Atom) -> bool:
    if (atom.predicate, len(atom.args)) != (fact.predicate, len(fact.args)):
        return False
    return all(a.startswith("?") or a == b for a, b in zip(atom.args, fact.args, strict=True))
