# SPDX-License-Identifier: GPL-3.0-or-later
"""Learned features: the simplest that suffice, verified, refuted where they do not; proved families."""

from __future__ import annotations

import re
from collections.abc import Sequence
from functools import cache
from itertools import combinations
from random import Random
from typing import Any

import families
import numpy as np
import pytest

from coordlang.language.candidates import all_pairs
from coordlang.language.words import Partition
from coordlang.lifted.features import Feature
from coordlang.lifted.language import vectors
from coordlang.lifted.learning import Instance, Learned, learn, simplest_hitting
from coordlang.lifted.pool import pool_of
from coordlang.verification.by_definition import verify
from coordlang.vocabulary import sat
from coordlang.vocabulary.exhaustive import partitions
from planners.joint.tables import Ints
from planners.pddl import parse_problem, read_domain
from planners.pddl.sexpr import Source
from planners.search.sat import solve_slice
from tests.support.domains import DOMAINS, all_tasks


def test_the_lightest_members_that_meet_all_sets() -> None:
    choice = Random(3)
    for _ in range(60):
        weights = [choice.randint(1, 5) for _ in range(choice.randint(1, 7))]
        members = range(len(weights))
        sets = [
            frozenset(choice.sample(members, choice.randint(1, len(weights))))
            for _ in range(choice.randint(0, 6))
        ]
        tables = [np.array([k in one for k in members]) for one in sets]
        for known in range(len(sets) + 1):
            found = simplest_hitting(tables[:known], np.array(weights))
            least = min(
                sum(weights[k] for k in some)
                for size in range(len(weights) + 1)
                for some in combinations(range(len(weights)), size)
                if all(one & set(some) for one in sets[:known])
            )
            assert all(one & set(found) for one in sets[:known])
            assert sum(weights[k] for k in found) == least


def test_signals_are_heard_between_slices_of_the_search_for_them(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Else one call of the solver may take minutes, deaf to time limits and interrupts."""
    choice, answers = Random(3), []

    def noted(*arguments: Any) -> bool | None:
        answers.append(solve_slice(*arguments))
        return answers[-1]

    monkeypatch.setattr(sat, "solve_slice", noted)
    monkeypatch.setattr(sat, "_SLICE", 1)
    tables = [np.isin(np.arange(20), choice.sample(range(20), 4)) for _ in range(30)]
    found = simplest_hitting(tables, np.ones(20, np.int64))
    assert all(table[found].any() for table in tables)
    assert {*answers} == {None, False, True}


@pytest.mark.thorough
def test_the_simplest_features_of_the_smallest_grid() -> None:
    """Against all sets of features, each verified by definition."""
    own = instance("grid", "gw1-2x2")
    learned = learn([own], complexity=4)
    pool = pool_of([own.states], 4).features
    least = min(
        sum(feature.complexity for feature in some)
        for size in range(3)
        for some in combinations(pool, size)
        if holds(own, some)
    )
    assert sum(feature.complexity for feature in learned.features) == least
    assert holds(own, learned.features)
    ((states, tasks, words),) = learned.sizes
    assert (states, tasks, words) == (12, 132, len(learned.values))


def holds(own: Instance, chosen: Sequence[Feature]) -> bool:
    _, classes = np.unique(vectors(chosen, own.states), axis=0, return_inverse=True)
    return holds_by_words(own, classes.reshape(-1))


def holds_by_words(own: Instance, words: Ints) -> bool:
    names = [f"w{k}" for k in range(int(words.max()) + 1)]
    partition = Partition.of_table(names, own.candidates.rows, words)
    return verify(partition, own.candidates.spaces).holds


@cache
def instance(folder: str, stem: str) -> Instance:
    return Instance(all_tasks(folder, stem))


def test_what_is_held_back_is_learned_from_where_it_refutes() -> None:
    """What suffices on 2x2 does not on 2x3."""
    alone = learn([instance("grid", "gw1-2x2")])
    assert not holds(instance("grid", "gw2-2x3"), alone.features)
    both = learn([instance("grid", "gw1-2x2")], [instance("grid", "gw2-2x3")])
    assert holds(instance("grid", "gw2-2x3"), both.features)
    assert holds(instance("grid", "gw1-2x2"), both.features)
    assert both.rounds > alone.rounds


# Fewer words


@pytest.mark.thorough
def test_the_fewest_words_over_classes() -> None:
    """Against all partitions of the classes, on two problems at once."""
    known = [instance("grid", "gw1-2x2"), instance("t-map", "problem")]
    learned = learn(known, complexity=6, prefer="features")
    every = [vectors(learned.features, own.states) for own in known]
    table, number = np.unique(np.concatenate(every), axis=0, return_inverse=True)
    assert learned.proved
    classes = np.split(number.reshape(-1), [len(every[0])])
    least = next(
        size
        for size in range(1, len(table) + 1)
        for words in partitions(len(table), size)
        if all(
            holds_by_words(one, np.array(words, np.int64)[own])
            for one, own in zip(known, classes, strict=True)
        )
    )
    assert len(learned.words) == least < len(table)


def test_words_may_come_first() -> None:
    """Other features than the simplest ones may do with fewer words; never with more."""
    known = [instance("t-map", "problem")]
    simple = learn(known, complexity=6, prefer="features")
    few = learn(known, complexity=6, prefer="words")
    sizes = [len(learned.words) for learned in (simple, few)]
    assert sizes[1] <= sizes[0]
    assert holds_by_words(known[0], words_in(known[0], few))


def words_in(own: Instance, learned: Learned) -> Ints:
    values = map(tuple, vectors(learned.features, own.states).tolist())
    return np.array([learned.words.index(learned.values[vector]) for vector in values])


@pytest.mark.thorough
def test_landmarks_where_nothing_else_suffices() -> None:
    """Round tracks: places are alike but for their names, which two tracks share in part."""
    known = [track(3), track(4)]
    learned = learn(known)
    assert any(re.search(r"\broom[0-9]", str(feature)) for feature in learned.features)
    for own in known:
        assert holds_by_words(own, words_in(own, learned))


def track(rooms: int) -> Instance:
    domain = read_domain(DOMAINS / "push-box" / "domain.pddl")
    problem = parse_problem(Source("problem", families.push_box(rooms)), domain)
    return Instance(all_pairs(domain, [problem]))
