# SPDX-License-Identifier: GPL-3.0-or-later
"""What every way to a language must do; a new one in `METHODS` is tested by being there."""

from __future__ import annotations

from itertools import islice

import pytest

from coordlang.commands.building import Making, build_language
from coordlang.vocabulary import METHODS
from coordlang.vocabulary.job import Assignment
from planners.system.errors import OutOfMemory, OutOfTime
from tests.support import naive
from tests.support.candidates import requiring, small_candidates
from tests.support.domains import all_tasks


@pytest.mark.thorough
@pytest.mark.parametrize(("robots", "most"), [(2, 40), (3, 14)])
def test_a_language_by_definition_with_a_true_bound(robots: int, most: int) -> None:
    """On random models that require coordination; the bound is at most the least number of words."""
    models = small_candidates(robots, states=6, plans=most, tasks=60)
    for candidates in islice((found for _, found in models if requiring(found)), 10):
        least = build_language(candidates, "exhaustive").language.guarantee.size
        for method in METHODS:
            language = build_language(candidates, method, seed=3).language
            word = language.partition(candidates.model).word_of(candidates.rows).tolist()
            for space in candidates.spaces:
                assert naive.is_language(space, dict(enumerate(word)), most), method
            guarantee = language.guarantee
            assert 1 <= guarantee.lower_bound <= least <= guarantee.size == len(language.words) > 1
            assert guarantee.proved_minimal == (guarantee.size == guarantee.lower_bound)
            again = build_language(candidates, method, seed=3).language
            assert again == language, "the same input, the same language"


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
