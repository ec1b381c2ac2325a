# SPDX-License-Identifier: GPL-3.0-or-later
"""Last differences from a walk that goes only where mixtures fail, against the whole walk."""

from __future__ import annotations

from collections import Counter
from random import Random

import numpy as np
import pytest

from coordlang.required.last_differences import DifferenceWalk
from tests.support.difference_walk import UncutWalk
from tests.support.random_spaces import runs, separable_spaces


@pytest.mark.parametrize(("robots", "seeds"), runs(60, 30, 20))
def test_the_same_demands(robots: int | None, seeds: range) -> None:
    """All demands, and those that random partitions break, in the same order."""
    random = Random(seeds.start)
    answers: Counter[bool] = Counter()
    walked: Counter[str] = Counter()
    for space in separable_spaces(seeds, robots):
        walk, twin = DifferenceWalk(space), UncutWalk(space)
        assert (walk.nodes, walk.edges) == (twin.nodes, twin.edges)
        every = walk.every(10**6)
        assert every == twin.every(10**6)
        for words in (1, 2, 3):
            word = np.array([random.randrange(words) for _ in space.rows], np.int64)
            draws = [np.random.default_rng(words) for _ in range(2)]
            broken = list(walk.unseparated(word, draws[0]))
            assert broken == list(twin.unseparated(word, draws[1]))
            assert every is not None
            assert set(broken) <= set(every)
        answers[bool(every)] += 1
        walked.update(cut=walk.nodes, whole=twin.walked)
    print(f"{robots or 'any'} robots: {dict(answers)}, nodes {dict(walked)}")
    assert min(answers[True], answers[False]) >= 3
    assert walked["cut"] < walked["whole"]
