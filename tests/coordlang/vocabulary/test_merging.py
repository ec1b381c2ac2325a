# SPDX-License-Identifier: GPL-3.0-or-later
"""Merging from below, against merges of every two words, verified by definition."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from itertools import combinations, pairwise
from random import Random

import numpy as np
import pytest

from coordlang.language.candidates import Candidates
from coordlang.language.partition import Partition
from coordlang.symmetry.group import SymmetryGroup, symmetry_group
from coordlang.symmetry.subgroups import WordAction, group_table
from coordlang.verification.by_definition import verify
from coordlang.vocabulary.clause_table import ClauseTable
from coordlang.vocabulary.job import Assignment
from coordlang.vocabulary.merging import forbidden_merges, merged
from coordlang.vocabulary.orbit_words import OrbitWords
from coordlang.vocabulary.refuter import Refuter
from tests.support.domains import all_tasks
from tests.support.random_spaces import random_spaces


def is_language(word: Assignment, candidates: Candidates) -> bool:
    return verify(Partition.of_states(candidates.rows, word), candidates.spaces).holds


def merges(word: Assignment) -> Iterator[dict[int, int]]:
    """All partitions with two words made one."""
    for one, other in combinations(sorted(set(word.values())), 2):
        yield {state: one if own == other else own for state, own in word.items()}


def states_of(candidates: Candidates) -> list[int]:
    return sorted({s for space in candidates.spaces for s in space.state.tolist()})


def languages(candidates: Candidates, group: SymmetryGroup) -> list[dict[int, int]]:
    """Those that merging goes through, from all states apart."""
    states = states_of(candidates)
    refuter = Refuter(candidates.spaces, group, len(candidates.rows), 0)
    start = {state: 2 * number for number, state in enumerate(states)}
    return [start, *merged(start, states, refuter)]


def check(found: list[dict[int, int]], candidates: Candidates) -> int:
    """Each is a language and merges words of the one before, and the last can merge none."""
    for before, after in pairwise(found):
        assert len(set(after.values())) < len(set(before.values()))
        joined = {(before[state], after[state]) for state in before}
        assert len(joined) == len(set(before.values())), "whole words are merged"
    for word in found:
        assert is_language(word, candidates)
    last = found[-1]
    assert not any(is_language(coarser, candidates) for coarser in merges(last))
    assert set(last.values()) == set(range(len(set(last.values())))) or len(found) == 1
    return len(set(last.values()))


@pytest.mark.parametrize(
    ("robots", "seeds"),
    [
        (2, range(30)),
        *(pytest.param(robots, range(80), marks=pytest.mark.thorough) for robots in (2, 3, None)),
    ],
)
def test_random_models_merge_until_no_merge_is_left(robots: int | None, seeds: range) -> None:
    sizes: Counter[int] = Counter()
    for candidates, _ in random_spaces(seeds, robots):
        if len(candidates.spaces) == 1 and 2 <= len(states_of(candidates)) <= 16:
            start = {state: state for state in states_of(candidates)}
            if is_language(start, candidates):
                found = languages(candidates, SymmetryGroup(()))
                sizes[check(found, candidates)] += 1
    assert sum(count for size, count in sizes.items() if size > 1) >= 2, sizes


@pytest.mark.parametrize(
    ("folder", "stem", "most"),
    [("three-cells", "problem", 4), ("t-map", "problem", 5), ("grid", "gw1-2x2", 5)],
)
def test_shipped_worlds_merge_until_no_merge_is_left(folder: str, stem: str, most: int) -> None:
    candidates = all_tasks(folder, stem)
    assert 3 <= check(languages(candidates, symmetry_group(candidates)), candidates) <= most


def test_what_fails_once_fails_for_ever() -> None:
    """A partition coarser than one that is no language is none (Proposition 21)."""
    random, failing = Random(0), 0
    for robots, seeds in ((2, range(30)), (3, range(10))):
        for candidates, _ in random_spaces(seeds, robots):
            states = states_of(candidates)
            word = {state: random.randrange(max(2, len(states) // 2)) for state in states}
            if not is_language(word, candidates):
                coarser = list(merges(word))
                failing += len(coarser)
                assert not any(is_language(own, candidates) for own in coarser)
    assert failing >= 10


@pytest.mark.parametrize("seed", range(20))
def test_forbidden_merges_are_those_that_violate_a_clause(seed: int) -> None:
    random = Random(seed)
    group = group_table([np.arange(7)])
    kind = OrbitWords.of(range(7), group, WordAction({0: tuple(range(7))}), 7)
    assert kind is not None
    table = ClauseTable(kind, group.elements)
    word = [0, 1, 2, 3, *(random.randrange(4) for _ in range(3))]
    pairs = [(a, b) for a, b in combinations(range(7), 2)]
    clauses = [random.sample(pairs, 3) for _ in range(12)]
    clauses = [clause for clause in clauses if any(word[a] != word[b] for a, b in clause)]
    table.add(np.array([[a * 7 + b for a, b in clause] for clause in clauses]))
    forbidden = forbidden_merges(table, np.array(word))
    for one, other in combinations(range(4), 2):
        trial = [one if own == other else own for own in word]
        violated = any(all(trial[a] == trial[b] for a, b in clause) for clause in clauses)
        assert forbidden[one, other] == forbidden[other, one] == violated
