# SPDX-License-Identifier: GPL-3.0-or-later
"""Tuples of two robots' plans that refute a partition, by a walk along plans in step.

Where two robots have many tasks in a small space the walk is several times as fast as sets
(`coordlang.vocabulary.counterexamples`), since it handles all tasks at once; for more robots it is
hopeless.  It keeps, for every node, the way to a violation with the fewest steps at which the plans
are in different states: such pairs give short clauses.  It is cut off where no mixture can fail,
whatever the words are (Proposition 14 of docs/concepts.md), and where sentences part.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from coordlang.required.choices import Choices
from coordlang.required.composition_walk import can_fail, layered, moves
from coordlang.vocabulary.spoken_choices import Words
from planners.joint.tables import Ints, of_each_row
from planners.search.edge_index import EdgeIndex

#: The lead of two sentences that are alike, what follows where they part, and in place of a word
#: where a plan goes on in the word where it is.
_NO_LEAD, _PARTED, _NO_WORD = 0, -1, -1
#: Where no way leads to a violation; some steps may be added to it.
_FAR = np.iinfo(np.int64).max // 4
#: Random ways to a violation that are taken from one start at most.
_RANDOM_WAYS = 40
#: So many failing tuples are always wanted: a walk finds many in one go.
_LEAST = 20_000


@dataclass(frozen=True, slots=True)
class _Layer:
    """Nodes of the walk with equally many steps to go, one or more.

    A node is ``(x_1, x_2, y or failed, lead)``, failed as the number of nodes of the plan space.
    Each move has the plans' ``edges``, and in ``child`` the row of the node that it leads to, one
    layer below.  Each node has in ``best`` the fewest steps at which the plans are in different
    states on a way to a violation, in ``choice`` the move that begins it.  ``open_moves`` are all
    that begin some way, and ``first`` (nodes + 1) delimits those of each node.
    """

    nodes: Ints
    edges: Ints
    child: Ints
    best: Ints
    choice: Ints
    open_moves: Ints
    first: Ints

    @classmethod
    def of(cls, nodes: Ints, links: Ints, child: Ints, below: Ints) -> _Layer:
        """A layer; ``links``: the rows of the moves' nodes and their edges, ``below``: `best`."""
        source, value = links[:, 0], below[child]
        best = np.full(len(nodes), _FAR)
        np.minimum.at(best, source, value)
        choice = np.full(len(nodes), -1)
        tight = np.flatnonzero((value == best[source]) & (value < _FAR))
        choice[source[tight][::-1]] = tight[::-1]
        open_moves = np.flatnonzero(value < _FAR)
        first = np.searchsorted(source[open_moves], np.arange(len(nodes) + 1))
        best = np.where(best < _FAR, best + (nodes[:, 0] != nodes[:, 1]), _FAR)
        return cls(nodes, links[:, 1:], child, best, choice, open_moves, first)

    def moves(self, rows: Ints, random: np.random.Generator | None) -> Ints:
        """A move of each of these nodes: that of the best way, or one that begins some way."""
        if random is None:
            return self.choice[rows]
        return self.open_moves[random.integers(self.first[rows], self.first[rows + 1])]


