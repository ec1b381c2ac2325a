# SPDX-License-Identifier: GPL-3.0-or-later
"""Pairs of plans that fail, for two words and for any number, against lists of all."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Sequence
from contextlib import closing, nullcontext
from dataclasses import replace
from functools import partial
from itertools import combinations, islice, product, takewhile
from math import inf

import networkx as nx
import numpy as np
import pytest

from coordlang.commands.building import Making, build_language
from coordlang.commands.records import MethodOptions
from coordlang.language.candidates import Candidates, from_problems
from coordlang.language.warping import Pair, pair
from coordlang.required.choices import Choices
from coordlang.vocabulary.job import Job
from coordlang.vocabulary.languages import Languages
from coordlang.vocabulary.loop import Budget, find
from coordlang.vocabulary.minimal import MinimalSearch
from coordlang.vocabulary.one_task import TwoWords
from coordlang.vocabulary.plan_pairs import PlanPairs
from coordlang.vocabulary.sat import END, START, Undecided
from coordlang.vocabulary.warped_pairs import PairsApart, WarpedPairs, failing_pairs
from planners.joint.tables import Ints
from planners.search.plan_space import PlanSpace
from tests.support import naive, thorough
from tests.support.candidates import (
    MOST,
    REQUIRING,
    failing,
    is_language,
    listed,
    requiring,
    small_candidates,
)
from tests.support.domains import own_task
from tests.support.texts import parsed


@pytest.mark.parametrize(("robots", "number"), [(2, 5), (3, 5), *thorough((2, 80), (3, 80))])
def test_pairs_of_plans_that_fail_are_the_paths_of_a_graph(robots: int, number: int) -> None:
    models = (c for _, c in small_candidates(robots, states=9, plans=MOST, requires=True))
    told, own = 0, [own_task("grid", "corners-3x3"), own_task("corridor")] if robots == 2 else []
    for candidates in (bells(EQUAL[:1], EQUAL[:1]), *own, *islice(models, number)):
        fail = defaultdict[int, set[tuple[Pair | None, ...]]](set)
        for space, task, plans, _ in listed(candidates):
            start = int(space.starts[task])
            for one, other in combinations(plans, 2):
                if any(naive.mixture(w) not in plans for w in product((one, other), repeat=robots)):
                    same = [a == b for a, b in zip(one, other, strict=True)].index(False)
                    entered = [
                        space.state[space.targets(np.array(space.path_with(start, plan)))][same:]
                        for plan in (one, other)
                    ]
                    two = zip(*(states.tolist() for states in entered), strict=True)
                    fail[id(space)].add(tuple(pair(a, b) if a != b else None for a, b in two))
        for space in candidates.spaces:
            for at_once, within in product((True, False), (0, 1, inf)):
                pairs = grown(space, at_once)
                paths = set(paths_of(failing_pairs(pairs, within, 10**6)))
                assert paths <= {plans[:n] for plans in fail[id(space)] for n in range(20)}
                if within == inf:
                    assert least_of(paths) == least_of(fail[id(space)])
            told += len(paths)
            with pytest.raises(Undecided) if paths else nullcontext():
                failing_pairs(pairs, inf, 0)
    assert told >= 2 * number, told


@pytest.mark.thorough
@pytest.mark.parametrize(("robots", "asynchronous"), REQUIRING)
def test_no_model_is_passed_over(robots: int, asynchronous: bool) -> None:
    """The seeds of models that require coordination are those that all models show."""
    seeds = [*map(int, REQUIRING[robots, asynchronous].split())]
    models = small_candidates(robots, states=9, asynchronous=asynchronous, separable=False)
    every = takewhile(lambda one: one[0] <= seeds[-1], models)
    assert [seed for seed, found in every if requiring(found)] == seeds


def paths_of(steps: Ints, place: int = START) -> Iterator[tuple[Pair | None, ...]]:
    """What the plans enter on each path from a place to the end."""
    for before, one, other, after in steps.tolist():
        if before == place:
            states = pair(one, other) if one != other else None
            rest = [()] if after == END else paths_of(steps, after)
            yield from ((states, *following) for following in rest)


def least_of(paths: Iterable[tuple[Pair | None, ...]]) -> set[frozenset[Pair | None]]:
    """The pairs of states of which one must be told apart, where no fewer of them are said to."""
    every = {frozenset(path) - {None} for path in paths}
    return {states for states in every if not any(other < states for other in every)}


def grown(space: PlanSpace, at_once: bool = False) -> PlanPairs:
    """All pairs of plans."""
    pairs = PlanPairs(Choices(space))
    assert pairs.grow(10**6) if at_once else pairs.complete(10**6)
    return pairs


def parted(two: Sequence[Sequence[int]]) -> Sequence[Sequence[int]]:
    """Two plans from the last state that they share on, if they differ in all later ones."""
    same = [a == b for a, b in zip(*two, strict=True)]
    first = same.index(False)
    return [] if any(same[first:]) else [states[first - 1 :] for states in two]


@pytest.mark.parametrize(("robots", "number"), [(3, 20), *thorough((2, 150), (3, 150))])
def test_all_warping_paths_of_pairs_of_plans_are_the_paths_of_a_graph(
    robots: int, number: int
) -> None:
    models = (
        c
        for _, c in small_candidates(robots, states=9, plans=MOST, requires=True)
        if len(c.spaces) == 1 and int(c.spaces[0].layer.max()) <= 4
    )
    random, seen, paths = np.random.default_rng(0), Counter[bool](), 0
    for candidates in islice(models, number):
        bad, pairs = failing(candidates), grown(candidates.spaces[0])
        two = [own for plans in bad if len(own := sorted(set(plans))) == 2]
        graphs = [
            WarpedPairs(pairs, apart, waiting).steps()
            for apart, waiting in ((99, 99), (99, 0), (1, 2), (0, 2))
        ]
        found = {frozenset(path) - {None} for path in paths_of(graphs[0])}
        expected = {
            frozenset(path) - {None} for both in map(parted, two) if both for path in warped(both)
        }
        assert found == expected if all(map(parted, two)) else found >= expected
        paths += len(expected)
        for _ in range(40):  # every language tells pairs apart, on fewer paths, too
            word = random.integers(random.integers(2, 9), size=len(candidates.rows))
            told = all(tells_apart(graph, word) for graph in graphs)
            holds = is_language(dict(enumerate(word.tolist())), bad)
            assert told >= holds
            seen[holds] += 1
    assert paths >= 2 * number, paths
    assert min(seen.values()) >= 10 * number, seen


def warped(
    two: Sequence[Sequence[int]], i: int = 0, j: int = 0
) -> Iterator[tuple[Pair | None, ...]]:
    """What two plans are in on each warping path: pairs of different states."""
    one, other = two
    here = pair(one[i], other[j]) if one[i] != other[j] else None
    if (i + 1, j + 1) == (len(one), len(other)):
        yield (here,)
    for right, down in ((0, 1), (1, 0), (1, 1)):
        if i + right < len(one) and j + down < len(other):
            yield from ((here, *rest) for rest in warped(two, i + right, j + down))


def tells_apart(steps: Ints, word: Ints) -> bool:
    """Whether two words differ on each path from the start to the end."""
    equal = steps[word[steps[:, 1]] == word[steps[:, 2]]]
    graph = nx.DiGraph([(START, START), (END, END), *equal[:, [0, 3]].tolist()])
    return not nx.has_path(graph, START, END)


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


def suffice(job: Job) -> bool:
    """Whether the search for two words finds a language, which is verified."""
    (space,) = job.candidates.spaces
    languages = Languages.of(job)
    with closing(TwoWords(PlanPairs(Choices(space)), job.states, languages.clauses)) as search:
        found = find(partial(search.find, 10**6), languages.holds, Budget(rounds=1_000))
    if found is not None:
        job.check(found)
    return found is not None


def fewest(job: Job) -> int:
    """The fewest words of which some tell all pairs of plans apart, and are a language."""
    languages, pairs = Languages.of(job), WarpedPairs(grown(job.candidates.spaces[0]), 99)
    draws, size, holds = np.random.default_rng(0), 2, languages.holds
    with closing(PairsApart(job.states, languages.clauses, pairs.steps(), draws)) as search:
        while (found := find(partial(search.find, size, size + 1), holds, Budget())) is None:
            size += 1
    job.check(found)
    return size


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
def test_as_few_words_suffice_as_of_all_partitions(
    fits: Sequence[tuple[Sequence[str], Sequence[str]]], goal: str
) -> None:
    """Whatever tones fit; and of three tones, where more sentences are needed."""
    told = Counter[int]()
    for first, second in fits:
        candidates = bells(first, second, goal)
        if requiring(candidates):
            size, job = least(candidates), Making(candidates).job(MethodOptions())
            assert suffice(job) == (size == 2)
            assert fewest(job) == size
            told[size] += 1
    assert min(told[2], told[3]) >= 1, told


@pytest.mark.parametrize(
    ("robots", "number", "asynchronous"),
    [
        (3, 12, False),
        (2, 12, True),
        *thorough((2, 100, False), (3, 100, False), (4, 100, False), (2, 60, True), (3, 60, True)),
    ],
)
def test_as_few_words_of_random_models_suffice_as_of_all_partitions(
    robots: int, number: int, asynchronous: bool
) -> None:
    found = small_candidates(robots, states=7, plans=MOST, asynchronous=asynchronous, requires=True)
    models = (candidates for _, candidates in found if len(candidates.spaces) == 1)
    told = Counter[int]()
    for candidates in islice(models, number):
        size, job = least(candidates), Making(candidates).job(MethodOptions())
        assert suffice(job) == (size == 2)
        assert fewest(job) == size
        told[size] += 1
    assert min(told[2], told[3]) >= 3, told


def test_few_pairs_prove_nothing_too_much_and_the_next_call_goes_on() -> None:
    (space,) = bells(EQUAL, EQUAL).spaces
    states = np.unique(space.state).tolist()
    with closing(TwoWords(PlanPairs(Choices(space)), states, [])) as search:
        with pytest.raises(Undecided):
            search.find(0, 30_000)
        assert find(partial(search.find, 10**6), lambda _: False, Budget()) is None


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
