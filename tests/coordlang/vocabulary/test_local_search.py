# SPDX-License-Identifier: GPL-3.0-or-later
"""Local search: clause table, tabu search and races of kinds against their definitions."""

from __future__ import annotations

import sys
from collections import Counter
from functools import partial
from itertools import islice, product
from random import Random

import numpy as np
import pytest

from coordlang.commands.building import build_language
from coordlang.language.candidates import Candidates
from coordlang.language.partition import Partition
from coordlang.language.warping import Clause, pair
from coordlang.symmetry.group import SymmetryGroup, symmetry_group
from coordlang.symmetry.subgroups import GroupTable, WordAction, group_table
from coordlang.verification.by_definition import verify
from coordlang.vocabulary import from_above
from coordlang.vocabulary.abstract_words import AbstractSearch
from coordlang.vocabulary.clause_table import ClauseTable
from coordlang.vocabulary.equivariant import EquivariantSearch
from coordlang.vocabulary.job import Assignment
from coordlang.vocabulary.local_search import LocalSearch
from coordlang.vocabulary.orbit_words import OrbitWords
from coordlang.vocabulary.problems_by_size import SolverBudget
from coordlang.vocabulary.refuter import Refuter
from coordlang.vocabulary.tabu import TabuSearch
from planners.joint.tables import Ints
from tests.support.domains import all_tasks
from tests.support.random_spaces import random_spaces

#: Two mirrors of six states, a group of four.
MIRRORS = [np.array(to) for to in ([0, 1, 2, 3, 4, 5], [1, 0, 3, 2, 4, 5], [0, 1, 2, 3, 5, 4])]


def mirrors() -> GroupTable:
    return group_table([*MIRRORS, MIRRORS[1][MIRRORS[2]]])


def actions(group: GroupTable, size: int) -> list[WordAction]:
    every = frozenset(range(len(group.elements)))
    subgroups = group.subgroups(every, 10)
    return [action for h in subgroups for action in group.word_actions(h, size, 10)]


def everything(states: int, size: int, images: list[Ints] | None = None) -> OrbitWords:
    """The kind that holds all partitions."""
    group = group_table(images or [np.arange(states)])
    found = OrbitWords.of(range(states), group, WordAction({0: tuple(range(size))}), size)
    assert found is not None
    return found


def random_clauses(random: Random, states: int, number: int) -> list[Clause]:
    return [
        frozenset(pair(*random.sample(range(states), 2)) for _ in range(random.randint(1, 4)))
        for _ in range(number)
    ]


def codes(clauses: list[Clause], states: int) -> Ints:
    """As the pool of failing tuples gives them: with gaps and repetitions."""
    rows = [[a * states + b for a, b in sorted(clause)] for clause in clauses]
    return np.array([[-1, *row, *[-1] * (5 - len(row)), row[0]] for row in rows])


def is_language(word: Assignment, candidates: Candidates) -> bool:
    return verify(Partition.of_states(candidates.rows, word), candidates.spaces).holds


@pytest.mark.parametrize("tied", [None, [0, 1, 2, 3, 4, 4], [0, 1, 1, 0, 2, 3], [0, 0, 1, 2, 1, 3]])
@pytest.mark.parametrize("size", [1, 2, 3])
def test_choices_are_the_equivariant_partitions(size: int, tied: list[int] | None) -> None:
    """All of them, each once: ``f(h s) = rho(h) f(s)``, and tied states have one word."""
    group = mirrors()
    together = None if tied is None else np.array(tied)
    kinds = Counter[bool]()
    for action in actions(group, size):
        expected = {
            word
            for word in product(range(size), repeat=6)
            if all(
                word[to] == action.words[h][word[s]]
                for h in action.subgroup
                for s, to in enumerate(group.elements[h].tolist())
            )
        }
        if tied is not None:
            expected = {f for f in expected if len({*zip(tied, f, strict=True)}) == len(set(tied))}
        kind = OrbitWords.of(range(6), group, action, size, together)
        kinds[kind is None] += 1
        chosen: list[tuple[int, ...]] = []
        if kind is not None:
            choices = product(*(range(len(words)) for words in kind.words))
            chosen = [tuple(kind.partition(np.array(c)).tolist()) for c in choices]
        assert len(chosen) == len(set(chosen))
        assert set(chosen) == expected
    assert kinds[False]
    assert kinds[True] or size != 2 or tied is not None


