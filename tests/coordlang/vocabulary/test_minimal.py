# SPDX-License-Identifier: GPL-3.0-or-later
"""The fewest words, against brute force; and merging, until no merge is left."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from itertools import combinations, islice, pairwise, permutations
from random import Random

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from coordlang.commands.building import build_language
from coordlang.language.candidates import Candidates
from coordlang.language.warping import pair
from coordlang.language.words import Partition
from coordlang.symmetry.group import SymmetryGroup, symmetry_group
from coordlang.verification.by_definition import verify
from coordlang.vocabulary.failing_tuples import FailingTuples
from coordlang.vocabulary.job import Assignment
from coordlang.vocabulary.languages import Languages
from coordlang.vocabulary.merging import merged
from coordlang.vocabulary.sat import PartitionProblem
from tests.support import slow, thorough
from tests.support.candidates import small_candidates, states_of
from tests.support.domains import all_tasks
from tests.support.random_spaces import random_spaces
from tests.support.task_languages import built_for


@pytest.mark.parametrize(
    ("folder", "stem", "words"),
    [("grid-joint", "gw1-2x2", 3), ("grid", "gw2-2x3", 5), *thorough(("grid", "gwb2-3x3", 3))],
)
def test_known_minima(folder: str, stem: str, words: int) -> None:
    """More of them stand in the README files of the domains."""
    built = built_for(folder, stem)
    guarantee = built.language.guarantee
    assert (guarantee.size, guarantee.lower_bound, guarantee.proved_minimal) == (words, words, True)
    assert built.verdict.holds


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
    ("robots", "most", "examples"), [(2, 40, 70), (3, 14, 18), *slow((2, 40, 280), (3, 14, 140))]
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


# ---- merging


def is_language(word: Assignment, candidates: Candidates) -> bool:
    return verify(Partition.of_states(candidates.rows, word), candidates.spaces).holds


def merges(word: Assignment) -> Iterator[dict[int, int]]:
    """All partitions with two words made one."""
    for one, other in combinations(sorted(set(word.values())), 2):
        yield {state: one if own == other else own for state, own in word.items()}


def languages(candidates: Candidates, group: SymmetryGroup) -> list[dict[int, int]]:
    """Those that merging goes through, from all states apart."""
    states = states_of(candidates)
    languages = Languages(candidates.spaces, group, len(candidates.rows), 0)
    start = {state: 2 * number for number, state in enumerate(states)}
    found = [start]
    for language in merged(start, states, languages):
        if len(set(language.values())) < len(set(found[-1].values())):
            found.append(language)
    return found


def merges_of(found: list[dict[int, int]], candidates: Candidates) -> int:
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
    [(2, range(30)), *thorough((2, range(80)), (3, range(80)), (None, range(80)))],
)
def test_random_models_merge_until_no_merge_is_left(robots: int | None, seeds: range) -> None:
    sizes: Counter[int] = Counter()
    for candidates, _ in random_spaces(seeds, robots):
        if len(candidates.spaces) == 1 and 2 <= len(states_of(candidates)) <= 16:
            start = {state: state for state in states_of(candidates)}
            if is_language(start, candidates):
                found = languages(candidates, SymmetryGroup(()))
                sizes[merges_of(found, candidates)] += 1
    assert sum(count for size, count in sizes.items() if size > 1) >= 2, sizes


@pytest.mark.parametrize(
    ("folder", "stem", "most"),
    [("three-cells", "problem", 4), ("t-map", "problem", 5), ("grid", "gw1-2x2", 5)],
)
def test_shipped_worlds_merge_until_no_merge_is_left(folder: str, stem: str, most: int) -> None:
    candidates = all_tasks(folder, stem)
    assert 3 <= merges_of(languages(candidates, symmetry_group(candidates)), candidates) <= most


@pytest.mark.parametrize(("folder", "stem"), [("t-map", "problem"), *thorough(("grid", "gw1-2x2"))])
def test_walks_of_goals_up_to_symmetry_refute_what_is_no_language(folder: str, stem: str) -> None:
    """Nearly all states have words of their own: what little fails is at goals of any orbit."""
    candidates = all_tasks(folder, stem)
    group = symmetry_group(candidates)
    assert group.symmetries
    states = range(len(candidates.rows))
    languages = Languages(candidates.spaces, group, len(states), 0)
    random, answers = Random(1), Counter[bool]()
    for _ in range(40):
        word = list(states)
        for _ in range(random.randint(1, 3)):
            one, other = random.sample(states, 2)
            word = [word[other] if w == word[one] else w for w in word]
        partition = Partition.of_states(candidates.rows, dict(enumerate(word)))
        holds = verify(partition, candidates.spaces).holds
        languages.pool = FailingTuples(group, len(states))  # it knows nothing, and has to walk
        assert (not languages.violated(np.array(word))) == holds
        answers[holds] += 1
    assert min(answers.values()) >= 5, answers
