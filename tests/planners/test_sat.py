# SPDX-License-Identifier: GPL-3.0-or-later
"""Clauses that are simplified, against all values of their variables."""

from __future__ import annotations

from array import array
from contextlib import closing
from itertools import product

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from planners.search.questions import FixedPlans
from planners.search.sat import sat_solver, simplified

VARIABLES = 6
literal = st.integers(1, VARIABLES).flatmap(lambda v: st.sampled_from((v, -v)))
formula = st.lists(st.lists(literal, min_size=1, max_size=4), min_size=1, max_size=14)


def kept_values(clauses: list[list[int]], kept: list[int]) -> set[tuple[bool, ...]]:
    """The values of some variables in all models."""
    return {
        tuple(values[v - 1] for v in kept)
        for values in product((False, True), repeat=VARIABLES)
        if all(any(values[abs(lit) - 1] == (lit > 0) for lit in clause) for clause in clauses)
    }


def flat(clauses: list[list[int]]) -> array[int]:
    return array("i", [k for clause in clauses for k in (*clause, 0)])


@given(formula, st.sets(st.integers(1, VARIABLES), min_size=1))
def test_simplified_clauses_allow_the_same_values_of_kept_variables(
    clauses: list[list[int]], kept: set[int]
) -> None:
    names = sorted(kept)
    expected = kept_values(clauses, names)
    if not expected:
        return
    found = simplified(flat(clauses), names)
    with sat_solver("minisat22", found) as solver:
        for values in product((False, True), repeat=len(names)):
            asked = [v if true else -v for v, true in zip(names, values, strict=True)]
            assert solver.solve(assumptions=asked) == (values in expected)


def test_variables_that_are_not_kept_go() -> None:
    chain = [[-k, k + 1] for k in range(1, 50)]
    found = simplified(flat(chain), [1, 50])
    assert {abs(lit) for clause in found for lit in clause} == {1, 50}


@given(formula)
def test_clauses_that_are_added_at_once_say_the_same_as_one_by_one(
    clauses: list[list[int]],
) -> None:
    first = np.ones((1, 1), np.int64)
    none, every = (np.array(own, np.int64) for own in ((), flat(clauses)))
    with (
        closing(FixedPlans(none, first, [VARIABLES], 100)) as one,
        closing(FixedPlans(every, first, [VARIABLES], 100)) as many,
    ):
        for clause in clauses:
            one.add(clause)
        assert many.clauses == one.clauses
        assert many.holds() == one.holds() == bool(kept_values(clauses, []))
