# SPDX-License-Identifier: GPL-3.0-or-later
"""What every way to a language must do, whatever it is: a new one in `METHODS` is tested here
without being named.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import pytest

from coordlang.commands.building import Making, build_language
from coordlang.language.candidates import Candidates, all_pairs, from_problems
from coordlang.required.miscoordination import inseparable
from coordlang.vocabulary import METHODS, Job, Outcome
from coordlang.vocabulary import exhaustive as by_brute_force
from coordlang.vocabulary.job import Assignment
from planners.system.errors import OutOfMemory, OutOfTime, ProvedImpossible
from tests.support import naive
from tests.support.candidates import states_of
from tests.support.composition_walk import walk
from tests.support.domains import all_tasks
from tests.support.random_models import random_model


@cache
def small(robots: int, most: int, number: int) -> list[Candidates]:
    """Random models that require coordination, with separable plans, few states and few plans; also
    partial goals.
    """
    found: list[Candidates] = []
    for seed in range(10_000):
        domain, problem, options = random_model(seed, robots)
        make: Callable[..., Candidates] = all_pairs if seed % 2 else from_problems
        try:
            candidates = make(domain, [problem], options)
            if not 0 < candidates.count <= 60 or states_of(candidates.spaces) > 6:
                continue
            if any(inseparable(space) is not None for space in candidates.spaces):
                continue
            if not any(walk(space).requires[space.starts].any() for space in candidates.spaces):
                continue
            for space in candidates.spaces:
                for task in range(len(space.starts)):
                    naive.listed(space, task, most)
        except (ProvedImpossible, naive.TooLarge):
            continue
        found.append(candidates)
        if len(found) == number:
            return found
    raise AssertionError("too few random models")


@pytest.mark.thorough
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(("robots", "most"), [(2, 40), (3, 14)])
def test_a_language_by_definition_with_a_true_bound(method: str, robots: int, most: int) -> None:
    """No failing tuple of plans shares a sentence; the bound is at most the least number of words."""
    for candidates in small(robots, most, 10):
        built = build_language(candidates, method, seed=3)
        language, guarantee = built.language, built.language.guarantee
        codec = candidates.model.codec
        names = ("", *language.words)
        word = [names.index(language.states.get(codec.key(row), "")) for row in candidates.rows]
        for space in candidates.spaces:
            for task in range(len(space.starts)):
                plans = naive.listed(space, task, most)
                for chosen in naive.failing(plans, robots):
                    said = {
                        naive.sentence([word[s] for s in naive.states(space, task, plan)])
                        for plan in chosen
                    }
                    assert len(said) > 1
        least = len(set(by_brute_force(built.job).partition.values()))
        assert 1 <= guarantee.lower_bound <= least <= guarantee.size == len(language.words)
        assert guarantee.proved_minimal == (guarantee.size == guarantee.lower_bound)
        assert build_language(candidates, method, seed=3).language == language, (
            "the same input, the same language"
        )
        assert guarantee.size > 1, "the models require coordination"


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("error", [OutOfTime("late"), OutOfMemory("full"), KeyboardInterrupt()])
def test_stopped_while_it_checks(
    method: str, error: BaseException, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A limit while a better partition is verified: the one before it is left."""
    candidates = all_tasks("grid", "gw1-2x2")
    check = Making.check
    checked: list[Assignment] = []

    def late(verified: Making, partition: Assignment) -> None:
        if checked:
            raise error
        checked.append(partition)
        check(verified, partition)

    monkeypatch.setattr(Making, "check", late)
    built = build_language(candidates, method)
    assert built.verdict.holds
    assert len(built.language.words) == len(set(checked[0].values()))
    assert built.stopped is (None if method == "greedy" else error), (
        "greedy finds one partition only"
    )
    assert not built.language.guarantee.proved_minimal


def test_every_method_is_a_job_in_and_an_outcome_out() -> None:
    job: Job = build_language(all_tasks("three-cells"), "greedy").job
    for method in METHODS.values():
        outcome = method(job)
        assert isinstance(outcome, Outcome)
        assert set(outcome.partition) == set(job.states)
