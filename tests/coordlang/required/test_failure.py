# SPDX-License-Identifier: GPL-3.0-or-later
"""Failure probabilities, counted, against their definition on listed plans."""

from __future__ import annotations

from collections import Counter
from fractions import Fraction
from itertools import product
from random import Random

import numpy as np
import pytest

from coordlang.execution.task_language import TaskLanguage
from coordlang.language.sentences import sentence_counts
from coordlang.required.failure import (
    TooManyToCount,
    estimated_failure,
    failure_of_sentence,
    failure_probability,
)
from tests.support import naive
from tests.support.domains import all_tasks, own_task
from tests.support.naive import TooLarge
from tests.support.random_spaces import random_spaces

#: Plans of a task up to which they are listed, by the number of robots.
MOST = {2: 40, 3: 12, 4: 7}


def compared(seeds: range, robots: int) -> Counter[str]:
    """Compare silence and random words with the definition; what the answers were."""
    seen: Counter[str] = Counter()
    for number, (_, space) in enumerate(random_spaces(seeds, robots, 3_000)):
        random = Random(number)
        states = range(int(space.state.max()) + 1)
        for words in (1, 2, 3):
            word = np.array([random.randrange(words) for _ in states])
            (found,) = [failure_probability([space], [word[space.state] if words > 1 else None])]
            for task, probability in enumerate(found.tasks):
                try:
                    twin = naive.failure(space, task, word.tolist(), MOST[robots])
                except TooLarge:
                    continue
                assert probability == twin
                kind = "none" if not twin else "all" if twin == 1 else "some"
                seen[f"{kind} in {'silence' if words == 1 else 'words'}"] += 1
        seen["models"] += 1
    return seen


@pytest.mark.parametrize(
    ("robots", "seeds"),
    [
        (2, range(40)),
        (3, range(25)),
        pytest.param(2, range(1_000, 1_800), marks=pytest.mark.slow),
        pytest.param(3, range(2_000, 2_800), marks=pytest.mark.slow),
        pytest.param(4, range(3_000, 3_300), marks=pytest.mark.slow),
    ],
)
def test_probabilities_equal_the_definition(robots: int, seeds: range) -> None:
    seen = compared(seeds, robots)
    assert seen["some in silence"] >= 10
    assert seen["some in words"] >= 10
    assert seen["none in words"] >= 10


def test_silence_on_the_smallest_maps() -> None:
    """Design figures: 7.58 % on the open 2x2 grid and 4.55 % on the T-shaped map, all pairs."""
    found = {
        name: failure_probability(spaces, [None] * len(spaces))
        for name, spaces in (
            ("grid", all_tasks("grid", "gw1-2x2").spaces),
            ("t-map", all_tasks("t-map").spaces),
        )
    }
    assert found["grid"].mean == Fraction(5, 66)
    assert found["t-map"].mean == Fraction(1, 22)
    assert found["grid"].worst == found["t-map"].worst == Fraction(1, 2)


def test_estimates_agree_with_the_count() -> None:
    """Drawn plans fail about as often as is counted: in silence, and under few words."""
    seen = []
    for candidates, words in product(
        (all_tasks("grid", "gw1-2x2"), own_task("grid", "three-robots-3x3")), ((0,), (0, 0, 1, 2))
    ):
        word = [np.array(words)[space.state % len(words)] for space in candidates.spaces]
        counted = failure_probability(candidates.spaces, word).mean
        drawn = estimated_failure(candidates.spaces, word, runs=700, seed=2)
        assert drawn.low <= counted <= drawn.high
        assert drawn.high - drawn.low < 0.08
        seen.append(counted)
    assert all(seen)
    assert len(set(seen)) == 4


def test_failures_of_one_sentence_make_up_those_of_all() -> None:
    """The mean over the sentences, each as often as it is said, is the task's probability."""
    (space,) = own_task("grid", "three-robots-3x3").spaces
    word = space.state % 3 // 2
    said = sentence_counts(space, word)[int(space.starts[0])]
    failures = []
    for words, plans in sorted(said.items()):
        used = TaskLanguage(None, None, space, 0, word, True)  # type: ignore[arg-type]
        fits = used.plans_with(words)
        failure = failure_of_sentence(space, int(space.starts[0]), fits)
        failures.append(Fraction(plans, said.total()) * failure)
    assert len(failures) > 1
    assert sum(failures) == failure_probability([space], [word]).mean > 0


def test_a_count_that_takes_too_long_is_given_up() -> None:
    space = own_task("grid", "corners-6x6").spaces[0]
    with pytest.raises(TooManyToCount, match="more than 500 additions"):
        failure_probability([space], [None], most=500)
    assert failure_probability([space], [None], most=2_000).mean > 0
