# SPDX-License-Identifier: GPL-3.0-or-later
"""Work cut into jobs gives what the work as a whole gives, whoever does it and however it is cut."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from random import Random

import pytest

import coordlang
from coordlang.language.candidates import Candidates, all_pairs, from_problems
from coordlang.language.partition import Partition
from coordlang.required.miscoordination import Inseparable
from coordlang.required.task_answers import answers
from coordlang.verification.by_definition import verify, verify_candidates
from coordlang.vocabulary.first_differences import FirstDifferences, differences
from planners.loading import load
from planners.parallel.batch import Store
from planners.parallel.workers import Workers
from planners.system.errors import BadInput, ProvedImpossible
from tests.support.domains import DOMAINS, all_tasks
from tests.support.random_models import random_model

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


def found(candidates: Candidates, portion: float) -> FirstDifferences | str:
    try:
        return differences(candidates, HERE, portion=portion)
    except Inseparable:
        return "inseparable"


def words(differences: FirstDifferences, seed: int) -> dict[int, int]:
    random = Random(seed)
    return {state: random.randrange(4) for state in differences.states.tolist()}


@pytest.mark.parametrize(("robots", "number"), [(2, 40), (3, 20)])
def test_jobs_give_what_the_whole_gives(robots: int, number: int) -> None:
    answers: Counter[object] = Counter()
    for seed, candidates in enumerate(random_candidates(range(number), robots)):
        whole, parts = found(candidates, 1e9), found(candidates, ONE)
        if isinstance(whole, str) or isinstance(parts, str):
            assert whole == parts
            answers[whole] += 1
            continue
        assert (whole.states == parts.states).all()
        a, b = whole, parts
        assert a.listed.tolist() == b.listed.tolist()
        assert (a.requiring, a.nodes, a.edges) == (b.requiring, b.nodes, b.edges)
        partition = Partition.of_states(candidates.rows, words(whole, seed))
        verdict = verify(partition, candidates.spaces)
        again = verify_candidates(partition, candidates, HERE, portion=ONE)
        assert (verdict.holds, verdict.tasks) == (again.holds, again.tasks)
        assert (again.witness is None) == again.holds
        if verdict.holds:
            assert verdict.nodes == again.nodes
        answers[verdict.holds] += 1
    assert answers[True] >= 3
    assert answers[False] >= 3


def test_processes_and_kept_jobs_change_nothing(tmp_path: Path) -> None:
    candidates = all_tasks("grid", "gw1-2x2")
    whole = differences(candidates, HERE, portion=60.0)
    kept = replace(EAGER, kept=Store(tmp_path / "kept", say=pytest.fail))
    for workers in (kept, kept):
        again = differences(candidates, workers, portion=60.0)
        assert repr(again) == repr(whole)
    partition = Partition.of_states(candidates.rows, words(whole, 0))
    verdict = verify_candidates(partition, candidates, HERE, portion=60.0)
    assert not verdict.holds
    assert verify_candidates(partition, candidates, kept, portion=60.0) == verdict


@pytest.mark.parametrize("workers", [HERE, EAGER])
def test_problems_are_jobs_of_coordination(workers: Workers, tmp_path: Path) -> None:
    domain, corners = DOMAINS / "grid" / "domain.pddl", DOMAINS / "grid" / "corners-3x3.pddl"
    near = tmp_path / "near.pddl"
    near.write_text(corners.read_text().replace("(at r1 c2-2) (at r2 c0-0)", "(at r1 c0-1)"))
    files = [corners, near, corners]
    found = answers(load(domain, files), workers)
    alone = [coordlang.coordination(domain, file)[0] for file in files]
    assert [(a.makespan, a.plans, a.witness) for a in found] == [
        (a.makespan, a.plans, a.witness) for a in alone
    ]
    assert {a.witness is None for a in found} == {True, False}
