# SPDX-License-Identifier: GPL-3.0-or-later
"""Graphs, tables of states and SAT solvers, against their definitions, limits and signals."""

from __future__ import annotations

import os
import subprocess
from array import array
from contextlib import closing
from itertools import product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from coordlang.symmetry.group import orbits
from planners.search import reachable
from planners.search.questions import FixedPlans
from planners.search.reachable import StateTable
from planners.search.sat import sat_solver, simplified
from tests.support import thorough
from tests.support.command import own_process
from tests.support.domains import DOMAINS

PERMUTATIONS = st.lists(st.permutations(range(7)), min_size=1, max_size=3)


def reached(edges: set[tuple[int, int]], start: int) -> set[int]:
    found = {start}
    while more := {b for a, b in edges if a in found} - found:
        found |= more
    return found


@given(PERMUTATIONS)
def test_orbits_are_what_permutations_take_to_each_other(permutations: list[list[int]]) -> None:
    orbit = orbits([np.array(permutation) for permutation in permutations])
    ways = {pair for permutation in permutations for pair in enumerate(permutation)}
    for a in range(7):
        assert np.flatnonzero(orbit == orbit[a]).tolist() == sorted(reached(ways, a))


@pytest.mark.parametrize(
    ("name", "code", "said"), [("lift", 22, "scipy takes up to"), ("build", 3, "out of memory")]
)
def test_a_command_under_a_limit_that_is_too_small_ends(name: str, code: int, said: str) -> None:
    """BLAS would ask for memory without end, and hear no signal; a SAT solver would end all."""
    files = [DOMAINS / "grid" / name for name in ("domain.pddl", "gw4-3x3.pddl")]
    command = own_process(name, *files, "--tasks=all", "-o", os.devnull, "--memory-limit=220M")
    done = subprocess.run(command, capture_output=True, text=True, timeout=100)
    assert done.returncode in (0, code), done.stderr
    assert said in done.stderr or not done.returncode


part = st.lists(st.tuples(st.integers(0, 3), st.integers(0, 2)), max_size=12)


@pytest.mark.parametrize("multiplier", [*thorough(0), reachable._MULTIPLIER])
@pytest.mark.parametrize("block", [3, 1 << 16])
@given(parts=st.lists(part, max_size=6))
def test_states_have_the_numbers_that_a_dictionary_gives(
    multiplier: int, block: int, parts: list[list[tuple[int, int]]]
) -> None:
    known: dict[tuple[int, int], int] = {}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(reachable, "_MULTIPLIER", np.uint64(multiplier))
        patch.setattr(reachable, "_BLOCK", block)
        table = StateTable(2)
        table._rows, table._slots = table._rows[:1], table._slots[:2]  # it has to grow
        for states in parts:
            found = table.add(np.array(states, np.uint64).reshape(-1, 2)).tolist()
            for state, number in zip(states, found, strict=True):
                assert known.setdefault(state, number) == number
            assert sorted(known.values()) == list(range(len(table)))
            assert table.rows(np.array(found, np.int64)).tolist() == list(map(list, states))


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
    none, every = (np.array(own, np.int64) for own in ((), flat(clauses)))
    with (
        closing(FixedPlans(none, [VARIABLES])) as one,
        closing(FixedPlans(every, [VARIABLES])) as many,
        closing(FixedPlans(none, [VARIABLES])) as before,
    ):
        for clause in clauses:
            one.add(clause)
        before.put_before(every, np.array([1]))
        assert many.clauses == one.clauses == before.clauses
        holds = many.holds()
        assert holds == one.holds() == before.holds() == bool(kept_values(clauses, []))
