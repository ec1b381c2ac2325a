# SPDX-License-Identifier: GPL-3.0-or-later
"""Flexibility by its definition, and languages of minimal size that have more of it."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from fractions import Fraction
from itertools import combinations, product
from random import Random

import numpy as np
import pytest

from coordlang.commands.building import build_language
from coordlang.language.candidates import Candidates, from_listed, from_problems
from coordlang.language.flexibility import flexibility
from coordlang.language.task_file import read_task_file
from coordlang.vocabulary.annealing import AnnealingSettings
from coordlang.vocabulary.flexibility_bound import flexibility_bounds
from coordlang.vocabulary.flexible import flexible
from coordlang.vocabulary.job import Assignment, Outcome
from planners.pddl import read_domain, read_problem
from planners.search.plan_space import PlanSpace
from planners.search.plans import Plan
from planners.system.errors import ProvedImpossible
from tests.support import naive
from tests.support.candidates import (
    failing,
    is_language,
    listed,
    on_graph,
    partitions,
    requiring,
    some_tasks,
)
from tests.support.composition_walk import walk
from tests.support.domains import DOMAINS, all_tasks
from tests.support.random_models import random_model


def random_words(candidates: Candidates, random: Random) -> list[int]:
    size = random.randint(1, 4)
    return [random.randrange(size) for _ in range(len(candidates.rows))]


def of_nodes(candidates: Candidates, word: list[int]) -> list[np.ndarray]:
    return [np.array(word)[space.state] for space in candidates.spaces]


def expected(sequences: list[tuple[int, ...]], word: list[int]) -> Fraction:
    """Draw a plan, say its sentence, count the plans that have it."""
    said = [naive.sentence([word[s] for s in states]) for states in sequences]
    return sum((Fraction(said.count(words)) for words in said), Fraction(0)) / len(said)


def check_measures(candidates: Candidates, word: list[int]) -> int:
    """Compare with the definition; how many tasks have an E strictly between 1 and all plans."""
    measured = flexibility(candidates.spaces, of_nodes(candidates, word))
    between = 0
    for number, (space, task, plans, sequences) in enumerate(listed(candidates)):
        said = [naive.sentence([word[s] for s in states]) for states in sequences]
        sizes = [said.count(words) for words in said]
        steps = int(space.layer[space.starts[task]])
        want = expected(sequences, word)
        between += 1 < want < len(plans)
        assert measured.plans[number] == len(plans)
        assert measured.expected[number] == pytest.approx(float(want), rel=1e-12)
        assert measured.first[number] == pytest.approx(sizes[0], rel=1e-12)
        assert measured.most[number] == pytest.approx(max(sizes), rel=1e-12)
        assert measured.words[number] == pytest.approx(sum(map(len, said)) / len(said), rel=1e-12)
        assert measured.first_words[number] == len(said[0])
        assert measured.steps[number] == steps == len(plans[0])
        saving = sum(1 - Fraction(len(words), steps + 1) for words in said) / len(said)
        assert measured.saving[number] == pytest.approx(float(saving), abs=1e-12)
    assert len(measured.plans) == candidates.count
    return between


def test_flexibility_against_its_definition() -> None:
    random = Random(5)
    between = 0
    for folder, stem in (("three-cells", "problem"), ("t-map", "problem"), ("grid", "gw1-2x2")):
        candidates = all_tasks(folder, stem)
        between += sum(
            check_measures(candidates, random_words(candidates, random)) for _ in range(3)
        )
    assert between > 10


@pytest.mark.parametrize("robots", [2, 3])
def test_flexibility_of_random_models(robots: int) -> None:
    """Robots on random graphs, goals partial, and random models of other kinds."""
    measured = between = 0
    for seed in range(12):
        domain, problem, options = random_model(seed, robots)
        with suppress(ProvedImpossible, naive.TooLarge):
            candidates = from_problems(domain, [problem], options)
            check_measures(candidates, random_words(candidates, Random(seed)))
            measured += 1
        graph = on_graph(2 * seed, robots)
        if graph is not None:
            with suppress(naive.TooLarge):
                between += sum(
                    check_measures(graph, random_words(graph, Random(n))) for n in range(4)
                )
    assert measured >= 2
    assert between >= 1


def test_many_plans_lose_nothing() -> None:
    """10^9 plans: one word leaves all of them open; E is the number of plans by the least words."""
    domain = read_domain(DOMAINS / "grid" / "domain.pddl")
    problem = read_problem(DOMAINS / "grid" / "corners-10x10.pddl", domain)
    candidates = from_problems(domain, [problem])
    measured = flexibility(candidates.spaces, of_nodes(candidates, [0] * len(candidates.rows)))
    assert measured.plans == (1756863020,)
    assert measured.expected[0] == pytest.approx(1756863020, rel=1e-12)
    assert measured.words[0] == pytest.approx(1)


def all_languages(candidates: Candidates, size: int) -> list[tuple[Fraction, dict[int, int]]]:
    """All languages with so many words, with their flexibility."""
    states = sorted({int(s) for space in candidates.spaces for s in space.state})
    bad = failing(candidates)
    every = [sequences for _, _, _, sequences in listed(candidates)]
    found = []
    for word in partitions(states, size):
        if not is_language(word, bad):
            continue
        table = [word.get(s, 0) for s in range(len(candidates.rows))]
        found.append(
            (
                sum((expected(sequences, table) for sequences in every), Fraction(0)) / len(every),
                word,
            )
        )
    return found


def blocks(partition: Assignment) -> set[frozenset[int]]:
    return {frozenset(s for s in partition if partition[s] == word) for word in partition.values()}


def test_flexible_is_best_by_trying_all() -> None:
    """On models small enough for it the search goes from the worst language to the best; no bound
    is exceeded.
    """
    better = 0
    random = Random(2)
    for _ in range(30):
        candidates = all_tasks(
            *random.choice([("grid", "gw1-2x2"), ("grid", "gwb2-3x3"), ("t-map", "problem")])
        )
        candidates = some_tasks(candidates, random, random.randint(1, 4))
        if len({int(s) for space in candidates.spaces for s in space.state}) > 9 or not requiring(
            candidates
        ):
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


def largest(plans: list[Plan], divisions: list[set[int]], robots: int) -> list[int]:
    """For each plan the most plans, it among them, of which every two mix when the robots in a
    division follow one of them and all others the other one; all sets are tried.
    """
    good = set(plans)

    def mixes(one: Plan, other: Plan, side: set[int]) -> bool:
        return (
            naive.mixture(tuple(one if robot in side else other for robot in range(robots))) in good
        )

    free = [
        set(chosen)
        for size in range(len(plans), 0, -1)
        for chosen in combinations(plans, size)
        if all(
            mixes(one, other, side)
            for one, other in product(chosen, repeat=2)
            for side in divisions
        )
    ]
    return [max(len(chosen) for chosen in free if plan in chosen) for plan in plans]


@pytest.mark.parametrize("robots", [2, 3])
def test_bounds_are_the_largest_sets_that_mix(robots: int) -> None:
    """With two robots that is exact; with three the least over who is divided from the others."""
    coordinated = 0
    for seed in range(40):
        candidates = on_graph(seed, robots)
        if candidates is None:
            continue
        requires = [walk(space).requires for space in candidates.spaces]
        bounds = flexibility_bounds(candidates.spaces, requires)
        for bound, (space, task, plans, _) in zip(bounds, listed(candidates), strict=True):
            if len(plans) > 8:
                continue
            each = [largest(plans, [{robot}], robots) for robot in range(robots)]
            assert bound == pytest.approx(sum(map(min, zip(*each, strict=True))) / len(plans))
            coordinated += bool(requires[candidates.spaces.index(space)][space.starts[task]])
    assert coordinated >= 10


def divided(space: PlanSpace, robot: int) -> PlanSpace:
    """The plan space of two robots: one, and all others as one."""
    _, others = np.unique(np.delete(space.labels, robot, axis=1), axis=0, return_inverse=True)
    labels = np.stack((space.labels[:, robot], others.reshape(-1)), axis=1)
    order = np.lexsort((*labels.T[::-1], space.sources))
    return replace(
        space,
        target=space.target[order],
        labels=labels[order].astype(np.int32),
        cost=space.cost[order],
    )


def test_every_division_counts_in_the_bound() -> None:
    """Three robots push a box: for some plans one robot's freedom is the limit, for others another
    one's.
    """
    domain = read_domain(DOMAINS / "push-box" / "domain.pddl")
    candidates = from_problems(
        domain, [read_problem(DOMAINS / "push-box" / "three-robots.pddl", domain)]
    )
    (space,) = candidates.spaces
    (bound,) = flexibility_bounds(candidates.spaces, [walk(space).requires])
    alone = [
        flexibility_bounds([space], [walk(space).requires])[0]
        for space in [divided(space, robot) for robot in range(3)]
    ]
    assert bound < min(alone)


def test_bounds_without_listing_all_boxes() -> None:
    """Where there are too many boxes the bound is looser, never too small."""
    candidates = all_tasks("grid", "gw1-2x2")
    requires = [walk(space).requires for space in candidates.spaces]
    exact = flexibility_bounds(candidates.spaces, requires)
    loose = flexibility_bounds(candidates.spaces, requires, most_boxes=0)
    assert (loose >= exact - 1e-9).all()
    number = flexibility_bounds(candidates.spaces, requires, most_plans=0)
    assert (number >= loose).all()


def test_annealing_is_as_long_as_it_is_set() -> None:
    built = build_language(all_tasks("grid", "gw1-2x2"), "greedy")
    found = Outcome({state: n % 3 for n, state in enumerate(built.job.states)}, 1)
    job = replace(built.job, check=lambda _: None)
    untouched = flexible(job, found, AnnealingSettings(patience=0))
    assert untouched.partition is found.partition
    assert untouched.figures["moves"] == 0
    short = AnnealingSettings(moves=0, least_moves=7, patience=2)
    assert flexible(job, found, short).figures["moves"] == 14


def test_flexible_reaches_its_bound_on_the_ring() -> None:
    """GWB5: the language leaves as many plans open as any language could."""
    domain = read_domain(DOMAINS / "grid" / "domain.pddl")
    problem = read_problem(DOMAINS / "grid" / "gwb5-3x3.pddl", domain)
    candidates = from_listed(
        domain, [problem], read_task_file(DOMAINS / "grid" / "gwb5-3x3.tasks.json")
    )
    built = build_language(candidates, "minimal", prefer="flexible")
    assert built.verdict.holds
    assert built.language.guarantee.proved_minimal
    assert built.figures["flexibility"] == pytest.approx(built.figures["flexibility_bound"])
    assert built.figures["flexibility"] > 1.3 * built.figures["flexibility_before"]
