# SPDX-License-Identifier: GPL-3.0-or-later
"""Words of abstract states: against all partitions, and nothing is proved by not finding one."""

from __future__ import annotations

import sys
from collections import Counter
from dataclasses import replace
from functools import partial
from itertools import product
from random import Random

import numpy as np
import pytest

from coordlang.commands.building import build_language
from coordlang.language.candidates import Candidates
from coordlang.language.partition import Partition
from coordlang.symmetry.group import SymmetryGroup, symmetry_group
from coordlang.verification.by_definition import verify
from coordlang.vocabulary.abstract_words import AbstractSearch
from coordlang.vocabulary.abstractions import abstractions
from coordlang.vocabulary.equivariant import EquivariantSearch
from coordlang.vocabulary.failing_tuples import agree
from coordlang.vocabulary.from_above import SearchFromAbove, Start
from coordlang.vocabulary.job import Assignment
from coordlang.vocabulary.problems_by_size import SolverBudget
from coordlang.vocabulary.recent_tuples import RecentTuples
from coordlang.vocabulary.refuter import Refuter
from tests.support.domains import all_tasks
from tests.support.random_spaces import random_spaces


def states_of(candidates: Candidates) -> list[int]:
    return sorted({s for space in candidates.spaces for s in space.state.tolist()})


def refuter_of(candidates: Candidates, group: SymmetryGroup | None = None) -> Refuter:
    group = symmetry_group(candidates) if group is None else group
    return Refuter(candidates.spaces, group, len(candidates.rows), 0)


def is_language(found: Assignment, candidates: Candidates) -> bool:
    return verify(Partition.of_states(candidates.rows, found), candidates.spaces).holds


@pytest.mark.parametrize(
    ("robots", "seeds"),
    [
        (3, range(15)),
        *(pytest.param(r, range(100), marks=pytest.mark.thorough) for r in (2, 3)),
    ],
)
def test_random_abstractions_of_random_models(robots: int, seeds: range) -> None:
    """Words are found iff some words of the abstract states are a language by definition."""
    answers: Counter[bool] = Counter()
    for candidates, _ in random_spaces(seeds, robots):
        states = states_of(candidates)
        random = Random(len(states))
        if not 4 <= len(states) <= 8:
            continue
        refuter = refuter_of(candidates)
        number = len(states) - random.randint(1, 2)
        classes = np.zeros(len(candidates.rows), np.int64)
        classes[random.sample(states, len(states))] = np.arange(len(states)) % number
        for size in (2, 3, 4) if len(refuter.pool) else ():
            least = any(
                is_language({s: words[classes[s]] for s in states}, candidates)
                for words in product(range(size), repeat=number)
                if all(word <= max(words[:n], default=-1) + 1 for n, word in enumerate(words))
            )
            search = AbstractSearch([classes], states, refuter, 0)
            found = search.find(size)
            assert (found is not None) == least
            assert bool(search.left(size)) == least
            assert found is None or is_language(found, candidates)
            assert found is None or len({(classes[s], w) for s, w in found.items()}) <= number
            answers[least] += 1
    assert min(answers[True], answers[False]) >= 1, answers


@pytest.mark.parametrize(
    ("stem", "words", "abstract"),
    [("gwb1-2x4", 3, 8), ("gwb3-3x4", 3, 10), ("gw2-2x3", 5, 17), ("gw3-2x4", 6, 32)],
)
def test_languages_that_say_little(stem: str, words: int, abstract: int) -> None:
    """On rings it is enough to say where one robot is, on grids a little more.

    With the numbers of words that proofs give; at most so many abstract states are needed.
    """
    candidates = all_tasks("grid", stem)
    states = states_of(candidates)
    few = [a for a in abstractions(candidates, states) if len(set(a.tolist())) <= abstract]
    search = AbstractSearch(few, states, refuter_of(candidates), 0)
    assert search.find(words - 1) is None
    found = next((f for _ in range(6) if (f := search.find(words)) is not None), None)
    assert found is not None
    assert len(set(found.values())) == words
    assert is_language(found, candidates)
    assert any(len({(classes[s], w) for s, w in found.items()}) <= abstract for classes in few)


