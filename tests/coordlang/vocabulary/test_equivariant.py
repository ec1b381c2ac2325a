# SPDX-License-Identifier: GPL-3.0-or-later
"""Equivariant words: languages are found, and nothing is ever proved by not finding one."""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Sequence
from itertools import product
from random import Random

import numpy as np
import pytest

from coordlang.commands.building import build_language
from coordlang.language.candidates import Candidates
from coordlang.language.partition import Partition
from coordlang.symmetry.group import SymmetryGroup, symmetry_group
from coordlang.symmetry.subgroups import group_table
from coordlang.verification.by_definition import verify
from coordlang.vocabulary.abstractions import abstractions
from coordlang.vocabulary.equivariant import EquivariantSearch, _Kind, _Kinds, _Orbits
from coordlang.vocabulary.job import Assignment
from coordlang.vocabulary.orbit_words import OrbitWords
from coordlang.vocabulary.refuter import Refuter
from planners.joint.tables import Ints
from tests.support.domains import all_tasks


def searching(candidates: Candidates, group: SymmetryGroup | None = None) -> EquivariantSearch:
    group = symmetry_group(candidates) if group is None else group
    rows = len(candidates.rows)
    refuter = Refuter(candidates.spaces, group, rows, 0)
    states = sorted({s for space in candidates.spaces for s in space.state.tolist()})
    return EquivariantSearch(states, refuter, 0)


def is_language(found: Assignment, candidates: Candidates) -> bool:
    return verify(Partition.of_states(candidates.rows, found), candidates.spaces).holds


@pytest.mark.parametrize(
    ("folder", "stem", "words"),
    [
        ("three-cells", "problem", 3),
        ("t-map", "problem", 3),
        ("grid", "gw1-2x2", 3),
        ("grid", "gw2-2x3", 5),
    ],
)
def test_languages_are_found_and_fewer_words_are_not(folder: str, stem: str, words: int) -> None:
    """With the numbers of words that brute force and proofs give."""
    candidates = all_tasks(folder, stem)
    search = searching(candidates)
    assert search.find(words - 1, 1_000) is None
    for size in (words + 2, words + 1, words):
        found = next((f for _ in range(6) if (f := search.find(size, 1_000)) is not None), None)
        if found is not None:
            assert len(set(found.values())) <= size
            assert is_language(found, candidates)
    assert found is not None or words == 5


def test_what_is_found_is_equivariant() -> None:
    """Some symmetry other than the identity takes words to words."""
    candidates = all_tasks("grid", "gw1-2x2")
    group = symmetry_group(candidates)
    found = searching(candidates).find(4, 1_000)
    assert found is not None

    def keeps_words(to: list[int]) -> bool:
        return len({(found[s], found[to[s]]) for s in found}) == len(set(found.values()))

    assert any(map(keeps_words, group.permutations))


def test_words_of_abstract_states_are_symmetric_too() -> None:
    """What is found with abstractions is what one of them decides, and some symmetry keeps."""
    candidates = all_tasks("grid", "gw2-2x3")
    group = symmetry_group(candidates)
    search = searching(candidates, group)
    every = abstractions(candidates, search._states)
    found = next(f for _ in range(6) if (f := search.find(6, 1_000, every)) is not None)
    assert is_language(found, candidates)
    words = set(found.values())
    decided = [a for a in every if len({(a[s], w) for s, w in found.items()}) == _values(a, found)]
    assert decided
    images = [{(found[s], found[to[s]]) for s in found} for to in group.permutations]
    assert any(len(image) == len(words) for image in images)
    assert search.find(4, 1_000, every) is None
    # Those that are left out, and those of refuted kinds, are passed over.
    assert search.find(5, 1_000, every[:1]) is None
    rounds = search.rounds
    assert search.find(5, 1_000, []) is None
    assert search.rounds == rounds


def _values(abstract: Ints, found: Assignment) -> int:
    return len({int(abstract[s]) for s in found})


