# SPDX-License-Identifier: GPL-3.0-or-later
"""The next two words that plans from each node can say: plans walked in step are given up by them.

What two plans can say next has to meet where they are to have one sentence.  Two words say nearly
as much as whole sentences, and are found for all nodes at once.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from coordlang.vocabulary.leads import Leads
from planners.joint.tables import Bools, Ints
from planners.search.plan_space import PlanSpace

#: Words that are told apart; of more, those with one remainder count as one.
_MOST_WORDS = 62
#: Rows of nodes handled at a time.
_PIECE = 1 << 18

_Masks = NDArray[np.uint64]


class NextWords:
    """What plans from each node of a plan space can say next, after the node's own word.

    ``_second[x, w]`` are the words (bits) that can follow word ``w`` where it is what is said next
    from ``x``; none where it cannot be.  The end of a sentence counts as a word.  O(edges x words).

    Parameters
    ----------
    space
        The plan space.
    word
        (nodes) the word of each node.
    """

    def __init__(self, space: PlanSpace, word: Ints) -> None:
        words = int(word.max(initial=0)) + 1
        self._words = min(words, _MOST_WORDS)
        self._bits = np.uint64(1) << np.arange(self._words + 1, dtype=np.uint64)
        own = word % self._words
        self._second: _Masks = np.zeros((len(space), self._words + 1), np.uint64)
        #: (nodes): the words (bits) that can be said next.
        self._first: _Masks = np.zeros(len(space), np.uint64)
        if len(space):
            goals = space.layers[0]
            self._second[goals, self._words] = self._first[goals] = self._bits[self._words]
        for edges in space.edges_by_layer():
            said = word[edges.source] != word[edges.target]
            of_edge = self._second[edges.target]
            of_edge[said] = 0
            target = edges.target[said]
            of_edge[np.flatnonzero(said), own[target]] = self._first[target]
            nodes, first = np.unique(edges.source, return_index=True)
            self._second[nodes] = np.bitwise_or.reduceat(of_edge, first, axis=0)
            self._first[nodes] = ((self._second[nodes] != 0) * self._bits).sum(
                axis=1, dtype=np.uint64
            )

    def can_agree(self, nodes: Ints, leads: Ints, known: Leads) -> Bools:
        """Whether plan 1 and each other plan can go on with the same words.

        True wherever they can come to have one sentence.

        Parameters
        ----------
        nodes
            (k, plans): where the plans are.
        leads
            (k, plans - 1): how far plan 1 is ahead of each other one; ``known`` says what a number
            stands for.
        """
        agree = np.ones(len(nodes), np.bool_)
        beginnings = known.beginnings()
        for other in range(1, nodes.shape[1]):
            left = np.flatnonzero(agree)
            for low in range(0, len(left), _PIECE):
                rows = left[low : low + _PIECE]
                lead = beginnings[leads[rows, other - 1]]
                agree[rows] = self._pairs_agree(nodes[rows, 0], nodes[rows, other], lead)
        return agree

    def _pairs_agree(self, one: Ints, other: Ints, lead: Ints) -> Bools:
        """For two plans; ``lead`` (k, 3): which is ahead, 1, 2 or 0, and by which words first."""
        agree = np.zeros(len(one), np.bool_)
        even = np.flatnonzero(lead[:, 0] == 0)
        agree[even] = ((self._second[one[even]] & self._second[other[even]]) != 0).any(axis=1)
        uneven = np.flatnonzero(lead[:, 0] > 0)
        first_leads = lead[uneven, 0] == 1
        ahead = np.where(first_leads, one[uneven], other[uneven])
        behind = np.where(first_leads, other[uneven], one[uneven])
        follows = self._second[behind, lead[uneven, 1] % self._words]
        second = lead[uneven, 2]
        # Ahead by one word: what it says next has to come second; by more, the second one.
        wanted = np.where(second < 0, self._first[ahead], self._bits[second % self._words])
        agree[uneven] = (follows & wanted) != 0
        return agree
