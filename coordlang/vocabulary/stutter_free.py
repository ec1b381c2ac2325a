# SPDX-License-Identifier: GPL-3.0-or-later
"""Stutter-free partitions: every step of every optimal plan of a task enters another word.

All optimal plans of a task have equally many steps.  So under such a partition two of them have one
sentence iff they are in one word after each step, and of all warping paths of a failing tuple only
the one that goes step by step is left: one clause rules the tuple out, where any partition may need
one for each path.  On published tasks languages of this kind are found with a tenth of the words
(Proposition 27 of docs/concepts.md).  That there is none says nothing of other partitions.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np

from coordlang.language.warping import Pair, pair
from planners.search.plan_space import PlanSpace

#: In the order of words for a state: to be in the word of a state before costs more than any number
#: of states beside it.
_FORBIDDEN = 1 << 30


@dataclass(frozen=True)
class StutterFree:
    """What stutter-free partitions of the states of a plan space of one task have in common."""

    space: PlanSpace

    @cached_property
    def pairs(self) -> list[Pair]:
        """The pairs of states that some step joins: each lies in different words."""
        space = self.space
        before, after = space.state[space.sources], space.state[space.targets()]
        joined = np.unique(np.column_stack((before, after))[before != after], axis=0)
        return sorted({pair(a, b) for a, b in joined.tolist()})

    def preferred(self, size: int) -> dict[int, int]:
        """For each state the word, of ``size``, that tells it apart best from those beside it.

        Beside a state are those that a step leads to from a state before it.  From the start on,
        each state gets the word that fewest of them have, and of these the one that was used least.
        """
        space = self.space
        targets = space.targets()
        below = [targets[a:b].tolist() for a, b in pairwise(space.first.tolist())]
        above: list[list[int]] = [[] for _ in below]
        for node, following in enumerate(below):
            for target in following:
                above[target].append(node)
        word = np.full(len(space), size)
        beside = np.zeros((len(space), size + 1), np.int64)  # by node the words of what follows it
        used = np.zeros(size, np.int64)
        for node in np.argsort(-space.layer, kind="stable").tolist():
            taken = beside[above[node]].sum(axis=0)
            np.add.at(taken, word[above[node]], _FORBIDDEN)
            word[node] = np.lexsort((used, taken[:size]))[0]
            used[word[node]] += 1
            np.add.at(beside, (above[node], word[node]), 1)
        return dict(zip(space.state.tolist(), word.tolist(), strict=True))