@pytest.mark.parametrize("seed", range(20))
def test_the_table_holds_clauses_and_their_images(seed: int) -> None:
    """Each once; and it knows which clauses an orbit is in, and how many pairs are separated."""
    random = Random(seed)
    group = mirrors()
    kinds = [OrbitWords.of(range(6), group, action, 3) for action in actions(group, 3)]
    kind = random.choice([k for k in kinds if k is not None])
    table = ClauseTable(kind, group.elements)
    expected: set[Clause] = set()
    for _ in range(3):
        clauses = random_clauses(random, 6, random.randint(1, 12))
        images = {
            frozenset(pair(int(to[a]), int(to[b])) for a, b in clause)
            for to in group.elements
            for clause in clauses
        }
        assert table.add(codes(clauses, 6)) == len(images - expected)
        expected |= images
    held = [
        frozenset((a, b) for a, b in zip(first, second, strict=True) if a != b)
        for first, second in zip(table.first.tolist(), table.second.tolist(), strict=True)
    ][: len(table)]
    assert Counter(held) == Counter(expected)
    for orbit in range(len(kind.members)):
        pairs = [sum(orbit in (kind.orbit[a], kind.orbit[b]) for a, b in clause) for clause in held]
        of = dict(
            zip(table.clauses_of[orbit].tolist(), table.pairs_of[orbit].tolist(), strict=True)
        )
        assert of == {number: count for number, count in enumerate(pairs) if count}
    word = kind.partition(kind.random_choice(np.random.default_rng(seed)))
    apart = [sum(word[a] != word[b] for a, b in clause) for clause in held]
    assert table.separated(word).tolist() == apart
    assert table.separated(word, np.array([0, 2])).tolist() == [apart[0], apart[2]]


@pytest.mark.parametrize("seed", range(20))
def test_violations_are_those_of_every_clause(seed: int) -> None:
    """What a change would violate, and what is violated after changes, counted one by one."""
    random = Random(seed)
    group = mirrors()
    kinds = [OrbitWords.of(range(6), group, action, 3) for action in actions(group, 3)]
    kind = random.choice([k for k in kinds if k is not None])
    table = ClauseTable(kind, group.elements)
    clauses = random_clauses(random, 6, 12)
    table.add(codes(clauses, 6))
    rng = np.random.default_rng(seed)
    search = TabuSearch(table, kind.random_choice(rng), rng)

    def violated(choice: Ints) -> int:
        return int((table.separated(kind.partition(choice)) == 0).sum())

    for _ in range(10):
        fewest = search.run(1)
        assert search.word.tolist() == kind.partition(search.choice).tolist()
        assert len(search.violated) == violated(search.choice) == fewest
        for orbit, words in enumerate(kind.words):
            for choice, count in enumerate(search.violations(orbit).tolist()):
                changed = search.choice.copy()
                changed[orbit] = choice
                concerned = table.separated(kind.partition(changed), table.clauses_of[orbit])
                assert count == int((concerned == 0).sum())
            assert len(search.violations(orbit)) == len(words)


def test_tabu_search_finds_partitions_iff_there_are_some() -> None:
    """On small ones, where all partitions are tried."""
    answers: Counter[bool] = Counter()
    for seed in range(24):
        random, rng = Random(seed), np.random.default_rng(seed)
        kind = everything(6, 2 + seed % 2)
        table = ClauseTable(kind, [np.arange(6)])
        table.add(codes(random_clauses(random, 6, random.randint(4, 40)), 6))
        least = min(
            int((table.separated(np.array(word)) == 0).sum())
            for word in product(range(kind.size), repeat=6)
        )
        search = TabuSearch(table, kind.random_choice(rng), rng)
        assert search.run(400) == least
        answers[least == 0] += 1
    assert min(answers[True], answers[False]) >= 3, answers


def test_tabu_search_ends_where_nothing_can_be_changed() -> None:
    kind = everything(2, 1)
    table = ClauseTable(kind, [np.arange(2)])
    table.add(np.array([[1]]))
    search = TabuSearch(table, np.zeros(2, np.int64), np.random.default_rng(0))
    assert search.run(50) == 1
    assert search.moves == 1


def searching(candidates: Candidates, group: SymmetryGroup, seed: int) -> tuple[Refuter, list[int]]:
    refuter = Refuter(candidates.spaces, group, len(candidates.rows), seed)
    return refuter, sorted({s for space in candidates.spaces for s in space.state.tolist()})


