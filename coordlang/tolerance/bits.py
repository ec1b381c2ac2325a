# SPDX-License-Identifier: GPL-3.0-or-later
"""How many bits are said: the entropy of the sentence of a task's plan, drawn uniformly."""

from __future__ import annotations

from collections.abc import Sequence
from math import log2

import numpy as np

from coordlang.language.flexibility import Floats
from coordlang.language.sentences import sentence_counts
from planners.search.plan_space import PlanSpace
from planners.search.plans import counts
from planners.tables import Ints


def sentence_bits(spaces: Sequence[PlanSpace], words: Sequence[Ints]) -> Floats:
    """For each task the entropy ``sum_s n_s / N * log2(N / n_s)`` over its sentences, in bits.

    Parameters
    ----------
    spaces
        The plan spaces of the tasks.
    words
        For each the word number of each node.
    """
    found: list[float] = []
    for space, word in zip(spaces, words, strict=True):
        said = sentence_counts(space, word)
        for start in space.starts.tolist():
            sizes = said[start].values()
            total = sum(sizes)
            found.append(sum(n / total * (log2(total) - log2(n)) for n in sizes))
    return np.array(found, np.float64)


def plan_bits(spaces: Sequence[PlanSpace]) -> Floats:
    """For each task ``log2 N``, the bits that say which of its N plans is meant."""
    return np.array(
        [
            log2(counted[start])
            for space in spaces
            for counted in (counts(space),)
            for start in space.starts.tolist()
        ],
        np.float64,
    )
