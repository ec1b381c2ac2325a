# SPDX-License-Identifier: GPL-3.0-or-later
"""The formula of a joint step, against the joint steps of the model."""

from __future__ import annotations

from itertools import combinations, product

from planners.grounding import GroundAction
from planners.joint.composition import ComposingStepper
from planners.joint.conditions import speaks_of_step
from planners.joint.model import JointModel
from planners.loading import build
from planners.pddl import parse_domain, parse_problem
from planners.pddl.model_options import ModelOptions
from planners.pddl.sexpr import Source
from planners.search.plan_formula import TooManyClauses, step_formula
from planners.search.sat import sat_solver
from tests.support.random_instances import random_instance


def asks_others(action: GroundAction | None) -> bool:
    """Whether the condition of an action says what others do."""
    return action is not None and speaks_of_step(action.precondition)


def pairs_apart(model: JointModel) -> int:
    """How many pairs of labels exclude each other, in the formula as in the tables."""
    stepper = model.stepper
    assert isinstance(stepper, ComposingStepper)
    formula = step_formula(model, (), list)
    first = formula.first_label
    facts = len(model.codec.facts)
    about_labels = [
        clause
        for clause in formula.clauses
        if not any(abs(lit) <= facts or abs(lit) > formula.size for lit in clause)
    ]
    others = len(model.robots) > 2  # what two may do together can hang on a third
    count = 0
    with sat_solver("minisat22", about_labels) as solver:
        for (i, own), (j, other) in combinations(enumerate(stepper.labelled), 2):
            for (a, one), (b, two) in product(enumerate(own), enumerate(other)):
                both = [first[i] + a, first[j] + b]
                if all(solver.propagate([chosen])[0] for chosen in both):
                    apart = not solver.propagate(both)[0]
                    forbidden = not stepper.tables[i, j][a, b]
                    assert apart >= forbidden
                    assert apart == forbidden or others or asks_others(one) or asks_others(two)
                    count += forbidden
    return count


def test_labels_exclude_each_other_as_the_tables_say() -> None:
    counts = []
    for seed in range(120):
        loaded = random_instance(seed)
        if loaded is None or loaded.model.is_joint_action:
            continue
        try:
            counts.append(pairs_apart(loaded.model))
        except TooManyClauses:
            continue
    assert sum(count > 0 for count in counts) >= 10
    assert len(counts) >= 30


BUTTONS = """(define (domain buttons) (:types robot button)
  (:predicates (free) (pressed ?b - button))
  (:action press :agent ?r - robot :parameters (?b - button) :precondition (free)
    :effect (and (not (free)) (pressed ?b))))"""


def test_what_excludes_is_said_fact_by_fact() -> None:
    """Of 50 x 50 labels that all need one fact and delete it, not of each pair."""
    names = " ".join(f"b{k}" for k in range(50))
    domain = parse_domain(Source("domain", BUTTONS))
    text = (
        f"(define (problem p) (:domain buttons) (:objects r1 r2 - robot {names} - button)"
        " (:init (free)) (:goal (pressed b0)))"
    )
    model = build(domain, [parse_problem(Source("problem", text), domain)], ModelOptions()).model
    assert pairs_apart(model) == 50 * 50
    formula = step_formula(model, (), list)
    between = [
        clause
        for clause in formula.clauses
        if len(clause) == 2 and all(51 < abs(lit) <= formula.size for lit in clause)
    ]
    chains = 2 * 3 * 50
    assert len(between) <= chains + 2 * 50 + 1
