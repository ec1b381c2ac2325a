# SPDX-License-Identifier: GPL-3.0-or-later
"""What each word buys: bits against their definition, the curve on small worlds and on others'."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from itertools import product
from math import log2

import numpy as np
import pytest

from benchmarks.paper import silence
from benchmarks.paper.recipe import Record, Settings
from benchmarks.paper.silence import plan_bits, sentence_bits
from benchmarks.paper.suite import WORLDS
from planners.search.plans import Plan
from tests.support import naive
from tests.support.candidates import listed, on_graph
from tests.support.random_spaces import random_spaces


def test_bits_are_the_entropy_of_the_sentences() -> None:
    compared = 0
    for seed, (_, space) in enumerate(random_spaces(range(20), 2, 500)):
        word = np.random.default_rng(seed).integers(0, 3, int(space.state.max()) + 1)
        found = sentence_bits([space], [word[space.state]])
        whole = plan_bits([space])
        for task in range(len(space.starts)):
            try:
                plans = naive.listed(space, task, 30)
            except naive.TooLarge:
                continue
            said = Counter(
                naive.sentence([int(word[s]) for s in naive.states(space, task, plan)])
                for plan in plans
            )
            entropy = -sum(n / len(plans) * log2(n / len(plans)) for n in said.values())
            assert found[task] == pytest.approx(entropy)
            assert whole[task] == pytest.approx(log2(len(plans)))
            compared += len(said) > 1
    assert compared >= 10


def divisions(plans: list[Plan]) -> Iterator[list[list[Plan]]]:
    """All divisions of plans into sets."""
    if not plans:
        yield []
        return
    for rest in divisions(plans[1:]):
        yield [[plans[0]], *rest]
        for n, group in enumerate(rest):
            yield [*rest[:n], [plans[0], *group], *rest[n + 1 :]]


@pytest.mark.parametrize("robots", [2, 3])
def test_no_division_into_sets_that_mix_takes_fewer_bits(robots: int) -> None:
    """By trying all divisions; with two robots the bound is often met."""
    compared = met = 0
    for seed in range(40):
        candidates = on_graph(seed, robots)
        if candidates is None:
            continue
        bounds = silence.bits_bounds(candidates.spaces)
        for bound, (_, _, plans, _) in zip(bounds, listed(candidates), strict=True):
            if not 1 < len(plans) <= 6:
                continue
            good = set(plans)
            least = min(
                sum(len(group) / len(plans) * log2(len(plans) / len(group)) for group in division)
                for division in divisions(plans)
                if all(
                    {*map(naive.mixture, product(own, repeat=robots))} <= good for own in division
                )
            )
            assert bound <= least + 1e-9
            compared += least > 0
            met += least > 0 and bound == pytest.approx(least)
    assert compared >= 10
    assert met >= 5


def test_the_curve_of_the_smallest_grid() -> None:
    found = silence.curve(WORLDS["GW1"], seed=0)
    points = found["points"]
    assert [point["words"] for point in points] == [1, 2, 3]
    assert [point["mean"] for point in points] == [5 / 66, 5 / 132, 0]
    assert points[0]["bits"] == 0 < found["least_bits"] <= points[2]["bits"] < found["plan_bits"]
    units = silence.units(Settings(quick=True))
    records = [Record(unit.key, unit.parameters, "done", found) for unit in units]
    shown = silence.section(records)
    assert "| GW1 | 7.58* | 3.79* | 0* |" in str(shown.blocks[1])
    assert [figure.name for figure in shown.figures] == ["silence-words", "silence-bits"]
    assert all(figure.draw() for figure in shown.figures)