@pytest.mark.parametrize("seed", range(10))
def test_partitions_of_a_kind_are_found_iff_there_are_some(seed: int) -> None:
    """Under growing clauses and their images: against all partitions of six states."""
    random = Random(seed)
    one, other = np.array([1, 0, 3, 2, 4, 5]), np.array([0, 1, 2, 3, 5, 4])
    group = group_table([np.arange(6), one, other, one[other]])
    subgroups = group.subgroups(frozenset(range(4)), 10)
    actions = [action for h in subgroups for action in group.word_actions(h, 3, 10)]
    answers = Counter[bool]()
    for action in actions:
        kind = OrbitWords.of(range(6), group, action, 3)
        if kind is None:
            continue
        left = {
            tuple(kind.partition(np.array(choice)).tolist())
            for choice in product(*(range(len(words)) for words in kind.words))
        }
        problem = _Orbits.of(kind, [group.elements[h] for h in action.subgroup])
        for _ in range(4):
            pairs = [[random.sample(range(6), 2) for _ in range(2)] for _ in range(2)]
            codes = [[min(pair) * 6 + max(pair) for pair in clause] for clause in pairs]
            images = group.right_cosets(frozenset(action.words))
            problem.separate_one_of_each(np.array([[*row, -1] for row in codes]), images)
            left = {
                word
                for word in left
                if all(
                    any(word[to[a]] != word[to[b]] for a, b in clause)
                    for to in group.elements
                    for clause in pairs
                )
            }
            found = problem.solve(10_000)
            assert (found is not None) == bool(left)
            assert found is None or tuple(found[state] for state in range(6)) in left
            answers[bool(left)] += 1
        problem.close()
    assert min(answers[True], answers[False]) >= 3, answers


def test_a_few_kinds_are_looked_at_to_their_end() -> None:
    """At first all alike; then each has half of what one had that used all of it up."""
    kinds = [_Kind(group_table([np.arange(3)]).cyclic_action(0, (0, 1))) for _ in range(4)]
    looked_at = _Kinds([*kinds], deepens=True)
    rounds: list[list[int]] = []
    for _ in range(3):
        rounds.append([])
        while looked_at.open:
            kind = looked_at.open.pop(0)
            rounds[-1].append(looked_at.next_effort().rounds)
            if kind is not kinds[1]:  # it stops for its conflicts
                kind.rounds = rounds[-1][-1]
            looked_at.leave_undecided(kind)
        looked_at.begin_again()
    assert rounds == [[50] * 4, [800, 400, 400, 200], [1600, 800, 800, 400]]


def test_without_symmetries_all_partitions_are_looked_at() -> None:
    candidates = all_tasks("grid", "gw1-2x2")
    search = searching(candidates, SymmetryGroup(()))
    assert search.find(2, 1_000) is None
    found = search.find(3, 1_000)
    assert found is not None
    assert is_language(found, candidates)


@pytest.mark.parametrize("finds", ["nothing", "all words"])
def test_what_is_not_found_raises_no_bound(monkeypatch: pytest.MonkeyPatch, finds: str) -> None:
    """Whatever the search of equivariant words says, least numbers and bounds stay the same."""
    asked: list[int] = []
    find = EquivariantSearch.find

    def told(
        search: EquivariantSearch, size: int, rounds: int, abstractions: Sequence[Ints] = ()
    ) -> Assignment | None:
        asked.append(size)
        return None if finds == "nothing" else find(search, size, rounds, abstractions or None)

    monkeypatch.setattr(
        sys.modules["coordlang.vocabulary.equivariant"].EquivariantSearch, "find", told
    )
    built = build_language(all_tasks("grid", "gw2-2x3"), "minimal")
    guarantee = built.language.guarantee
    assert (guarantee.size, guarantee.lower_bound) == (5, 5)
    assert built.verdict.holds


def test_kinds_without_a_language_are_no_bound() -> None:
    """Under the whole group there is no language of three words for GW1, though there is one."""
    candidates = all_tasks("grid", "gw1-2x2")
    search = searching(candidates)
    search._subgroups = search._subgroups[:1]
    sizes = [size for size in range(3, 13) if search.find(size, 1_000) is None]
    assert sizes, "some kind has none"
    assert build_language(candidates, "minimal").language.guarantee.lower_bound == 3
    assert np.all(np.array(sizes) >= 3)
