# SPDX-License-Identifier: GPL-3.0-or-later
"""Flexibility by its definition, and languages of minimal size that have more of it."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from fractions import Fraction
from itertools import combinations, islice, product
from random import Random

import numpy as np
import pytest

from coordlang.commands.building import build_language
from coordlang.language.candidates import Candidates
from coordlang.language.sentences import Flexibility, number_of_sentences
from coordlang.required.choices import Choices
from coordlang.vocabulary.flexible import flexibility_bounds, flexible
from coordlang.vocabulary.job import Assignment, Outcome
from planners.search.plans import Plan
from tests.support import naive, thorough
from tests.support.candidates import (
    MOST,
    failing,
    is_language,
    listed,
    on_graph,
    partitions,
    requiring,
    small_candidates,
    some_tasks,
    states_of,
)
from tests.support.domains import all_tasks, own_task


def of_nodes(candidates: Candidates, word: list[int]) -> list[np.ndarray]:
    return [np.array(word)[space.state] for space in candidates.spaces]


def expected(sequences: list[tuple[int, ...]], word: list[int]) -> Fraction:
    """Draw a plan, say its sentence, count the plans that have it."""
    said = [naive.sentence([word[s] for s in states]) for states in sequences]
    return sum((Fraction(said.count(words)) for words in said), Fraction(0)) / len(said)


def check_measures(candidates: Candidates, word: list[int]) -> int:
    """Compare with the definition; how many tasks have an E strictly between 1 and all plans."""
    measured = Flexibility(candidates.spaces, of_nodes(candidates, word))
    between = 0
    for number, (space, task, plans, sequences) in enumerate(listed(candidates)):
        start, own = int(space.starts[task]), np.array(word)[space.state]
        said = [naive.sentence([word[s] for s in states]) for states in sequences]
        assert number_of_sentences(space, own, start) == len(set(said))
        want = expected(sequences, word)
        between += 1 < want < len(plans)
        assert measured.plans[number] == len(plans)
        assert measured.expected[number] == pytest.approx(float(want), rel=1e-12)
        assert measured.first[number] == pytest.approx(said.count(said[0]), rel=1e-12)
        assert measured.words[number] == pytest.approx(sum(map(len, said)) / len(said), rel=1e-12)
        assert measured.first_words[number] == len(said[0])
        assert measured.steps[number] == len(plans[0])
        saving = sum(1 - Fraction(len(words), len(plans[0]) + 1) for words in said) / len(said)
        assert measured.saving[number] == pytest.approx(float(saving), abs=1e-12)
    assert len(measured.plans) == candidates.count
    return between


@pytest.mark.parametrize("robots", [3, *thorough(2)])
def test_flexibility_against_its_definition(robots: int) -> None:
    """Shipped maps, random models, and robots on random graphs; goals are partial now and then."""
    maps = [("three-cells", "problem"), ("t-map", "problem"), ("grid", "gw1-2x2")]
    models = [all_tasks(*names) for names in maps] if robots == 2 else []
    models += [found for _, found in islice(small_candidates(robots, states=60, plans=MOST), 6)]
    models += [found for seed in range(24) if (found := on_graph(seed, robots)) is not None]
    between = 0
    for seed, candidates in enumerate(3 * models):
        random = Random(seed)
        size = random.randint(1, 4)
        with suppress(naive.TooLarge):
            word = [random.randrange(size) for _ in candidates.rows]
            between += check_measures(candidates, word)
    assert between >= (11 if robots == 2 else 1)


def test_many_plans_lose_nothing() -> None:
    """10^9 plans: one word leaves all of them open; E is the number of plans by the least words."""
    candidates = own_task("grid", "corners-10x10")
    measured = Flexibility(candidates.spaces, of_nodes(candidates, [0] * len(candidates.rows)))
    assert measured.plans == (1756863020,)
    assert measured.expected[0] == pytest.approx(1756863020, rel=1e-12)
    assert measured.words[0] == pytest.approx(1)


def all_languages(candidates: Candidates, size: int) -> list[tuple[Fraction, dict[int, int]]]:
    """All languages with so many words, with their flexibility."""
    states = states_of(candidates)
    bad, every = failing(candidates), [sequences for *_, sequences in listed(candidates)]
    found = []
    for word in partitions(states, size):
        if is_language(word, bad):
            table = [word.get(s, 0) for s in range(len(candidates.rows))]
            total = sum((expected(sequences, table) for sequences in every), Fraction(0))
            found.append((total / len(every), word))
    return found


def blocks(partition: Assignment) -> set[frozenset[int]]:
    return {frozenset(s for s in partition if partition[s] == word) for word in partition.values()}


def test_flexible_is_best_by_trying_all() -> None:
    """The search goes from the worst language to the best; no bound is exceeded."""
    better = 0
    random = Random(2)
    for _ in range(30):
        candidates = all_tasks(
            *random.choice([("grid", "gw1-2x2"), ("grid", "gwb2-3x3"), ("t-map", "problem")])
        )
        candidates = some_tasks(candidates, random, random.randint(1, 4))
        if len(states_of(candidates)) > 9 or not requiring(candidates):
            continue
        built = build_language(candidates, "minimal")
        languages = all_languages(candidates, built.language.guarantee.size)
        worst, word = min(languages, key=lambda pair: pair[0])
        best = max(value for value, _ in languages)
        checked: list[Assignment] = []
        outcome = flexible(
            replace(built.job, check=checked.append), Outcome(word, len(set(word.values())))
        )
        assert outcome.figures["flexibility"] == pytest.approx(float(best), rel=1e-9)
        assert outcome.figures["flexibility_before"] == pytest.approx(float(worst), rel=1e-9)
        assert float(best) <= outcome.figures["flexibility_bound"] * (1 + 1e-9)
        assert blocks(outcome.partition) in [blocks(word) for _, word in languages]
        assert outcome.partition is word or outcome.partition is checked[-1]
        better += worst < best
    assert better >= 3


def largest(plans: list[Plan], robot: int, robots: int) -> list[int]:
    """For each plan the most plans, with it, of which every two mix; all sets are tried."""

    def mixes(one: Plan, other: Plan) -> bool:
        return naive.mixture(tuple(one if n == robot else other for n in range(robots))) in plans

    free = [
        set(chosen)
        for size in range(len(plans), 0, -1)
        for chosen in combinations(plans, size)
        if all(mixes(one, other) for one, other in product(chosen, repeat=2))
    ]
    return [max(len(chosen) for chosen in free if plan in chosen) for plan in plans]


@pytest.mark.parametrize(("robots", "number"), [(2, 20), (3, 40), *thorough((2, 40))])
def test_bounds_are_the_largest_sets_that_mix(robots: int, number: int) -> None:
    """With two robots that is exact; with three the least over who is divided from the others."""
    coordinated = 0
    for seed in range(number):
        candidates = on_graph(seed, robots)
        if candidates is None:
            continue
        requires = [Choices(space).requires for space in candidates.spaces]
        bounds = flexibility_bounds(candidates.spaces)
        for bound, (space, task, plans, _) in zip(bounds, listed(candidates), strict=True):
            if len(plans) > 8:
                continue
            each = [largest(plans, robot, robots) for robot in range(robots)]
            assert bound == pytest.approx(sum(map(min, zip(*each, strict=True))) / len(plans))
            coordinated += bool(requires[candidates.spaces.index(space)][space.starts[task]])
    assert coordinated >= 10
