# SPDX-License-Identifier: GPL-3.0-or-later
"""Theorem 3 by definition: all failing tuples of plans separated, all partitions tried."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from itertools import combinations, islice

import pytest

from coordlang.commands.building import build_language
from coordlang.language.candidates import Candidates
from coordlang.required.composition_walk import DifferenceWalk
from coordlang.vocabulary.exhaustive import partitions
from tests.support import naive, slow, thorough
from tests.support.candidates import listed, small_candidates, states_of
from tests.support.domains import all_tasks

#: Pairs of states, all of which must be separated; and of several such groups one.
Group = frozenset[frozenset[int]]
Demand = frozenset[Group]


def demands(candidates: Candidates, most: int, *, beta: bool) -> set[Demand]:
    """What Theorem 3 asks, one demand for each failing tuple of plans."""
    found = set()
    for space, task, plans, _ in listed(candidates, most):
        for chosen in naive.failing(plans, space.robots):
            sequences = [naive.states(space, task, plan) for plan in chosen]
            found.add(frozenset(_demand(sequences, beta)))
    return found


def _demand(sequences: list[tuple[int, ...]], beta: bool) -> Iterator[Group]:
    differ = [n for n, here in enumerate(zip(*sequences, strict=True)) if len(set(here)) > 1]
    yield from _triples(sequences[0][differ[0] - 1], {s[differ[0]] for s in sequences})
    if beta and differ[-1] == len(sequences[0]) - 1:
        yield from (frozenset({frozenset(p)}) for p in combinations({s[-1] for s in sequences}, 2))
    elif beta:
        yield from _triples(sequences[0][differ[-1] + 1], {s[differ[-1]] for s in sequences})


def _triples(shared: int, others: set[int]) -> Iterator[Group]:
    for a, b in combinations(others, 2):
        yield frozenset({frozenset({shared, a}), frozenset({shared, b}), frozenset({a, b})})


def satisfies(word: dict[int, int], demand: Demand) -> bool:
    # A "pair" of one state (the shared state is also a next one) cannot be separated.
    return any(all(len({word[s] for s in p}) == len(p) == 2 for p in group) for group in demand)


def least(states: list[int], wanted: set[Demand]) -> int:
    for size in range(1, len(states) + 1):
        for words in partitions(len(states), size):
            word = dict(zip(states, words, strict=True))
            if all(satisfies(word, demand) for demand in wanted):
                return size
    raise AssertionError("all states apart separate everything")


@pytest.mark.parametrize("asynchronous", [False, *thorough(True)])
@pytest.mark.parametrize("written", [*thorough(True), False])
@pytest.mark.parametrize(
    ("robots", "most", "number"),
    [(2, 40, 5), (3, 14, 4), *slow((2, 40, 200), (3, 14, 100))],
)
def test_against_the_theorem(
    robots: int,
    most: int,
    number: int,
    written: bool,
    asynchronous: bool,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Least sizes with and without beta, the order of the methods; constraints written or asked."""
    if not written:
        monkeypatch.setattr(DifferenceWalk, "every", lambda *_: None)
    seen: Counter[tuple[int, ...]] = Counter()
    models = small_candidates(
        robots, states=7, plans=most, asynchronous=asynchronous, requires=True
    )
    for seed, candidates in islice(models, number):
        both, alpha = (demands(candidates, most, beta=b) for b in (True, False))
        states = states_of(candidates)
        full = build_language(candidates, "separating", seed=seed)
        first = build_language(candidates, "separating", alpha_only=True)
        for built, wanted in ((full, both), (first, alpha)):
            assert built.stopped is None
            size = built.language.guarantee.size
            assert size == least(states, wanted) == built.figures["separating_lower_bound"]
            table = built.language.partition(candidates.model).word_of(candidates.rows)
            word = {state: int(table[state]) for state in states}
            assert all(satisfies(word, demand) for demand in wanted)
        exhaustive, greedy = (
            build_language(candidates, method) for method in ("exhaustive", "greedy")
        )
        every = (exhaustive, full, first, greedy)
        sizes = tuple(built.language.guarantee.size for built in every)
        assert list(sizes) == sorted(sizes)
        seen[sizes] += 1
    assert any(a < b for a, b, _, _ in seen), "no model where the minimum is below Theorem 3's"
    assert any(b < c for _, b, c, _ in seen), "no model where beta helps"


@pytest.mark.parametrize(
    ("folder", "stem", "both", "alpha"),
    [
        ("three-cells", "problem", 3, 6),
        ("grid", "gw1-2x2", 6, 8),
        ("grid", "gw2-2x3", 7, 13),
        *thorough(("grid", "gwb2-3x3", 6, 8)),
    ],
)
def test_known_minima(folder: str, stem: str, both: int, alpha: int) -> None:
    """The running example needs 6 words under alpha alone and 3 under alpha or beta (the paper)."""
    candidates = all_tasks(folder, stem)
    for words, alpha_only in ((both, False), (alpha, True)):
        built = build_language(candidates, "separating", alpha_only=alpha_only)
        assert built.language.guarantee.size == words == built.figures["separating_lower_bound"]
