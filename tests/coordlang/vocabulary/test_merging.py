# SPDX-License-Identifier: GPL-3.0-or-later
"""Merging from below, against merges of every two words, verified by definition."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from itertools import combinations, pairwise

import pytest

from coordlang.language.candidates import Candidates
from coordlang.language.partition import Partition
from coordlang.symmetry.group import SymmetryGroup, symmetry_group
from coordlang.verification.by_definition import verify
from coordlang.vocabulary.job import Assignment
from coordlang.vocabulary.merging import merged
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
    found = [start]
    for language in merged(start, states, refuter):
        if len(set(language.values())) < len(set(found[-1].values())):
            found.append(language)
    return found


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
