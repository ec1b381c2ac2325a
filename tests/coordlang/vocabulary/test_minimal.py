# SPDX-License-Identifier: GPL-3.0-or-later
"""The exact method: known minima, agreement with brute force, and what it rests on."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from itertools import combinations, islice, permutations, product

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from coordlang.commands.building import build_language
from coordlang.language.sentences import sentence
from coordlang.language.warping import Pair, pair, short_clauses
from coordlang.vocabulary.sat import PartitionProblem
from tests.support.candidates import small_candidates
from tests.support.domains import all_tasks
from tests.support.naive import separation_clause, warping_clause


@pytest.mark.parametrize(
    ("folder", "stem", "words"),
    [
        ("three-cells", "problem", 3),
        ("t-map", "problem", 3),
        ("grid", "gw1-2x2", 3),
        ("grid-joint", "gw1-2x2", 3),
        ("grid", "gw2-2x3", 5),
        ("grid", "gwb2-3x3", 3),
    ],
)
def test_known_minima(folder: str, stem: str, words: int) -> None:
    built = build_language(all_tasks(folder, stem), "minimal")
    guarantee = built.language.guarantee
    assert (guarantee.size, guarantee.lower_bound, guarantee.proved_minimal) == (words, words, True)
    assert built.verdict.holds


def test_t_map_has_two_single_words() -> None:
    """Two words of a single state each, and two sentences of three words that say who moves first."""
    sizes = build_language(all_tasks("t-map"), "minimal").language.sizes()
    assert sorted(sizes.values()) == [1, 1, 10]


SEQUENCES = st.lists(st.integers(0, 4), min_size=1, max_size=6)


@settings(max_examples=250, deadline=None)
@given(SEQUENCES, SEQUENCES, st.lists(st.integers(0, 2), min_size=5, max_size=5))
def test_same_sentence_iff_a_warping_path_exists(
    u: list[int], v: list[int], word: list[int]
) -> None:
    clause = warping_clause(u, v, word)
    assert (clause is not None) == (sentence(word[s] for s in u) == sentence(word[s] for s in v))
    if clause is not None:
        assert all(word[a] == word[b] and a != b for a, b in clause)
        assert len(clause) <= fewest_cells(tuple(u), tuple(v), word)


@given(st.lists(SEQUENCES, min_size=2, max_size=3), st.integers(0, 4))
def test_short_clauses_are_those_of_all_warping_paths(plans: list[list[int]], most: int) -> None:
    ways = [set(pairs_of_paths(plans[0], other)) for other in plans[1:]]
    every = {frozenset().union(*paths) for paths in product(*ways)}
    assert short_clauses(plans, most) == {clause for clause in every if len(clause) <= most}


def pairs_of_paths(u: list[int], v: list[int]) -> Iterator[frozenset[Pair]]:
    """The non-identical pairs of each warping path."""
    cell = frozenset([pair(u[0], v[0])] if u[0] != v[0] else ())
    if len(u) == len(v) == 1:
        yield cell
    for after in ((u[1:], v[1:]), (u[1:], v), (u, v[1:])):
        if all(after):
            yield from (cell | rest for rest in pairs_of_paths(*after))


def fewest_cells(u: tuple[int, ...], v: tuple[int, ...], word: list[int]) -> int:
    """Non-identical cells of the best warping path, by trying all of them."""

    def best(i: int, j: int) -> int:
        if word[u[i]] != word[v[j]]:
            return 10**9
        here = int(u[i] != v[j])
        steps = [(i - a, j - b) for a, b in ((1, 0), (0, 1), (1, 1)) if i >= a and j >= b]
        return here + (min(best(*step) for step in steps) if steps else 0)

    return best(len(u) - 1, len(v) - 1)


def test_separation_clause_of_three_plans() -> None:
    assert separation_clause([[0, 1, 3], [0, 2, 3], [0, 4, 3]], [0] * 5) == frozenset(
        {(1, 2), (1, 4)}
    )
    assert separation_clause([[0, 1, 3], [0, 2, 3], [0, 4, 3]], [0, 1, 0, 0, 1]) is None


GROUPS: tuple[list[list[int]], ...] = (
    [],
    [[0, 1, 2, 4, 3]],
    [[1, 2, 3, 4, 0], [2, 3, 4, 0, 1], [3, 4, 0, 1, 2], [4, 0, 1, 2, 3]],
    [list(p) for p in permutations(range(5)) if p != (0, 1, 2, 3, 4)],
)


@settings(max_examples=100, deadline=None)
@given(
    st.integers(1, 3),
    st.sampled_from(GROUPS),
    st.lists(st.sets(st.tuples(st.integers(0, 4), st.integers(0, 4)), min_size=1), max_size=4),
    st.permutations(list(combinations(range(5), 2))),
)
def test_one_of_symmetric_partitions(
    size: int,
    group: list[list[int]],
    drawn: list[set[tuple[int, int]]],
    pairs: list[tuple[int, int]],
) -> None:
    """If all images of a clause are clauses, a partition is left, the first of its images."""
    clauses = {
        frozenset(pair(s[a], s[b]) for a, b in clause if a != b)
        for clause in drawn
        for s in [range(5), *group]
    }
    plain, leading = PartitionProblem(range(5), size), PartitionProblem(range(5), size)
    for problem in (plain, leading):
        for clause in sorted(clauses, key=sorted):
            problem.separate_one(clause)
    leading.add_lex_leaders(group, pairs)
    found = leading.solve()
    assert (found is None) == (plain.solve() is None)
    for problem in (plain, leading):
        problem.close()
    if found is not None:
        images = [[found[s[a]] != found[s[b]] for a, b in pairs] for s in [range(5), *group]]
        assert images[0] == max(images)


@pytest.mark.parametrize(
    ("robots", "most", "examples"),
    [
        (2, 40, 70),
        (3, 14, 35),
        pytest.param(2, 40, 280, marks=pytest.mark.slow),
        pytest.param(3, 14, 140, marks=pytest.mark.slow),
    ],
)
def test_minimal_equals_exhaustive(robots: int, most: int, examples: int) -> None:
    """On random models with two and three robots, all pairs of states or one partial goal."""
    sizes: Counter[int] = Counter()
    for _, candidates in islice(small_candidates(robots, states=8, plans=most), examples):
        brute, exact, greedy = (
            build_language(candidates, method).language.guarantee
            for method in ("exhaustive", "minimal", "greedy")
        )
        assert exact.size == exact.lower_bound == brute.size <= greedy.size
        sizes[brute.size] += 1
    # Worth something only if more than one word is needed now and then.
    assert examples - sizes[1] >= examples // (12 if robots == 2 else 18), sizes
