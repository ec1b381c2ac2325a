# SPDX-License-Identifier: GPL-3.0-or-later
"""``--prefer simple`` against all languages and all formulas."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from itertools import product

import pytest

from coordlang.commands.building import Built, build_language
from coordlang.explanation.simple import _Search, simple
from coordlang.explanation.variables import valuation
from coordlang.explanation.words import mapped_states
from coordlang.vocabulary.job import Assignment, Outcome
from coordlang.vocabulary.loop import Budget
from planners.system.errors import OutOfTime
from tests.support.candidates import failing, is_language, partitions, small_worlds
from tests.support.domains import all_tasks

Lengths = tuple[int, int]
Box = tuple[frozenset[int], ...]


def boxes(sizes: Sequence[int]) -> list[Box]:
    """All terms: for each variable a set of values, not empty."""
    sets = [
        [frozenset(v for v in range(size) if chosen >> v & 1) for chosen in range(1, 2**size)]
        for size in sizes
    ]
    return list(product(*sets))


def shortest_formulas(values: list[tuple[int, ...]], sizes: Sequence[int]) -> dict[int, Lengths]:
    """For each set of states (bits) the fewest terms, then limits, that hold in just these."""
    of_set: dict[int, int] = {}
    for box in boxes(sizes):
        held = sum(
            1 << n
            for n, value in enumerate(values)
            if all(v in allowed for v, allowed in zip(value, box, strict=True))
        )
        limits = sum(len(own) < size for own, size in zip(box, sizes, strict=True))
        of_set[held] = min(limits, of_set.get(held, limits))
    best: dict[int, Lengths] = {0: (0, 0)}
    for target in range(1, 2 ** len(values)):
        inside = {held: limits for held, limits in of_set.items() if held and not held & ~target}
        # The fewest terms for each part of the target, a term at a time.
        covered: dict[int, Lengths] = {0: (0, 0)}
        layer = {0: (0, 0)}
        while layer and target not in covered:
            following: dict[int, Lengths] = {}
            for part, (terms, limits) in layer.items():
                for held, more in inside.items():
                    both, length = part | held, (terms + 1, limits + more)
                    if both not in covered and length < following.get(both, (99, 99)):
                        following[both] = length
            covered |= following
            layer = following
        best[target] = covered[target]
    return best


def length(word: Assignment, states: list[int], shortest: dict[int, Lengths]) -> Lengths:
    """The formulas of all words but one, whichever is best."""
    lengths = [
        shortest[sum(1 << n for n, state in enumerate(states) if word[state] == name)]
        for name in set(word.values())
    ]
    terms, limits = (sum(own) for own in zip(*lengths, strict=True))
    return min((terms - own[0], limits - own[1]) for own in lengths)


@cache
def by_trying_all(number: int) -> tuple[Lengths, list[int], dict[int, Lengths]]:
    """The shortest formulas of any smallest language of a small world."""
    candidates = small_worlds(6)[number]
    built = build_language(candidates, "minimal")
    size, states = built.language.guarantee.size, list(built.job.states)
    variables, value = valuation(candidates.model, candidates.rows[states])
    sizes = [len(variable.values) for variable in variables]
    shortest = shortest_formulas([tuple(row) for row in value.tolist()], sizes)
    bad = failing(candidates)
    languages = [w for w in partitions(states, size) if is_language(w, bad)]
    return min(length(word, states, shortest) for word in languages), states, shortest


@pytest.mark.parametrize(
    "number", [3, *(pytest.param(n, marks=pytest.mark.thorough) for n in range(10))]
)
def test_shortest_by_trying_all(number: int) -> None:
    candidates = small_worlds(6)[number]
    best, states, shortest = by_trying_all(number)
    built = build_language(candidates, "minimal", prefer="simple")
    figures = built.figures
    assert (figures["terms"], figures["limits"]) == best
    assert (figures["terms_lower_bound"], figures["limits_lower_bound"]) == best
    assert (figures["terms_before"], figures["limits_before"]) >= best
    word = built.language.partition(candidates.model).word_of(candidates.rows).tolist()
    assert length({s: word[s] for s in states}, states, shortest) == best
    assert built.verdict.holds
    assert built.language.guarantee.proved_minimal


@cache
def two_rows() -> Built:
    return build_language(all_tasks("grid", "gw2-2x3"), "minimal")


@pytest.mark.parametrize("phase", ["terms", "limits"])
def test_stopped_searches_return_languages(phase: str, monkeypatch: pytest.MonkeyPatch) -> None:
    candidates, built = all_tasks("grid", "gw2-2x3"), two_rows()
    word = built.language.partition(candidates.model).word_of(candidates.rows).tolist()
    found = Outcome({s: word[s] for s in built.job.states}, 5)
    checked: list[Assignment] = []

    finds = _Search._finds

    def late(self: _Search, terms: int, limits: int | None, budget: Budget) -> bool:
        if (phase == "terms") == (limits is None):
            raise OutOfTime("late")
        return finds(self, terms, limits, budget)

    monkeypatch.setattr(_Search, "_finds", late)
    outcome = simple(replace(built.job, check=checked.append), found)
    assert isinstance(outcome.stopped, OutOfTime)
    assert outcome.partition is (checked[-1] if checked else found.partition)
    assert outcome.figures["terms_lower_bound"] <= 4 <= outcome.figures["terms"]
    assert (phase == "limits") == bool(checked)


def test_a_search_gives_up(monkeypatch: pytest.MonkeyPatch) -> None:
    """With no conflicts to spend: the formulas that there were, and a bound that is true."""
    candidates, built = all_tasks("grid", "gw2-2x3"), two_rows()
    mapped = mapped_states(built.language, candidates.model)
    found = Outcome(dict(zip(built.job.states, mapped.word.tolist(), strict=True)), 5)
    monkeypatch.setattr("coordlang.explanation.simple._CONFLICTS", 0)
    outcome = simple(built.job, found)
    assert outcome.stopped is None
    assert outcome.partition is found.partition
    assert outcome.figures["terms"] == outcome.figures["terms_before"]
    assert outcome.figures["terms_lower_bound"] == 4
