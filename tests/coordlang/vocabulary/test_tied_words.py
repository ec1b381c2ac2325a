# SPDX-License-Identifier: GPL-3.0-or-later
"""Words of a kind: languages are found, and nothing is ever proved by not finding one."""

from __future__ import annotations

from collections import Counter
from contextlib import closing
from importlib import import_module
from itertools import combinations, product
from random import Random

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from coordlang.commands.building import build_language
from coordlang.language.candidates import Candidates
from coordlang.language.partition import Partition
from coordlang.language.warping import Pair
from coordlang.verification.by_definition import verify_candidates
from coordlang.vocabulary.abstractions import abstractions
from coordlang.vocabulary.job import Assignment, Job
from coordlang.vocabulary.loop import Budget, Languages
from coordlang.vocabulary.sat import PartitionProblem
from coordlang.vocabulary.tied_words import TiedWords, _Kind, _orbits, _Ties
from planners.parallel.workers import Workers
from tests.support.domains import all_tasks


def found(candidates: Candidates, size: int) -> tuple[Job, Languages, Assignment | None]:
    job = build_language(candidates, "greedy").job
    languages = Languages.of(job)
    search = TiedWords(job, languages)
    try:
        return job, languages, search.find(size, 60)
    finally:
        search.close()


PAIRS = list(combinations(range(6), 2))


@given(st.lists(st.lists(st.sampled_from(PAIRS), min_size=1, max_size=3), max_size=12))
def test_states_may_have_several_words_where_they_need_no_names(clauses: list[list[Pair]]) -> None:
    """A partition is found iff one is found where each has one word, and satisfies all clauses."""
    found = []
    for named in (True, False):
        with closing(PartitionProblem(range(6), 3, "minisat22", named=named)) as problem:
            for clause in clauses:
                problem.separate_one(clause)
            found.append(problem.solve())
    one, several = found
    assert (one is None) == (several is None)
    assert several is None or all(any(several[a] != several[b] for a, b in c) for c in clauses)


@pytest.mark.parametrize(("stem", "least"), [("gw1-2x2", 3), ("gw2-2x3", 5), ("gwb2-3x3", 3)])
def test_what_is_found_is_a_language_of_its_kind(stem: str, least: int) -> None:
    """Verified by definition; none is found with fewer words than are needed."""
    candidates = all_tasks("grid", stem)
    job, languages, language = found(candidates, least)
    assert language is not None
    partition = Partition.of_states(candidates.rows, language)
    assert verify_candidates(partition, candidates, Workers()).holds
    assert any(
        len({(language[s], other) for s, other in zip(job.states, tied, strict=True)})
        == len({*tied})
        for tied in (
            *(_orbits(np.array(to))[list(job.states)] for to in languages.known.group.permutations),
            *(a[list(job.states)] for a in abstractions(candidates, job.states)),
        )
    ), "the word does not change with the state's image, or an abstraction says the word"
    assert found(candidates, least - 1)[2] is None


@pytest.mark.parametrize("finds", ["nothing", "all words"])
def test_what_is_not_found_raises_no_bound(monkeypatch: pytest.MonkeyPatch, finds: str) -> None:
    """Whatever is found, least numbers and bounds stay the same."""
    find = TiedWords.find
    asked: list[int] = []

    def told(search: TiedWords, size: int, rounds: int) -> Assignment | None:
        asked.append(size)
        return None if finds == "nothing" else find(search, size, rounds)

    monkeypatch.setattr(TiedWords, "find", told)
    monkeypatch.setattr(Budget.__init__, "__defaults__", (1, 30_000))
    monkeypatch.setattr(import_module("coordlang.vocabulary.minimal"), "_SOON", Budget(1, 30_000))
    built = build_language(all_tasks("grid", "gw2-2x3"), "minimal")
    guarantee = built.language.guarantee
    assert (guarantee.size, guarantee.lower_bound) == (5, 5)
    assert built.verdict.holds
    assert asked


def test_partitions_of_a_kind_are_found_iff_there_are_some() -> None:
    """Under growing clauses and their images: against all partitions of six states."""
    random = Random(0)
    one, other = np.array([1, 0, 3, 2, 4, 5]), np.array([0, 1, 2, 3, 5, 4])
    images = [np.arange(6), one, other, one[other]]
    answers = Counter[bool]()
    for tied in [_orbits(one), _orbits(other), np.array([0, 1, 0, 1, 2, 3])] * 10:
        kind = _Kind(np.arange(6), _Ties(tied), 2, images, Budget())
        firsts = kind.first.tolist()
        left = [w for w in product(range(2), repeat=6) if w == tuple(w[s] for s in firsts)]
        for _ in range(4):
            clauses = [[random.sample(range(6), 2) for _ in range(2)] for _ in range(2)]
            codes = [[min(pair) * 6 + max(pair) for pair in clause] for clause in clauses]
            kind.ties.clauses.append(np.array([[*row, -1] for row in codes]))
            kind.require_clauses()
            left = [
                word
                for word in left
                if all(
                    any(word[to[a]] != word[to[b]] for a, b in clause)
                    for to in images
                    for clause in clauses
                )
            ]
            partition = kind.problem.solve(10_000)
            assert (partition is not None) == bool(left)
            assert partition is None or tuple(partition[first] for first in firsts) in left
            answers[bool(left)] += 1
        kind.problem.close()
    assert min(answers[True], answers[False]) >= 20, answers
