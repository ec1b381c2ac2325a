# SPDX-License-Identifier: GPL-3.0-or-later
"""Bounds from below and languages from above, in turns."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import pytest

from coordlang.commands.building import build_language
from coordlang.commands.built import Built
from coordlang.vocabulary.equivariant import EquivariantSearch
from coordlang.vocabulary.from_above import SearchFromAbove
from coordlang.vocabulary.job import Assignment, Outcome
from coordlang.vocabulary.minimal import minimal
from coordlang.vocabulary.problems_by_size import SolverBudget
from tests.support.domains import all_tasks


@pytest.fixture
def little_effort(monkeypatch: pytest.MonkeyPatch) -> None:
    """The search from below needs the one from above."""
    module = sys.modules["coordlang.vocabulary.minimal"]
    monkeypatch.setattr(module, "SolverBudget", partial(SolverBudget, rounds=1))


def plays(monkeypatch: pytest.MonkeyPatch, *turns: Sequence[Assignment]) -> None:
    """The search from above finds these languages, turn by turn."""
    left = [list(turn) for turn in turns]

    def turn(_search: SearchFromAbove, _lower: int, _upper: int) -> Iterator[Assignment]:
        yield from left.pop(0) if left else ()

    monkeypatch.setattr(SearchFromAbove, "turn", turn)


def built(stem: str, seed: int = 0) -> Built:
    return build_language(all_tasks("grid", stem), "minimal", seed=seed)


@pytest.mark.parametrize("seed", [0, 1])
def test_both_searches_close_the_bounds(little_effort: None, seed: int) -> None:
    found = built("gw2-2x3", seed)
    assert found.figures["equivariant_rounds"] > 0
    assert found.language.guarantee.size == found.language.guarantee.lower_bound == 5


def test_words_of_another_search_are_a_language_and_no_bound(
    little_effort: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    job = built("gw1-2x2").job
    words = {state: 7 - word for state, word in minimal(job).partition.items()}
    plans: list[list[list[Assignment]]] = [[], [[]], [[], [words]], [[words]]]
    for turns in plans:
        plays(monkeypatch, *turns)
        found = minimal(replace(job, incumbent=None))
        assert (found.size, found.lower_bound) == (3, 3)
        assert turns != [[words]] or found.partition == words


@pytest.mark.parametrize("finds", [True, False])
def test_symmetric_words_of_the_last_number_are_looked_for_from_below(
    little_effort: None, monkeypatch: pytest.MonkeyPatch, finds: bool
) -> None:
    """What they find ends the search; that they find nothing is no bound."""
    asked: list[tuple[int, int]] = []
    find = EquivariantSearch.find

    def told(search: EquivariantSearch, size: int, rounds: int) -> Assignment | None:
        asked.append((size, rounds))
        return find(search, size, rounds) if finds else None

    job = built("gw2-2x3").job
    monkeypatch.setattr(EquivariantSearch, "find", told)
    plays(monkeypatch)
    found = minimal(replace(job, incumbent=None))
    assert (found.size, found.lower_bound) == (5, 5)
    assert asked
    assert {size for size, _ in asked} <= {2, 3, 4, 5}
    assert [rounds for _, rounds in asked] == [500 << turn for turn in range(len(asked))]


def test_a_lie_from_above_is_not_believed(
    little_effort: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What is found is verified by definition before it is taken."""
    job = built("gw2-2x3").job
    plays(monkeypatch, [dict.fromkeys(job.states, 0)])
    with pytest.raises(AssertionError, match="no coordination language"):
        minimal(replace(job, incumbent=None))


def test_the_search_may_end_with_what_it_began_with(
    monkeypatch: pytest.MonkeyPatch, little_effort: None
) -> None:
    """A separating language with the fewest words, which is proved in later turns only.

    Then one that separates less is looked for.
    """
    job = built("gw1-2x2").job
    best = minimal(job).partition
    module = sys.modules["coordlang.vocabulary.minimal"]
    monkeypatch.setattr(module, "short_separating_search", lambda _: Outcome(best, 1))
    # What is quick is not decided from below alone.
    from_below, asked = module._Search._decide_from_below, list[int]()

    def later(search: Any, budget: SolverBudget) -> SolverBudget:
        asked.append(search.lower)
        return budget if len(asked) == 1 else from_below(search, budget)

    monkeypatch.setattr(module._Search, "_decide_from_below", later)
    found = minimal(job)
    assert len(asked) > 1
    assert (found.size, found.lower_bound) == (3, 3)
