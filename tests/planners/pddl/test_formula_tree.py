# SPDX-License-Identifier: GPL-3.0-or-later
"""One fold over formulas, and what is made with it, against the definitions on random formulas."""

from __future__ import annotations

from itertools import product

import pytest
from hypothesis import given
from hypothesis import strategies as st

from planners.pddl.formula_tree import (
    conjuncts,
    forbidden_steps,
    formula_text,
    joined,
    literals,
    negated,
    required_atoms,
    signed,
    substituted,
)
from planners.pddl.lifted import (
    FALSE,
    TRUE,
    And,
    Atom,
    Equal,
    Exists,
    Forall,
    Formula,
    Not,
    Or,
    StepAtom,
    Truth,
    Variable,
)

A, B, C = (Atom(name, ()) for name in "abc")
STEP = StepAtom("move", ("r1", "x"))
LEAVES: tuple[Formula, ...] = (A, B, C, STEP)
#: Ground formulas, not in negation normal form.
FORMULAS = st.recursive(
    st.sampled_from((*LEAVES, TRUE, FALSE)),
    lambda parts: st.one_of(
        st.builds(Not, parts),
        st.builds(And, st.lists(parts, max_size=3).map(tuple)),
        st.builds(Or, st.lists(parts, max_size=3).map(tuple)),
    ),
    max_leaves=8,
)
VALUES: list[dict[Formula, bool]] = [
    dict(zip(LEAVES, values, strict=True)) for values in product((False, True), repeat=len(LEAVES))
]


def true(formula: Formula, values: dict[Formula, bool]) -> bool:
    """The definition."""
    match formula:
        case Truth(value):
            return value
        case Not(part):
            return not true(part, values)
        case And(parts):
            return all(true(part, values) for part in parts)
        case Or(parts):
            return any(true(part, values) for part in parts)
    return values[formula]


def same(one: Formula, other: Formula) -> bool:
    return all(true(one, values) == true(other, values) for values in VALUES)


@given(FORMULAS)
def test_taking_apart_and_putting_together_keeps_the_meaning(formula: Formula) -> None:
    assert same(And(conjuncts(formula)), formula)
    assert not any(isinstance(part, And) or part == TRUE for part in conjuncts(formula))
    assert same(Not(formula), negated(formula))
    assert same(substituted(formula, lambda leaf: leaf), formula)
    assert joined(And, [formula, FALSE]) == FALSE
    part, positive = signed(formula)
    assert (part if positive else Not(part)) == formula


@given(FORMULAS)
def test_what_is_put_for_the_leaves_decides(formula: Formula) -> None:
    for values in VALUES:
        decided = substituted(formula, lambda leaf: Truth(values[leaf]))  # noqa: B023 - now
        assert decided == Truth(true(formula, values))


@given(FORMULAS)
def test_required_and_forbidden_is_what_no_model_lacks(formula: Formula) -> None:
    models = [values for values in VALUES if true(formula, values)]
    assert all(values[atom] for values in models for atom in required_atoms(formula))
    assert not any(values[step] for values in models for step in forbidden_steps(formula))


@given(FORMULAS)
def test_a_literal_matters_only_with_its_sign(formula: Formula) -> None:
    """A formula in which a leaf has no negative literal stays true when the leaf becomes true."""
    found = literals(formula)
    for leaf in LEAVES:
        for positive in (True, False):
            if (leaf, not positive) not in found:
                for values in VALUES:
                    if true(formula, values):
                        assert true(formula, {**values, leaf: positive})


@pytest.mark.parametrize(
    ("formula", "text"),
    [
        (TRUE, "()"),
        (FALSE, "(or)"),
        (And(()), "(and)"),
        (Not(Atom("at", ("r1", "?x"))), "(not (at r1 ?x))"),
        (Or((STEP, Equal("?x", "b"))), "(or (move r1 x) (= ?x b))"),
        (
            Forall(
                (Variable("?x"), Variable("?y", ("p", "q"))), Exists((Variable("?z", ("p",)),), A)
            ),
            "(forall (?x - object ?y - (either p q)) (exists (?z - p) (a)))",
        ),
    ],
)
def test_text(formula: Formula, text: str) -> None:
    assert formula_text(formula) == text
