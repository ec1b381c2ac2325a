# SPDX-License-Identifier: GPL-3.0-or-later
"""Formulas taken apart and put together, against the definition on random formulas."""

from __future__ import annotations

from itertools import product

from hypothesis import given
from hypothesis import strategies as st

from planners.pddl.formula_tree import conjuncts, joined, negated, signed, substituted
from planners.pddl.lifted import FALSE, TRUE, And, Atom, Formula, Not, Or, StepAtom, Truth

LEAVES: tuple[Formula, ...] = (Atom("a", ()), Atom("b", ()), StepAtom("move", ("r1", "x")))
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


@given(FORMULAS)
def test_the_meaning_is_kept(formula: Formula) -> None:
    assert joined(And, [formula, FALSE]) == FALSE
    part, positive = signed(formula)
    assert (part if positive else Not(part)) == formula
    for chosen in product((False, True), repeat=len(LEAVES)):
        values = dict(zip(LEAVES, chosen, strict=True))
        meant = true(formula, values)
        assert true(And(conjuncts(formula)), values) == meant
        assert true(negated(formula), values) != meant
        assert true(substituted(formula, lambda leaf: leaf), values) == meant
        decided = substituted(formula, lambda leaf: Truth(values[leaf]))  # noqa: B023 - now
        assert decided == Truth(meant)