@pytest.mark.parametrize(
    ("folder", "stem", "words"),
    [
        ("three-cells", "problem", 3),
        ("t-map", "problem", 3),
        ("grid", "gw1-2x2", 3),
        pytest.param("grid", "gw2-2x3", 5, marks=pytest.mark.thorough),
    ],
)
def test_languages_are_found_and_fewer_words_are_not(folder: str, stem: str, words: int) -> None:
    """With the numbers of words that brute force and proofs give; twice the same for a seed."""
    candidates = all_tasks(folder, stem)
    group = symmetry_group(candidates)
    twice = []
    for _ in range(2):
        refuter, states = searching(candidates, group, 1)
        search, kinds = LocalSearch(states, refuter, 1), EquivariantSearch(states, refuter, 0)
        assert search.find(words - 1, kinds.undecided(words - 1)) is None
        tries = (search.find(words, kinds.undecided(words)) for _ in range(8))
        found = next((f for f in tries if f is not None), None)
        assert found is not None
        assert len(set(found.values())) == words
        assert is_language(found, candidates)
        twice.append((found, search.rounds, search.moves))
    assert twice[0] == twice[1]


@pytest.mark.parametrize(
    ("robots", "seeds"),
    [
        (3, range(15)),
        *(pytest.param(r, range(100), marks=pytest.mark.thorough) for r in (2, 3)),
    ],
)
def test_random_models_without_symmetries(robots: int, seeds: range) -> None:
    """Languages by definition are found for the numbers of words for which brute force has some."""
    answers: Counter[bool] = Counter()
    for candidates, _ in random_spaces(seeds, robots):
        states = sorted({s for space in candidates.spaces for s in space.state.tolist()})
        if not 2 <= len(states) <= 8:
            continue
        refuter, _ = searching(candidates, SymmetryGroup(()), 0)
        for size in (1, 2) if len(refuter.pool) else ():
            least = any(
                is_language(dict(zip(states, word, strict=True)), candidates)
                for word in product(range(size), repeat=len(states))
            )
            found = LocalSearch(states, refuter, 0).find(size, [])
            assert (found is not None) == least
            assert found is None or is_language(found, candidates)
            answers[least] += 1
    assert min(answers[True], answers[False]) >= 1, answers


@pytest.mark.parametrize(
    "finds", ["nothing", pytest.param("all words", marks=pytest.mark.thorough)]
)
def test_what_is_not_found_raises_no_bound(monkeypatch: pytest.MonkeyPatch, finds: str) -> None:
    """Whatever local search says, least numbers and bounds stay the same."""
    asked: list[int] = []
    find = LocalSearch.find

    def told(search: LocalSearch, size: int, kinds: list[WordAction]) -> Assignment | None:
        asked.append(size)
        return None if finds == "nothing" else find(search, size, kinds)

    module = sys.modules["coordlang.vocabulary.minimal"]
    monkeypatch.setattr(from_above, "LOCAL_FROM", 0)
    monkeypatch.setattr(from_above, "_AHEAD", 0)
    monkeypatch.setattr(module, "SolverBudget", partial(SolverBudget, rounds=1))
    monkeypatch.setattr(AbstractSearch, "find", lambda self, size, *effort: None)
    monkeypatch.setattr(EquivariantSearch, "find", lambda self, size, *effort, **more: None)
    monkeypatch.setattr(LocalSearch, "find", told)
    built = build_language(all_tasks("grid", "gw2-2x3"), "minimal")
    guarantee = built.language.guarantee
    assert (guarantee.size, guarantee.lower_bound) == (5, 5)
    assert built.verdict.holds
    assert asked
    assert built.figures["local_moves"] == 0 or finds == "all words"


def test_words_of_what_is_found_are_merged(monkeypatch: pytest.MonkeyPatch) -> None:
    """After it is told as it was found, for time may be over."""
    candidates = all_tasks("grid", "gw2-2x3")
    refuter, states = searching(candidates, symmetry_group(candidates), 0)
    apart = {state: number for number, state in enumerate(states)}
    monkeypatch.setattr(from_above, "LOCAL_FROM", 0)
    monkeypatch.setattr(EquivariantSearch, "find", lambda self, size, *effort, **more: apart)
    search = from_above.SearchFromAbove(from_above.Start(states, refuter, [], 0))
    answers = search.turn(2, len(states) + 1)
    told = list(islice(([found[state] for state in states] for found in answers), 4))
    assert told[0] == list(range(len(states)))
    sizes = [len(set(words)) for words in told]
    assert sizes == sorted(set(sizes), reverse=True)
    assert all(is_language(dict(zip(states, words, strict=True)), candidates) for words in told)


def test_of_many_kinds_some_race() -> None:
    """Evenly over all, and all partitions always."""
    candidates = all_tasks("grid", "gw1-2x2")
    refuter, states = searching(candidates, symmetry_group(candidates), 0)
    everything = WordAction({0: tuple(range(3))})
    for number, racing in ((0, 1), (5, 6), (64, 65), (65, 34), (1_000, 64)):
        runners = list(LocalSearch(states, refuter, 0)._runners(3, [everything] * number))
        assert len(runners) == racing