def test_the_same_seed_finds_the_same() -> None:
    candidates = all_tasks("grid", "gw2-2x3")
    states = states_of(candidates)
    every = abstractions(candidates, states)

    def found() -> Assignment | None:
        return AbstractSearch(every, states, refuter_of(candidates), 3).find(6)

    assert found() == found() is not None


@pytest.mark.parametrize("finds", ["nothing", "all words"])
def test_what_is_not_found_raises_no_bound(monkeypatch: pytest.MonkeyPatch, finds: str) -> None:
    """Whatever this search says, least numbers and bounds stay the same."""
    find = AbstractSearch.find

    def told(search: AbstractSearch, size: int) -> Assignment | None:
        return None if finds == "nothing" else find(search, size)

    module = sys.modules["coordlang.vocabulary.minimal"]
    monkeypatch.setattr(module, "SolverBudget", partial(SolverBudget, rounds=1))
    monkeypatch.setattr(AbstractSearch, "find", told)
    built = build_language(all_tasks("grid", "gw2-2x3"), "minimal")
    guarantee = built.language.guarantee
    assert (guarantee.size, guarantee.lower_bound) == (5, 5)
    assert built.verdict.holds
    assert (built.figures["abstract_rounds"] > 0) == (finds == "all words")


def test_others_are_asked_where_no_abstraction_is_left(monkeypatch: pytest.MonkeyPatch) -> None:
    """And not where abstractions have given an answer."""
    candidates = all_tasks("grid", "gw1-2x2")
    asked: list[int] = []
    monkeypatch.setattr(EquivariantSearch, "find", lambda self, size, *effort: asked.append(size))
    refuter, states = refuter_of(candidates), states_of(candidates)
    known = Start(states, refuter, abstractions(candidates, states), 0)
    told: list[str] = []
    above = SearchFromAbove(known, told.append)
    assert above.find(12, symmetric=True) is not None
    assert not asked
    told.clear()
    assert above.find(2, symmetric=True) is None
    assert asked == [2, 2]
    assert told == [
        "words of abstract states: trying 2",
        "symmetric words of abstract states: trying 2",
        "symmetric words: trying 2",
    ]
    without = SearchFromAbove(replace(known, abstractions=[]))
    assert without.find(3, symmetric=True) is None
    assert asked == [2, 2, 3, 3]
    # The last number is left to the search from below, but for words of abstract states.
    del told[2:]
    above.find(2, symmetric=False)
    assert told[2:] == told[:2]
    assert asked == [2, 2, 3, 3, 2]


@pytest.mark.parametrize("least", [1, 20])
def test_recent_tuples_are_some_of_those_that_agree(least: int) -> None:
    """None iff the partition is a language for the tuples known; each agrees, none twice."""
    candidates = all_tasks("grid", "gw2-2x3")
    refuter, random = refuter_of(candidates), np.random.default_rng(0)
    recent = RecentTuples(refuter, 50, least)
    sizes: Counter[bool] = Counter()
    for words in (1, 2, 3, 4, 6, 9, 14, 30) * 4:
        word = random.integers(words, size=len(candidates.rows))
        found = recent.agreeing(word)
        every = refuter.agreeing(word)
        assert bool(found) == bool(every)
        here = {(f.length, f.to.tobytes(), row) for f in found for row in f.rows.tolist()}
        assert len(here) == sum(len(f.rows) for f in found)
        assert here <= {(f.length, f.to.tobytes(), row) for f in every for row in f.rows.tolist()}
        for some in found:
            sequences = refuter.pool.sequences(some, some.rows)
            assert agree(word, sequences.transpose(2, 1, 0)).all()
        sizes[len(here) < sum(len(f.rows) for f in every)] += 1
    assert min(sizes[True], sizes[False]) >= 1, sizes
