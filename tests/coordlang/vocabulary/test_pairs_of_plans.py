# SPDX-License-Identifier: GPL-3.0-or-later
"""Pairs of plans that fail, for two words and for any number, against lists of all."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from contextlib import closing, nullcontext
from dataclasses import replace
from functools import partial
from itertools import combinations, islice, product
from math import inf

import numpy as np
import pytest

from coordlang.commands.building import Making, build_language
from coordlang.commands.records import MethodOptions
from coordlang.language.candidates import Candidates, from_problems
from coordlang.language.warping import Pair, pair
from coordlang.required.choices import Choices
from coordlang.vocabulary.loop import Budget, Languages, find
from coordlang.vocabulary.minimal import MinimalSearch
from coordlang.vocabulary.plan_pairs import PlanPairs, failing_pairs
from coordlang.vocabulary.sat import END, START, Undecided
from coordlang.vocabulary.two_words import TwoWords
from coordlang.vocabulary.warped_pairs import PairsApart, WarpedPairs
from planners.joint.tables import Ints
from planners.search.plan_space import PlanSpace
from tests.support import naive
from tests.support.candidates import (
    MOST,
    failing,
    is_language,
    listed,
    requiring,
    small_candidates,
)
from tests.support.texts import parsed


@pytest.mark.parametrize(
    ("robots", "number"),
    [(2, 10), (3, 5), *(pytest.param(n, 80, marks=pytest.mark.thorough) for n in (2, 3))],
)
def test_pairs_of_plans_that_fail_are_the_paths_of_a_graph(robots: int, number: int) -> None:
    models = (c for _, c in small_candidates(robots, states=9, plans=MOST) if requiring(c))
    told = 0
    for candidates in islice(models, number):
        fail = defaultdict[int, set[tuple[Pair | None, ...]]](set)
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
                    fail[id(space)].add(tuple(pair(a, b) if a != b else None for a, b in two))
        for space in candidates.spaces:
            pairs = PlanPairs(Choices(space))
            assert pairs.grow(10**6)
            paths = set(paths_of(failing_pairs(pairs, inf, 10**6)))
            assert paths == fail[id(space)]
            told += len(paths)
            for within in (0, 1):
                for path in set(paths_of(failing_pairs(pairs, within, 10**6))):
                    begun = {whole[: len(path)] for whole in paths}
                    assert path in begun
            with pytest.raises(Undecided) if paths else nullcontext():
                failing_pairs(pairs, inf, 0)
    assert told >= 2 * number, told


def paths_of(steps: Ints, place: int = START) -> Iterator[tuple[Pair | None, ...]]:
    """What the plans enter on each path from a place to the end."""
    for before, one, other, after in steps.tolist():
        if before == place:
            states = pair(one, other) if one != other else None
            rest = [()] if after == END else paths_of(steps, after)
            yield from ((states, *following) for following in rest)


@pytest.mark.parametrize(
    ("robots", "number"),
    [(2, 15), (3, 8), *(pytest.param(n, 150, marks=pytest.mark.thorough) for n in (2, 3))],
)
def test_languages_tell_pairs_apart_on_all_warping_paths_and_nothing_else_does(
    robots: int, number: int
) -> None:
    models = (c for _, c in small_candidates(robots, states=8, plans=MOST) if requiring(c))
    random, seen = np.random.default_rng(0), Counter[tuple[bool, bool]]()
    for candidates in islice(models, number):
        bad = failing(candidates)
        #: Two plans that are never in one state again once they differ.
        two = [pairs for plans in bad if len(pairs := sorted(set(plans))) == 2 and parted(pairs)]
        graphs = [
            np.concatenate([*WarpedPairs(grown(space), apart, waiting).steps()])
            for space in candidates.spaces
            for apart, waiting in ((99, 99), (99, 0), (1, 2), (0, 2))
        ]
        for _ in range(40):
            drawn = random.integers(random.integers(2, 9), size=len(candidates.rows)).tolist()
            word = dict(enumerate(drawn))
            told = [tells_apart(graph, drawn) for graph in graphs]
            holds = is_language(word, bad)
            assert all(told) >= holds
            assert not all(told) or is_language(word, two)
            seen[holds, all(told)] += 1
    assert min(seen[True, True], seen[False, False]) >= 10 * number, seen


def grown(space: PlanSpace) -> PlanPairs:
    """All pairs of plans."""
    pairs = PlanPairs(Choices(space))
    assert pairs.grow(10**6)
    return pairs


def parted(two: Sequence[Sequence[int]]) -> Sequence[Sequence[int]]:
    """Two plans from the last state that they share on, if they differ in all later ones."""
    same = [a == b for a, b in zip(*two, strict=True)]
    first = same.index(False)
    return [] if any(same[first:]) else [states[first - 1 :] for states in two]


@pytest.mark.parametrize(
    ("robots", "number"),
    [(2, 20), (3, 20), *(pytest.param(n, 150, marks=pytest.mark.thorough) for n in (2, 3))],
)
def test_all_warping_paths_of_pairs_of_plans_are_the_paths_of_a_graph(
    robots: int, number: int
) -> None:
    models = (
        c
        for _, c in small_candidates(robots, states=9, plans=MOST)
        if requiring(c) and len(c.spaces) == 1 and int(c.spaces[0].layer.max()) <= 4
    )
    listed = 0
    for candidates in islice(models, number):
        two = [own for plans in failing(candidates) if len(own := sorted(set(plans))) == 2]
        steps = WarpedPairs(grown(candidates.spaces[0]), 99, 99).steps()
        found = {frozenset(path) - {None} for path in paths_of(np.concatenate([*steps]))}
        expected = {
            frozenset(path) - {None}
            for pairs in map(parted, two)
            if pairs
            for path in warped(pairs[0], pairs[1])
        }
        assert found == expected if all(map(parted, two)) else found >= expected
        listed += len(expected)
    assert listed >= 2 * number, listed


def warped(
    one: Sequence[int], other: Sequence[int], i: int = 0, j: int = 0
) -> Iterator[tuple[Pair | None, ...]]:
    """What two plans are in on each warping path: pairs of different states."""
    here = pair(one[i], other[j]) if one[i] != other[j] else None
    ends = i + 1 == len(one), j + 1 == len(other)
    if all(ends):
        yield (here,)
    for right, down in product((0, 1), repeat=2):
        if (right or down) and right <= (not ends[0]) and down <= (not ends[1]):
            yield from ((here, *rest) for rest in warped(one, other, i + right, j + down))


def tells_apart(steps: Ints, word: Sequence[int]) -> bool:
    """Whether two words differ on each path from the start to the end."""
    after = defaultdict[int, set[int]](set)
    for before, one, other, place in steps.tolist():
        if word[one] == word[other]:
            after[before].add(place)
    left, reached = [START], {START}
    while left:
        new = after[left.pop()] - reached
        reached |= new
        left += new
    return END not in reached


@pytest.mark.parametrize(
    ("robots", "number"),
    [(2, 12), (3, 12), *(pytest.param(n, 100, marks=pytest.mark.thorough) for n in (2, 3, 4))],
)
def test_the_fewest_words_that_tell_pairs_apart_are_the_fewest_of_all(
    robots: int, number: int
) -> None:
    models = (
        c
        for _, c in small_candidates(robots, states=7, plans=MOST)
        if requiring(c) and len(c.spaces) == 1
    )
    seen = Counter[int]()
    for candidates in [*islice(models, number), *map(bells, FITS[:3], FITS[3:6])]:
        job = Making(candidates).job(MethodOptions())
        languages, pairs = Languages.of(job), WarpedPairs(grown(candidates.spaces[0]), 99)
        draws = np.random.default_rng(0)
        search = PairsApart(job.states, languages.clauses, pairs, draws)
        with closing(search):
            fewest = 2
            while (found := find(partial(search.find, fewest), languages.holds, Budget())) is None:
                fewest += 1
        job.check(found)
        assert fewest == least(candidates)
        seen[fewest] += 1
    assert min(seen[2], seen[3]) >= 2, seen


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


def suffice(candidates: Candidates) -> bool:
    """Whether the search for two words finds a language, which is verified."""
    (space,) = candidates.spaces
    job = Making(candidates).job(MethodOptions())
    languages = Languages.of(job)
    search = TwoWords(PlanPairs(Choices(space)), job.states, languages.clauses)
    with closing(search):
        found = search.find(languages.holds, Budget(rounds=1_000), 10**6)
    if found is not None:
        job.check(found)
    return found is not None


@pytest.mark.parametrize("goal", [ONE_END, MANY])
@pytest.mark.parametrize(
    "fits",
    [
        pytest.param([*zip(FITS, FITS[2:] + FITS[:2], strict=True), (EQUAL, EQUAL)], id="some"),
        pytest.param(
            [*product(FITS, repeat=2), (EQUAL, EQUAL)], id="all", marks=pytest.mark.thorough
        ),
    ],
)
def test_two_words_suffice_iff_some_partition_of_all_does(
    fits: Sequence[tuple[Sequence[str], Sequence[str]]], goal: str
) -> None:
    """Whatever tones fit; and of three tones, where more sentences are needed."""
    told = Counter[bool]()
    for first, second in fits:
        candidates = bells(first, second, goal)
        if requiring(candidates):
            found = suffice(candidates)
            assert found == (least(candidates) == 2)
            told[found] += 1
    assert min(told[True], told[False]) >= 1, told


@pytest.mark.parametrize(
    ("robots", "number"),
    [(2, 20), (3, 20), *(pytest.param(n, 100, marks=pytest.mark.thorough) for n in (2, 3, 4))],
)
def test_two_words_suffice_iff_some_partition_of_random_models_does(
    robots: int, number: int
) -> None:
    models = (
        c
        for _, c in small_candidates(robots, states=7, plans=MOST)
        if requiring(c) and len(c.spaces) == 1
    )
    told = Counter[bool]()
    for candidates in islice(models, number):
        found = suffice(candidates)
        assert found == (least(candidates) == 2)
        told[found] += 1
    assert min(told[True], told[False]) >= 3, told


def test_few_pairs_prove_nothing_too_much_and_the_next_call_goes_on() -> None:
    (space,) = bells(EQUAL, EQUAL).spaces
    search = TwoWords(PlanPairs(Choices(space)), np.unique(space.state).tolist(), [])
    with closing(search):
        with pytest.raises(Undecided):
            search.find(lambda _: True, Budget(), 0)
        assert search.find(lambda _: False, Budget(), 10**6) is None


@pytest.mark.parametrize("by_clauses", [False, True])
def test_a_bound_is_counted_unless_clauses_must_prove_it(by_clauses: bool) -> None:
    """The same tone twice: four plans, each two fail, and three numbers of changes in four steps."""
    job = Making(bells(EQUAL[:2], EQUAL[:2])).job(MethodOptions())
    with closing(MinimalSearch(replace(job, by_clauses=by_clauses))) as search:
        assert search.decide(2, Budget(rounds=2)) != by_clauses
        assert (search.lower, search.refuting) == (2 if by_clauses else 3, {})


def test_clauses_prove_what_is_counted() -> None:
    built = build_language(bells(EQUAL[:2], EQUAL[:2]), "minimal", reserve=0.5)
    guarantee = built.language.guarantee
    assert (guarantee.size, guarantee.lower_bound, guarantee.proved_minimal) == (3, 3, True)
    assert built.certificate().refuted == 2
