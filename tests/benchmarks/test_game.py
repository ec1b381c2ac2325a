# SPDX-License-Identifier: GPL-3.0-or-later
"""The coordination game: closed forms against all games played out."""

from __future__ import annotations

from fractions import Fraction
from itertools import combinations, permutations
from random import Random
from statistics import fmean

import pytest

from benchmarks.paper.game import expected_for_plans, expected_for_sentences, play


def all_games(sizes: tuple[int, ...], liked: int) -> tuple[Fraction, Fraction]:
    """Mean proposals over all liked sets and all orders, by definition."""
    owner = [s for s, n in enumerate(sizes) for _ in range(n)]
    by_plan, by_sentence = [], []
    for likes in combinations(range(len(owner)), liked):
        accepted = {owner[p] for p in likes}
        by_plan += [
            1 + next(n for n, p in enumerate(order) if p in likes)
            for order in permutations(range(len(owner)))
        ]
        orders = permutations(range(len(sizes)))
        by_sentence += [
            1 + next(n for n, s in enumerate(order) if s in accepted) for order in orders
        ]
    return Fraction(sum(by_plan), len(by_plan)), Fraction(sum(by_sentence), len(by_sentence))


@pytest.mark.parametrize("sizes", [(1,), (3,), (2, 2), (3, 2, 1), (1, 1, 1, 1), (4, 1, 1)])
def test_expectations(sizes: tuple[int, ...]) -> None:
    for liked in range(1, sum(sizes) + 1):
        ours = expected_for_plans(sum(sizes), liked), expected_for_sentences(sizes, liked)
        assert ours == all_games(sizes, liked)


def test_games_played() -> None:
    random = Random(1)
    games = [play((3, 2, 1), 2, random) for _ in range(4000)]
    for what, expected in enumerate(
        (expected_for_plans(6, 2), expected_for_sentences((3, 2, 1), 2))
    ):
        assert fmean(game[what] for game in games) == pytest.approx(float(expected), rel=0.05)
    assert play((1,), 5, random) == (1, 1)  # it likes all there are
