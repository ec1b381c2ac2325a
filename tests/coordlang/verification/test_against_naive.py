# SPDX-License-Identifier: GPL-3.0-or-later
"""Fast algorithms against their naive twins on random models with two and three robots."""

from __future__ import annotations

from collections.abc import Sequence
from random import Random
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from coordlang.language.candidates import Candidates, all_pairs, from_problems
from coordlang.language.partition import Partition
from coordlang.required.divergences import first_differences
from coordlang.required.miscoordination import inseparable, miscoordination
from coordlang.verification.by_definition import verify
from planners.search.plan_space import PlanSpace
from planners.system.errors import ProvedImpossible
from tests.support import naive
from tests.support.random_models import random_model

#: (robots, plans of one task that the twin lists at most, models)
SIZES = [
    (2, 60, 80),
    (3, 14, 80),
    pytest.param(2, 60, 600, marks=pytest.mark.slow),
    pytest.param(3, 14, 600, marks=pytest.mark.slow),
]


def models(number: int) -> settings:
    return settings(max_examples=number, deadline=None, derandomize=True)


def candidates_of(seed: int, robots: int) -> Candidates:
    """All pairs of states of a random model, or its one task with its partial goal."""
    domain, problem, options = random_model(seed, robots)
    try:
        make = all_pairs if seed % 3 else from_problems
        found = make(domain, [problem], options)
    except ProvedImpossible:
        assume(False)
        raise
    assume(0 < found.count <= 300)
    return found


def listable(candidates: Candidates, most: int) -> None:
    for space in candidates.spaces:
        for task in range(len(space.starts)):
            try:
                naive.listed(space, task, most)
            except naive.TooLarge:
                assume(False)


def naive_divergences(
    spaces: Sequence[PlanSpace], most: int
) -> tuple[set[tuple[int, frozenset[int]]], list[bool], bool]:
    """alpha* of all failing mixtures, which tasks require coordination, and whether some plans are
    inseparable.
    """
    found, requires, same_states = set(), [], False
    for space in spaces:
        for task in range(len(space.starts)):
            any_failure = False
            for chosen in naive.failing(naive.listed(space, task, most), len(space.model.robots)):
                any_failure = True
                where = naive.divergence([naive.states(space, task, plan) for plan in chosen])
                if where is None:
                    same_states = True
                else:
                    found.add(where)
            requires.append(any_failure)
    return naive.minimal(found), requires, same_states


@pytest.mark.parametrize(("robots", "most", "number"), SIZES)
def test_walk_equals_listing(robots: int, most: int, number: int) -> None:
    seen = {"required": 0, "inseparable": 0, "compared": 0}

    @models(number)
    @given(st.integers(0, 10**9))
    def compare(seed: int) -> None:
        candidates = candidates_of(seed, robots)
        listable(candidates, most)
        expected, requires, same_states = naive_divergences(candidates.spaces, most)
        witnesses = [
            miscoordination(space, task)
            for space in candidates.spaces
            for task in range(len(space.starts))
        ]
        assert [w is not None for w in witnesses] == requires
        assert any(inseparable(space) is not None for space in candidates.spaces) == same_states
        seen["compared"] += 1
        seen["required"] += any(requires)
        seen["inseparable"] += same_states
        if not same_states:
            found = first_differences(candidates.spaces)
            assert found.requiring == sum(requires)
            table = {
                (last, frozenset(s for s in after if s >= 0))
                for last, after in zip(
                    found.divergences.last.tolist(),
                    found.divergences.following.tolist(),
                    strict=True,
                )
            }
            assert table == expected

    compare()
    # The comparison is worth something only if both answers occur.
    assert seen["required"] >= number // 10
    assert seen["inseparable"] >= number // 40
    assert seen["compared"] - seen["required"] >= number // 10


@pytest.mark.parametrize(("robots", "most", "number"), SIZES)
def test_verify_equals_definition(robots: int, most: int, number: int) -> None:
    seen = {True: 0, False: 0}

    @models(number)
    @given(st.integers(0, 10**9))
    def compare(seed: int) -> None:
        candidates = candidates_of(seed, robots)
        listable(candidates, most)
        random = Random(seed)
        size = random.randint(1, 4)
        word = np.array([random.randrange(size) for _ in candidates.rows])
        table = Partition(tuple(f"w{n}" for n in range(size)), candidates.rows, word, 0)
        expected = all(
            naive.is_language(space, dict(enumerate(word.tolist())), most)
            for space in candidates.spaces
        )
        verdict = verify(table, candidates.spaces)
        assert verdict.holds == expected
        seen[expected] += 1
        if not expected:
            check_witness(candidates, table, verdict.witness)

    compare()
    assert min(seen.values()) >= number // 10


def check_witness(candidates: Candidates, table: Partition, witness: Any) -> None:
    """The shown plans are optimal, have one sentence, and their mixture is no plan."""
    model = candidates.model
    plans = tuple(
        tuple(naive.known(model.numbers(step)) for step in plan) for plan in witness.plans
    )
    for space in candidates.spaces:
        for task in range(len(space.starts)):
            all_plans = naive.listed(space, task, 10**6)
            if not set(plans) <= set(all_plans) or naive.mixture(plans) in all_plans:
                continue
            words = table.word_of(space.rows)
            sentences = {
                naive.sentence([int(words[s]) for s in naive.states(space, task, p)]) for p in plans
            }
            if len(sentences) == 1:
                return
    raise AssertionError("no task has these plans with one sentence and a failing mixture")
