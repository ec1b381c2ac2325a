# SPDX-License-Identifier: GPL-3.0-or-later
"""The demands that a partition breaks, drawn from a walk, against all of them by Theorem 3.

That `every` has all demands is tested with the separating partitions.
"""

from __future__ import annotations

from collections import Counter
from itertools import combinations
from random import Random

import numpy as np
import pytest

from coordlang.language.partition import Partition
from coordlang.required.composition_walk import Difference, DifferenceWalk
from coordlang.verification.by_definition import verify
from planners.joint.tables import Ints
from tests.support.random_spaces import runs, separable_spaces


def left_together(difference: Difference, word: Ints) -> bool:
    """No two of the states and the shared one lie in three words; where none is shared, in two."""
    shared, *states = difference
    needed = 3 - (shared < 0)
    common = set() if shared < 0 else {int(word[shared])}
    return all(len({*word[[*two]].tolist()} | common) < needed for two in combinations(states, 2))


@pytest.mark.parametrize(("robots", "seeds"), runs(60, 30, 20))
def test_the_demands_that_a_partition_breaks(robots: int | None, seeds: range) -> None:
    random = Random(seeds.start)
    answers: Counter[bool] = Counter()
    for space in separable_spaces(seeds, robots):
        walk = DifferenceWalk(space)
        every = walk.every(10**6)
        assert every is not None
        for words in (1, 2, 3):
            word = np.array([random.randrange(words) for _ in space.rows], np.int64)
            left = {pair for pair in every if all(left_together(one, word) for one in pair)}
            broken = {*walk.unseparated(word, np.random.default_rng(words))}
            assert broken <= left
            assert {first for first, _ in broken} == {first for first, _ in left}
            table = Partition(("w0", "w1", "w2"), space.rows, word, 0)
            assert broken or verify(table, [space]).holds
        answers[bool(every)] += 1
    assert min(answers[True], answers[False]) >= 3
