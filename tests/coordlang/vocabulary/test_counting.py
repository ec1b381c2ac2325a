# SPDX-License-Identifier: GPL-3.0-or-later
"""The bound by counting: plans that are apart, and numbers of words, against lists of all."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from itertools import combinations, islice, product

import numpy as np
import pytest

from coordlang.commands.building import build_language
from coordlang.language.candidates import Candidates, from_problems
from coordlang.language.warping import Pair, pair
from coordlang.required.choices import Choices
from coordlang.vocabulary.counting import Apart, needs_three_words
from coordlang.vocabulary.plan_pairs import failing_pairs
from coordlang.vocabulary.sat import END, PairStep, Undecided
from planners.system.limits import time_limit
from tests.support import naive
from tests.support.candidates import MOST, listed, requiring, small_candidates
from tests.support.texts import parsed


@pytest.mark.parametrize(
    ("robots", "number"), [(2, 20), (3, 10), pytest.param(3, 80, marks=pytest.mark.thorough)]
)
def test_plans_are_apart_iff_some_mixture_of_every_two_fails(robots: int, number: int) -> None:
    told = Counter[bool]()
    models = (c for _, c in small_candidates(robots, states=9, plans=MOST) if requiring(c))
    for candidates in islice(models, number):
        for space, task, plans, _ in listed(candidates):
            start, apart = int(space.starts[task]), Apart(space)
            for steps in range(1, min(3, len(plans[0]) + 1)):
                for one, other in combinations(sorted({plan[:steps] for plan in plans}), 2):
                    fails = all(
                        any(naive.mixture(mixed) not in plans for mixed in ways)
                        for a, b in product(plans, repeat=2)
                        if (a[:steps], b[:steps]) == (one, other)
                        for ways in [list(product((a, b), repeat=robots))]
                    )
                    paths = [space.path_with(start, begun) or [] for begun in (one, other)]
                    assert apart.always(start, *paths) == fails
                    told[fails] += 1
    assert min(told[True], told[False]) >= 20, told


@pytest.mark.parametrize(
    ("robots", "number"), [(2, 20), (3, 10), pytest.param(3, 80, marks=pytest.mark.thorough)]
)
def test_pairs_of_plans_that_fail_are_the_paths_of_a_graph(robots: int, number: int) -> None:
    models = (c for _, c in small_candidates(robots, states=9, plans=MOST) if requiring(c))
    told = 0
    for candidates in islice(models, number):
        failing = defaultdict[int, set[tuple[Pair | None, ...]]](set)
        for space, task, plans, _ in listed(candidates):
            start = int(space.starts[task])
            for one, other in combinations(plans, 2):
                if any(naive.mixture(w) not in plans for w in product((one, other), repeat=robots)):
                    same = next(
                        n for n, two in enumerate(zip(one, other, strict=True)) if two[0] != two[1]
                    )
                    entered = [
                        space.state[space.targets(np.array(space.path_with(start, plan)))][same:]
                        for plan in (one, other)
                    ]
                    two = zip(*(states.tolist() for states in entered), strict=True)
                    failing[id(space)].add(tuple(pair(a, b) if a != b else None for a, b in two))
        for space in candidates.spaces:
            steps = failing_pairs(Choices(space), 10**6)
            assert set(paths_of(steps)) == failing[id(space)]
            told += len(failing[id(space)])
            with pytest.raises(Undecided):
                failing_pairs(Choices(space), 0)
    assert told >= 2 * number, told


def paths_of(steps: Sequence[PairStep], place: int = 0) -> Iterator[tuple[Pair | None, ...]]:
    """What the plans enter on each path from a place to the end."""
    for before, states, after in steps:
        if before == place:
            rest = [()] if after == END else paths_of(steps, after)
            yield from ((states, *following) for following in rest)


BELLS = """(define (domain bells)
  (:requirements :typing :multi-agent :negative-preconditions :equality :existential-preconditions)
  (:types robot tone round)
  (:predicates (silent ?r - robot) (heard ?r - robot ?t - tone) (at ?r - robot ?n - round)
    (next ?n ?m - round) (fits ?n - round ?t ?u - tone))
  (:action ring :agent ?r - robot :parameters (?t - tone ?n - round)
    :precondition (and (silent ?r) (at ?r ?n)
      (exists (?o - robot ?u - tone)
        (and (not (= ?o ?r)) (fits ?n ?t ?u) (ring ?o ?u ?n))))
    :effect (and (not (silent ?r)) (heard ?r ?t)))
  (:action rest :agent ?r - robot :parameters (?t - tone ?n ?m - round)
    :precondition (and (heard ?r ?t) (at ?r ?n) (next ?n ?m))
    :effect (and (not (heard ?r ?t)) (silent ?r) (not (at ?r ?n)) (at ?r ?m))))"""
TWICE = """(define (problem twice) (:domain bells)
  (:objects r1 r2 - robot low high deep - tone n0 n1 n2 - round)
  (:init (silent r1) (silent r2) (at r1 n0) (at r2 n0) (next n0 n1) (next n1 n2)
    FITS)
  (:goal (and GOAL)))"""
#: The last tones are forgotten, or they are not.
ONE_END, MANY = "(at r1 n2) (at r2 n2)", "(at r1 n1) (at r2 n1) (not (silent r1)) (not (silent r2))"
EQUAL = ("low low", "high high", "deep deep")
#: All that may fit in a round of two tones.
FITS = [
    [pair for pairs in chosen for pair in pairs]
    for number in (1, 2, 3)
    for chosen in combinations((EQUAL[:1], EQUAL[1:2], ("low high", "high low")), number)
]


def bells(first: Sequence[str], second: Sequence[str], goal: str = ONE_END) -> Candidates:
    """Two robots ring tones that fit in this round, and rest, twice."""
    fits = [f"(fits n0 {pair})" for pair in first] + [f"(fits n1 {pair})" for pair in second]
    text = TWICE.replace("FITS", " ".join(fits)).replace("GOAL", goal)
    domain, problem = parsed(BELLS, text)
    return from_problems(domain, [problem])


def least(candidates: Candidates) -> int:
    """The least number of words, by listing all partitions."""
    return build_language(candidates, "exhaustive").language.guarantee.size


@pytest.mark.parametrize("goal", [ONE_END, MANY])
def test_two_words_do_not_suffice_where_counting_says_so(goal: str) -> None:
    """Whatever tones fit; and of three tones, where more sentences are needed."""
    told = Counter[tuple[bool, bool]]()
    for first, second in [*product(FITS, repeat=2), (EQUAL, EQUAL)]:
        candidates = bells(first, second, goal)
        told[needs_three_words(candidates.spaces[0]), least(candidates) >= 3] += 1
    assert not told[True, False]
    # Of the seven ways in which two tones fit, four tell plans apart; in one round they are few.
    assert told[True, True] == (17 if goal == ONE_END else 1)
    assert told[False, False] >= 5


@pytest.mark.parametrize("robots", [2, 3])
def test_two_words_suffice_where_they_are_found(robots: int) -> None:
    """On random models: never is something counted that is not there."""
    models = (c for _, c in small_candidates(robots, states=7, plans=MOST) if requiring(c))
    told = Counter[bool]()
    for candidates in islice(models, 20):
        counted = any(map(needs_three_words, candidates.spaces))
        told[counted] += 1
        assert not counted or least(candidates) >= 3
    assert told[False] >= 5


@pytest.mark.parametrize("reserve", [0.0, 0.5])
def test_a_bound_for_a_certificate_is_not_counted(reserve: float) -> None:
    """The same tone twice: four plans, each two apart, and three numbers of changes in four steps.

    Clauses prove the same, for a certificate consists of clauses.
    """
    with time_limit(60):
        built = build_language(bells(EQUAL[:2], EQUAL[:2]), "minimal", reserve=reserve)
    guarantee = built.language.guarantee
    assert (guarantee.size, guarantee.lower_bound, guarantee.proved_minimal) == (3, 3, True)
    assert bool(built.outcome.refuting) == bool(reserve)
    assert built.certificate().refuted == 2