class CounterexampleWalk:
    """Finds failing tuples of two robots' plans, of their choices, that have one sentence."""

    def __init__(self, choices: Choices) -> None:
        self._choices, self._space = choices, choices.space
        self._index = EdgeIndex.of(choices.space)

    def failing(self, word: Ints, most: int, ways: int = 1, steps: int = sys.maxsize) -> list[Ints]:
        """See `Mixtures.failing`: the fewest differences, and drawn ones, whatever ``steps``."""
        layers, most = self._layers(word), max(most, _LEAST)
        # Columns: fewest steps at which the plans differ, steps to go, row of the layer.
        starts = [np.zeros((0, 3), np.int64)]
        for number, layer in enumerate(layers, 1):
            x = layer.nodes[:, :3]
            diagonal = (x == x[:, :1]).all(axis=1) & (layer.nodes[:, 3] == _NO_LEAD)
            hit = np.flatnonzero(diagonal & (layer.best < _FAR))
            starts.append(np.column_stack((layer.best[hit], np.full(len(hit), number), hit)))
        table = np.concatenate(starts)
        table = table[np.lexsort(table.T[::-1])][:most]
        if not len(table):
            return []
        # Few starts: more ways to a violation from each, drawn at random (always the same ones).
        random = np.random.default_rng(0)
        repeated = min(ways * _RANDOM_WAYS, most // len(table) - 1)
        found = []
        for number in np.unique(table[:, 1]).tolist():
            rows = table[table[:, 1] == number, 2]
            found.append(self._follow(layers[number - 1 :: -1], rows, None))
            if repeated > 0:
                rows = np.repeat(rows, repeated)
                found.append(self._follow(layers[number - 1 :: -1], rows, random))
        return found

    def _layers(self, word: Ints) -> list[_Layer]:
        """The nodes from which some mixture can fail and the plans' sentences can agree."""
        space = self._space
        before, after = word[space.sources], word[space.targets()]
        #: (edges): the word that a plan enters, `_NO_WORD` where it goes on in its word.
        entered = np.where(before == after, _NO_WORD, after)
        leads, links = _Leads(), list[Ints]()

        def expand(nodes: Ints) -> Ints:
            # Columns: the node, the edges of the plans, the node that they lead to.
            found = [np.zeros((0, 7), np.int64)]
            for source, edges, targets in moves(space, self._index, nodes[:, :3]):
                lead = leads.after(nodes[source, 3], *entered[edges].T)
                rows = np.column_stack((source, edges, targets, lead))
                rows = rows[lead != _PARTED]
                found.append(rows[can_fail(self._choices, rows[:, 3:6])])
            together = np.concatenate(found)
            links.append(together[:, :3])
            return together[:, 3:]

        starts = np.unique(space.starts)
        begin = starts[self._choices.requires[starts]]
        tables, children = zip(*layered(space, begin, 4, expand), strict=True)
        bad = (tables[-1][:, 2] == len(space)) & (tables[-1][:, 3] == _NO_LEAD)
        best, layers = np.where(bad, 0, _FAR), list[_Layer]()
        for nodes, own, child in zip(tables[-2::-1], links[::-1], children[:0:-1], strict=True):
            layers.append(_Layer.of(nodes, own, child, best))
            best = layers[-1].best
        return layers

    def _follow(
        self, layers: Sequence[_Layer], rows: Ints, random: np.random.Generator | None
    ) -> Ints:
        """Ways from nodes of the first layer on: the best, or at each node any move of a way."""
        edges = np.empty((len(rows), len(layers), 2), np.int64)
        for step, layer in enumerate(layers):
            move = layer.moves(rows, random)
            edges[:, step] = layer.edges[move]
            rows = layer.child[move]
        return edges


class _Leads:
    """Leads: the words by which one plan's sentence is ahead of another's, numbered as met.

    A lead is the words of the first plan that the second one has not entered yet, and those of the
    second one that the first one has not: `_NO_LEAD` where both have none.
    """

    def __init__(self) -> None:
        self._leads: list[tuple[Words, Words]] = [((), ())]
        self._number = {self._leads[_NO_LEAD]: _NO_LEAD}

    def after(self, lead: Ints, first: Ints, second: Ints) -> Ints:
        """The leads when the plans enter words ``first`` and ``second``, or `_NO_WORD`.

        `_PARTED` where their sentences part.  One entry for each of ``lead``.
        """
        return of_each_row(np.column_stack((lead, first + 1, second + 1)), self._after)

    def _after(self, lead: int, first: int, second: int) -> int:
        """The same for one lead, with 1 added to the words."""
        mine, theirs = map(_entered, self._leads[lead], (first - 1, second - 1))
        shared = min(len(mine), len(theirs))
        if mine[:shared] != theirs[:shared]:
            return _PARTED
        rest = mine[shared:], theirs[shared:]
        if rest not in self._number:
            self._number[rest] = len(self._leads)
            self._leads.append(rest)
        return self._number[rest]


def _entered(words: Words, word: int) -> Words:
    return words if word == _NO_WORD else (*words, word)
