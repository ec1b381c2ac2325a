# SPDX-License-Identifier: GPL-3.0-or-later
"""Goals up to symmetry, and work in jobs: the same as from all goals, and as the whole gives."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from itertools import combinations
from pathlib import Path
from random import Random

import pytest

import coordlang
from coordlang.commands.building import build_language
from coordlang.language.candidates import Candidates, all_pairs, from_problems
from coordlang.language.words import Partition
from coordlang.required.miscoordination import Inseparable
from coordlang.required.task_answers import answers
from coordlang.verification.by_definition import inseparable, verify_candidates
from coordlang.vocabulary import first_differences
from coordlang.vocabulary.first_differences import FirstDifferences, differences, symmetric_goals
from planners.loading import load
from planners.parallel.batch import Store
from planners.parallel.workers import Workers
from planners.pddl.model_options import ModelOptions
from planners.search.portions import PORTION
from planners.system.errors import BadInput, ProvedImpossible
from tests.support import slow, thorough
from tests.support.domains import all_tasks, files_of, own_task
from tests.support.random_models import random_model
from tests.support.symmetric_worlds import GRID, world


def agree(candidates: Candidates, portion: float = PORTION) -> bool:
    """Compare; whether a symmetry was found and coordination is required."""
    if symmetric_goals(candidates, 0, 0) is None:
        return False
    found = answer(candidates, portion, True)
    every = answer(candidates, portion, False)
    if found is None or every is None:
        assert found is every
        return False
    return same(found, every)


def same(one: FirstDifferences, other: FirstDifferences) -> bool:
    """They are; whether coordination is required."""
    assert one.states.tolist() == other.states.tolist()
    assert one.listed.tolist() == other.listed.tolist()
    assert (one.requiring, one.nodes, one.edges) == (other.requiring, other.nodes, other.edges)
    return bool(one.requiring)


def answer(candidates: Candidates, portion: float, by_symmetry: bool) -> FirstDifferences | None:
    """First differences with or without symmetries; None if some plans are inseparable."""
    with pytest.MonkeyPatch.context() as patch:
        for_action = 0 if by_symmetry else 10**9
        patch.setattr(
            first_differences, "symmetric_goals", lambda c: symmetric_goals(c, 0, for_action)
        )
        try:
            return differences(candidates, Workers(), portion=portion)
        except Inseparable:
            return None


@pytest.mark.parametrize("seeds", [range(15), *slow(range(1_000, 1_300))])
def test_random_worlds(seeds: range) -> None:
    found = 0
    for seed in seeds:
        random = Random(seed)
        robots = random.choice([2, 2, 3])
        cells = random.randint(robots + 1, 5 if robots == 2 else 4)
        edges = [edge for edge in combinations(range(cells), 2) if random.random() < 0.7]
        problem = world(cells, edges, robots)
        options = random.choice([ModelOptions(), ModelOptions(cost="makespan+actions")])
        candidates = all_pairs(GRID, [problem], options)
        found += bool(candidates.count) and agree(candidates, random.choice([PORTION, 40.0, 300.0]))
    assert found >= len(seeds) // 3


def test_random_models() -> None:
    """Mostly without a symmetry."""
    found = 0
    for seed in range(30):
        domain, problem, options = random_model(seed, 2 + seed % 2)
        candidates = all_pairs(domain, [problem], options)
        if 0 < candidates.count <= 2_000:
            agree(candidates)
            found += symmetric_goals(candidates, 0, 0) is not None
    assert found >= 1


def test_where_symmetries_are_not_looked_for() -> None:
    small = all_tasks("grid", "gw2-2x3")
    assert symmetric_goals(small) is None  # less work than symmetries take
    assert symmetric_goals(small, 0, 0) is not None
    assert symmetric_goals(small, least=0, for_action=10**6) is None
    assert symmetric_goals(own_task("grid", "gw2-2x3"), 0, 0) is None
    remembering = all_tasks("grid", "gw2-2x3", ModelOptions(remember_actions=True))
    assert symmetric_goals(remembering, 0, 0) is None


def test_a_language_is_the_same_and_inseparable_plans_are_shown(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    grid = all_tasks("grid", "gw4-3x3")
    without = build_language(grid, "greedy")
    monkeypatch.setattr(
        "coordlang.vocabulary.first_differences.symmetric_goals", lambda c: symmetric_goals(c, 0, 0)
    )
    assert build_language(grid, "greedy").language.states == without.language.states
    shown = 0
    for seed in range(30):
        domain, problem, options = random_model(seed, 2)
        candidates = all_pairs(domain, [problem], options)
        if not candidates.count or not any(map(inseparable, candidates.spaces)):
            continue
        with pytest.raises(Inseparable):
            build_language(candidates, "greedy")
        shown += 1
    assert shown


# ---- work cut into jobs gives what the whole gives, whoever does it

HERE = Workers()
#: So small that every goal is a job, and that processes do them.
ONE, EAGER = 1.0, Workers(2, worth=0.0)


def random_candidates(seeds: range, robots: int) -> Iterator[Candidates]:
    for seed in seeds:
        domain, problem, options = random_model(seed, robots)
        options = replace(options, remember_actions=seed % 3 == 0)
        goals = [problem, replace(problem)] if seed % 4 == 0 else [problem]
        make = from_problems if seed % 4 == 0 else all_pairs
        try:
            found = make(domain, goals, options)
        except (ProvedImpossible, BadInput):
            continue
        if found.count > 0 and sum(map(len, found.spaces)) < 2_000:
            yield found


def words(differences: FirstDifferences, seed: int) -> dict[int, int]:
    random = Random(seed)
    return {state: random.randrange(4) for state in differences.states.tolist()}


@pytest.mark.parametrize(("robots", "number"), [(2, 40), *thorough((3, 20))])
def test_jobs_give_what_the_whole_gives(
    robots: int, number: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    answers: Counter[bool] = Counter()
    monkeypatch.setattr(first_differences, "_ROWS", 20)
    for candidates in random_candidates(range(number), robots):
        whole, parts = (answer(candidates, portion, False) for portion in (1e9, ONE))
        if whole is None or parts is None:
            assert whole is parts
        else:
            answers[same(whole, parts)] += 1
    assert answers[True] >= 3
    assert answers[False] >= 3


@pytest.mark.filterwarnings("error")
def test_processes_and_kept_jobs_change_nothing(tmp_path: Path) -> None:
    candidates = all_tasks("grid", "gw1-2x2")
    whole = differences(candidates, HERE, portion=60.0)
    kept = replace(EAGER, kept=Store(tmp_path / "kept"))
    for workers in (kept, kept):
        again = differences(candidates, workers, portion=60.0)
        assert repr(again) == repr(whole)
    partition = Partition.of_states(candidates.rows, words(whole, 0))
    verdict = verify_candidates(partition, candidates, HERE, portion=60.0)
    assert not verdict.holds
    assert verify_candidates(partition, candidates, kept, portion=60.0) == verdict


@pytest.mark.parametrize("workers", [HERE, *thorough(EAGER)])
def test_problems_are_jobs_of_coordination(workers: Workers, tmp_path: Path) -> None:
    domain, corners = files_of("grid", "corners-3x3")
    near = tmp_path / "near.pddl"
    near.write_text(corners.read_text().replace("(at r1 c2-2) (at r2 c0-0)", "(at r1 c0-1)"))
    files = [corners, near, corners]
    found = answers(load(domain, files), workers)
    alone = [coordlang.coordination(domain, file)[0] for file in files]
    assert [(a.makespan, a.plans, a.witness) for a in found] == [
        (a.makespan, a.plans, a.witness) for a in alone
    ]
    assert {a.witness is None for a in found} == {True, False}
