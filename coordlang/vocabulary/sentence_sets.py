# SPDX-License-Identifier: GPL-3.0-or-later
"""The sentences that can still be said from each node: plans walked in step are given up by them.

Sets of sentences are kept once each, like sets of label sequences: their moves are next words.
"""

from __future__ import annotations

import numpy as np

from coordlang.required.label_sets import END, LabelSets
from coordlang.vocabulary.leads import Leads
from planners.search.plan_space import PlanSpace
from planners.tables import Bools, Ints, unique_tuples

#: In place of a word where a sentence ends; word w is label w + 1.
_ENDS = 0
#: No sentence at all.
_NOTHING = -1


class SentenceSets:
    """For each node of a plan space the set of what plans from it say after the node's own word.

    Parameters
    ----------
    space
        The plan space.
    word
        (nodes) the word of each node.
    """

    def __init__(self, space: PlanSpace, word: Ints) -> None:
        self._sets = LabelSets()
        self._shared: dict[tuple[int, int], bool] = {}
        only_the_end = self._sets.of_moves({_ENDS: END})
        #: (nodes): the number of the set of sentences from a node.
        self.of_node: Ints = np.full(len(space), only_the_end, np.int64)
        for edges in space.edges_by_layer():
            of_edge = self.of_node[edges.target]
            said = np.flatnonzero(word[edges.source] != word[edges.target])
            ones = np.ones(len(said), np.int64)
            labels = word[edges.target[said]] + 1
            of_edge[said] = self._sets.sets(np.arange(len(said)), ones, labels, of_edge[said])
            # A node's sentences are those of all its edges.
            bounds = [len(space), len(self._sets)]
            rows, _ = unique_tuples(np.column_stack((edges.source, of_edge)), bounds)
            nodes, first, sizes = np.unique(rows[:, 0], return_index=True, return_counts=True)
            self.of_node[nodes] = self._sets.unions(first, sizes, rows[:, 1])

    def can_agree(self, nodes: Ints, leads: Ints, known: Leads) -> Bools:
        """Whether plan 1 and each other plan can still come to have one sentence.

        Parameters
        ----------
        nodes
            (k, plans): where the plans are.
        leads
            (k, plans - 1): how far plan 1 is ahead of each other one; ``known`` says what a number
            stands for.
        """
        agree = np.ones(len(nodes), np.bool_)
        for other in range(1, nodes.shape[1]):
            open_rows = np.flatnonzero(agree)
            lead = leads[open_rows, other - 1]
            first, second = (self.of_node[nodes[open_rows, plan]] for plan in (0, other))
            bounds = [int(lead.max(initial=0)) + 1, len(self._sets), len(self._sets)]
            table, number = unique_tuples(np.column_stack((lead, first, second)), bounds)
            answers = [self._agree(known.words(row[0]), row[1], row[2]) for row in table.tolist()]
            agree[open_rows] = np.array(answers, np.bool_)[number]
        return agree

    def _agree(self, lead: tuple[int, tuple[int, ...]], first: int, second: int) -> bool:
        """Whether a sentence of one set continues as one of the other, where one is ahead."""
        ahead, words = lead
        if ahead == 1:
            second = self._after(second, words)
        elif ahead == 2:
            first = self._after(first, words)
        return first != _NOTHING and second != _NOTHING and self._meet(first, second)

    def _after(self, number: int, words: tuple[int, ...]) -> int:
        """What may follow some words in a set."""
        for word in words:
            number = self._sets.moves(number).get(word + 1, _NOTHING)
            if number == _NOTHING:
                break
        return number

    def _meet(self, one: int, other: int) -> bool:
        """Whether two sets have a sentence in common."""
        if one == other:
            return True
        key = (one, other) if one < other else (other, one)
        known = self._shared.get(key)
        if known is None:
            theirs = self._sets.moves(other)
            known = self._shared[key] = any(
                word in theirs and self._meet(after, theirs[word])
                for word, after in self._sets.moves(one).items()
            )
        return known
