# SPDX-License-Identifier: GPL-3.0-or-later
"""Effects that two actions themselves rule out; what kept robots apart; actions that do nothing."""

from __future__ import annotations

import pytest

from planners.check.rules import Rules
from planners.check.validate import validate
from planners.classical import compile_classical
from planners.classical.selectors import clashes
from planners.joint.interference import conflict
from planners.loading import PlanningInstance
from planners.search.optimal_plans import search
from planners.search.plans import Plans
from planners.system.errors import ProvedImpossible
from tests.support.naive_classical import optimal_plans
from tests.support.texts import model_of

LIFT = """(define (domain tables) (:types robot) (:predicates (level) (up ?r - robot) (spilled))
  (:action lift :agent ?r :parameters () :precondition (level) :effect (and (up ?r)
    (when (and (level) (forall (?o - robot) (or (= ?o ?r) (not (lift ?o)))))
      (and (not (level)) (spilled))))) {more})"""
LEAN = "(:action lean :agent ?r - robot :parameters () :precondition (level) :effect (up ?r))"
#: The effect needs a third robot: of a pair without it nothing is added or deleted.
THREE = """(define (domain three) (:types robot) (:predicates (free) (up) (seen))
  (:action lift :agent ?r - robot :parameters (?a ?b - robot)
    :precondition (and (not (= ?a ?r)) (not (= ?b ?r)) (not (= ?a ?b))) :effect
      (and (seen) (when (and (hold ?a) (hold ?b)) (and (up) (not (free))))))
  (:action hold :agent ?r - robot :parameters () :precondition (free) :effect (seen)))"""


def tables(robots: str, goal: str, more: str = "") -> PlanningInstance:
    return model_of(
        LIFT.format(more=more),
        f"(define (problem t) (:domain tables) (:objects {robots} - robot) (:init (level))"
        f" (:goal {goal}))",
    )


def named(loaded: PlanningInstance, label: str) -> int:
    return [action.label for action in loaded.model.actions].index(label)


def judged(loaded: PlanningInstance, first: str, second: str) -> bool:
    """Whether two actions may share a step, by the rule read literally and for whole tables.

    They agree with the cross-check's own code and with the plan checker's.
    """
    model = loaded.model
    a, b = named(loaded, first), named(loaded, second)
    left, right = model.actions[a], model.actions[b]
    (i,), (j,) = left.owners, right.owners
    allowed = conflict(left, right) is None
    own = model.stepper.tables[min(i, j), max(i, j)]  # type: ignore[attr-defined]
    labels = {i: model.label_number(i, first), j: model.label_number(j, second)}
    assert own[labels[min(i, j)], labels[max(i, j)]] == allowed
    assert (b not in clashes(model.actions)[a]) == allowed
    rules = Rules(loaded.domain, loaded.problems[0], loaded.team)
    one, other = rules.instance(first), rules.instance(second)
    assert not isinstance(one, str)
    assert not isinstance(other, str)
    clash = rules._clash(one, other) or rules._clash(other, one)
    assert (clash is None) == allowed
    return allowed


def test_two_robots_lift_a_table_at_once() -> None:
    goal = "(and (up r1) (up r2) (not (spilled)))"
    loaded = tables("r1 r2", goal)
    assert judged(loaded, "(lift r1)", "(lift r2)")
    plans = Plans.of(search(loaded.model, loaded.tasks[0]))
    assert plans.space.cost_of(0) == (1, 0)
    assert plans.count == 1
    steps = [loaded.model.texts(step) for step in next(iter(plans))]
    assert steps == [("(lift r1)", "(lift r2)")]
    assert validate(loaded.domain, loaded.problems[0], loaded.team, steps).valid
    for limit in (2000, 0):
        classical = compile_classical(loaded.model, loaded.tasks[0], limit)
        total = optimal_plans(classical).cost
        assert total is not None
        assert classical.cost(total) == (1, 0)


def test_alone_it_spills_and_nobody_may_lean_on_it() -> None:
    loaded = tables("r1 r2", "(spilled)", LEAN)
    assert search(loaded.model, loaded.tasks[0]).cost_of(0) == (1, 0)
    assert not judged(loaded, "(lift r1)", "(lean r2)")
    three = tables("r1 r2 r3", "(and (up r1) (up r2) (up r3))", LEAN)
    assert judged(three, "(lift r1)", "(lift r2)")
    assert not judged(three, "(lift r3)", "(lean r2)")
    # All lift or all lean: each pair of a lift and a lean interferes, whatever the third one does.
    assert Plans.of(search(three.model, three.tasks[0])).count == 2


def test_an_effect_that_needs_a_third_robot_counts_for_no_pair_without_it() -> None:
    loaded = model_of(
        THREE,
        "(define (problem p) (:domain three) (:objects r1 r2 r3 - robot) (:init (free))"
        " (:goal (up)))",
    )
    assert judged(loaded, "(lift r1 r2 r3)", "(hold r2)")
    assert search(loaded.model, loaded.tasks[0]).cost_of(0) == (1, 0)


def test_an_unreachable_goal_comes_with_the_interference_met_most_often() -> None:
    text = LIFT.format(more="").replace(
        "(when (and (level) (forall", "(and (not (level)) (when (and (level) (forall"
    )
    loaded = model_of(
        text.replace("(and (not (level)) (spilled))", "(spilled))"),
        "(define (problem t) (:domain tables) (:objects r1 r2 - robot) (:init (level))"
        " (:goal (and (up r1) (up r2))))",
    )
    with pytest.raises(ProvedImpossible) as caught:
        search(loaded.model, loaded.tasks[0])
    assert caught.value.remedy == (
        "1 state was searched. From 2 more the goal could not be reached even if no action "
        "deleted anything.\n  Of pairs of actions that cannot share a step, the one met most "
        "often (1 of 1 states looked at): (lift r1) deletes (level), which (lift r2) needs."
    )
