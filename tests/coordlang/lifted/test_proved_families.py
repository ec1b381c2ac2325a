# SPDX-License-Identifier: GPL-3.0-or-later
"""What docs/lifted.md proves for all sizes, checked on small ones."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest
from generate import problem_text, scenario
from gridmap import GridMap, path

from coordlang.language.candidates import Candidates, all_pairs
from coordlang.language.partition import Partition
from coordlang.verification.by_definition import verify
from planners.joint.tables import Ints
from planners.pddl import parse_problem, read_domain
from planners.pddl.sexpr import Source
from tests.support.domains import DOMAINS


def cycle(size: int) -> GridMap:
    """A ring of any number of cells; the names say nothing of places."""
    cells = {f"p{k}": (0, k) for k in range(size)}
    names = list(cells)
    return GridMap(cells, tuple((names[k], names[(k + 1) % size]) for k in range(size)))


def tasks_on(grid: GridMap) -> Candidates:
    domain = read_domain(DOMAINS / "grid" / "domain.pddl")
    text = problem_text(scenario("some", grid), "grid")
    return all_pairs(domain, [parse_problem(Source("some", text), domain)])


def arcs(candidates: Candidates, size: int, cuts: tuple[int, ...]) -> Ints:
    """The number of the arc in which r1 is, for cuts before these cells."""
    arc = []
    for row in candidates.rows:
        (atom,) = (a for a in candidates.model.codec.decode(row) if a.startswith("(at r1 "))
        place = int(atom.removeprefix("(at r1 p").removesuffix(")"))
        arc.append(sum(cut <= place for cut in cuts) % len(cuts))
    return np.array(arc)


def holds(candidates: Candidates, words: Ints) -> bool:
    names = [f"w{k}" for k in range(int(words.max()) + 1)]
    return verify(Partition.of_table(names, candidates.rows, words), candidates.spaces).holds


@pytest.mark.parametrize(
    "size", [3, 4, 5, *(pytest.param(n, marks=pytest.mark.thorough) for n in (6, 7))]
)
def test_three_arcs_of_a_ring_are_words(size: int) -> None:
    """Every partition by arcs of r1, three or more of them; two are not enough."""
    candidates = tasks_on(cycle(size))
    for number in range(3, min(size, 5) + 1):
        for cuts in combinations(range(size), number):
            assert holds(candidates, arcs(candidates, size, cuts)), cuts
    assert not all(
        holds(candidates, arcs(candidates, size, cuts)) for cuts in combinations(range(size), 2)
    )


@pytest.mark.parametrize("size", [3, 5, 8])
def test_a_path_needs_one_word(size: int) -> None:
    candidates = tasks_on(path(size, []))
    assert holds(candidates, np.zeros(len(candidates.rows), np.int64))
