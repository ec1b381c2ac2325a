# SPDX-License-Identifier: GPL-3.0-or-later
"""Words of a kind: languages are found, nothing is proved by finding none; how kinds are made."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Hashable
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
from coordlang.language.warping import Pair
from coordlang.language.words import Partition
from coordlang.symmetry.group import orbits, symmetry_group
from coordlang.verification.by_definition import verify_candidates
from coordlang.vocabulary.abstractions import abstractions, up_to_symmetry
from coordlang.vocabulary.first_differences import first_differences
from coordlang.vocabulary.job import Assignment, Job
from coordlang.vocabulary.languages import Languages
from coordlang.vocabulary.loop import Budget
from coordlang.vocabulary.sat import PartitionProblem
from coordlang.vocabulary.tied_words import TiedWords, _Kind, classes_by_facts
from planners.joint.tables import Ints
from planners.parallel.workers import Workers
from planners.pddl.model_options import ModelOptions
from tests.support import thorough
from tests.support.candidates import failing, is_language, small_candidates
from tests.support.domains import all_tasks, own_task


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


@pytest.mark.parametrize(("stem", "least"), [("gw1-2x2", 3), ("gw2-2x3", 5)])
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
            *(orbits([np.array(to)])[list(job.states)] for to in languages.group.permutations),
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
    for tied in [orbits([one]), orbits([other]), np.array([0, 1, 0, 1, 2, 3])] * 10:
        kind = _Kind(np.arange(6), tied, 2, images, Budget())
        firsts = kind.first.tolist()
        left = [w for w in product(range(2), repeat=6) if w == tuple(w[s] for s in firsts)]
        for _ in range(4):
            clauses = [[random.sample(range(6), 2) for _ in range(2)] for _ in range(2)]
            codes = [[min(pair) * 6 + max(pair) for pair in clause] for clause in clauses]
            kind.require(np.array([[*row, -1] for row in codes]))
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


# ---- abstractions of states, against what their texts say

Cell = tuple[int, int]


def places(candidates: Candidates) -> list[list[Cell]]:
    """Where each robot is, in each state."""
    keys = [candidates.model.codec.key(row) for row in candidates.rows]
    at = [sorted(re.findall(r"\(at (r\d) c(\d+)-(\d+)\)", key)) for key in keys]
    return [[(int(row), int(column)) for _, row, column in state] for state in at]


def partition(labels: list[Hashable]) -> bytes:
    """The partition that labels make, as numbers in order of meeting."""
    number = {label: n for n, label in enumerate(dict.fromkeys(labels))}
    return np.array([number[label] for label in labels]).tobytes()


def as_labels(classes: Ints) -> bytes:
    return partition(classes.tolist())


def colour(cell: Cell) -> int:
    return sum(cell) % 2


def beside(one: Cell, other: Cell) -> bool:
    return abs(one[0] - other[0]) + abs(one[1] - other[1]) <= 1


@pytest.mark.parametrize(
    "says",
    [
        lambda a, b: a,
        lambda a, b: (a, colour(b)),
        lambda a, b: (a, colour(b), beside(a, b)),
        lambda a, b: (a, colour(b), b if beside(a, b) else None),
    ],
)
def test_what_abstractions_of_a_grid_say(says: Callable[[Cell, Cell], Hashable]) -> None:
    """Of two robots on 3x3 cells, up to the robots' names."""
    candidates = all_tasks("grid", "gw4-3x3")
    found = {as_labels(a) for a in abstractions(candidates, range(len(candidates.rows)))}
    assert partition([says(a, b) for a, b in places(candidates)]) in found
    assert partition([says(b, a) for a, b in places(candidates)]) in found


def test_of_abstractions_that_look_alike_one_is_left() -> None:
    """Where robot 1 is, or where robot 2 is; and each that is left is no image of another."""
    candidates = all_tasks("grid", "gw2-2x3")
    every = abstractions(candidates, range(len(candidates.rows)))
    images = [np.array(to) for to in symmetry_group(candidates).permutations]
    images = [np.arange(len(candidates.rows)), *images]
    left = up_to_symmetry(every, images)
    assert len(left) < len(every)
    for number, classes in enumerate(left):
        mine = {as_labels(classes[to]) for to in images}
        assert not any(as_labels(other) in mine for other in left[number + 1 :])
    for classes in every:
        assert any(as_labels(classes) in {as_labels(one[to]) for to in images} for one in left)


# ---- classes that a few facts decide: by hand, and against listing


def classes(candidates: Candidates) -> list[Ints]:
    """All of them, coarse ones first."""
    found = first_differences(candidates.spaces, most=0)
    languages = Languages.of(Job(candidates, tuple(found.states.tolist()), found))
    return list(classes_by_facts(candidates, languages))


def test_one_fact_decides_who_goes_round() -> None:
    """Two robots change places on three cells: whether robot 1 is in the third one is enough."""
    candidates = own_task("three-cells")
    space, model = candidates.spaces[0], candidates.model
    first = classes(candidates)[0]
    in_third = {
        state: "(at r1 c)" in model.codec.key(candidates.rows[state])
        for state in space.state.tolist()
    }
    said = {
        state: (steps, in_third[state])
        for state, steps in zip(space.state.tolist(), space.layer.tolist(), strict=True)
    }
    assert len({*said.values()}) == len({int(first[state]) for state in said})
    assert len({(int(first[state]), word) for state, word in said.items()}) == len({*said.values()})


@pytest.mark.parametrize(
    ("robots", "separable", "models"), [(2, False, 6), (3, False, 5), *thorough((2, True, 3))]
)
def test_each_class_a_word_is_a_language(robots: int, separable: bool, models: int) -> None:
    """Some facts suffice iff all facts do, and then each choice that is told is a language."""
    answers: Counter[bool] = Counter()
    for seed, candidates in small_candidates(
        robots, states=9, plans=60, tasks=1, separable=separable, requires=True
    ):
        found, bad = classes(candidates), failing(candidates)
        assert all(is_language(dict(enumerate(word.tolist())), bad) for word in found), seed
        sizes = [len(np.unique(word)) for word in found]
        assert sizes == sorted(sizes)
        rows = candidates.rows[:, : candidates.model.codec.fact_blocks]
        _, alone = np.unique(rows, axis=0, return_inverse=True)
        suffice = is_language(dict(enumerate(alone.reshape(-1).tolist())), bad)
        assert bool(found) == suffice, seed
        answers[suffice] += 1
        if sum(answers.values()) == models:
            break
    assert answers[separable]


def test_states_that_are_met_at_several_steps_have_no_classes() -> None:
    options = ModelOptions(slack=1)
    assert not classes(own_task("three-cells", options=options))
