# SPDX-License-Identifier: GPL-3.0-or-later
"""Tuples of two robots' plans that refute a partition, by a walk along plans in step.

Where two robots have many tasks in a small space the walk is several times as fast as sets
(`coordlang.vocabulary.counterexamples`), since it handles all tasks at once; for more robots it is
hopeless.  It keeps, for every node, the way to a violation with the fewest steps at which the plans
are in different states: such pairs give short clauses.  It is cut off where no mixture can fail,
whatever the words are (Proposition 14 of docs/concepts.md), and where sentences part.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from coordlang.required.choices import Choices
from coordlang.required.composition_walk import Moves, can_fail, layered, moves
from coordlang.vocabulary.counterexamples import Counterexamples
from planners.joint.tables import Bools, Ints
from planners.search.edge_index import EdgeIndex
from planners.search.plan_space import PlanSpace

#: The lead of two sentences that are alike, what follows where they part, and in place of a word
#: where a plan goes on in the word where it is.
_NO_LEAD, _PARTED, _NO_WORD = 0, -1, -1
#: Where no way leads to a violation; some steps may be added to it.
_FAR = np.iinfo(np.int64).max // 4
#: Random ways to a violation that are taken from one start at most.
_RANDOM_WAYS = 40


@dataclass(frozen=True, slots=True)
class _OpenMoves:
    """The moves of a layer that lead to a violation; ``first`` (nodes + 1) delimits each node's."""

    moves: Ints
    first: Ints

    @classmethod
    def of_layer(cls, layer: _Layer, leads: Bools) -> _OpenMoves:
        moves = np.flatnonzero(leads)
        return cls(moves, np.searchsorted(layer.source[moves], np.arange(len(layer.nodes) + 1)))

    def drawn(self, rows: Ints, random: np.random.Generator) -> Ints:
        """One of those of each of these nodes."""
        low, high = self.first[rows], self.first[rows + 1]
        drawn: Ints = self.moves[random.integers(low, high)]
        return drawn


@dataclass(slots=True)
class _Layer:
    """Nodes of the walk with equally many steps to go.

    A node is ``(x_1, x_2, y or failed, lead)``, failed as the number of nodes of the plan space.
    Each move has the row of its node in ``source``, the plans' ``edges``, and in ``child`` the row
    of the node that it leads to, one layer below.  Each node has in ``best`` the fewest steps at
    which the plans are in different states on a way to a violation, in ``choice`` the move that
    begins it, in ``open_moves`` all that do.
    """

    nodes: Ints
    source: Ints
    edges: Ints
    child: Ints
    best: Ints
    choice: Ints
    open_moves: _OpenMoves


class CounterexampleWalk:
    """Finds failing tuples of two robots' plans, of their choices, that have one sentence."""

    def __init__(self, choices: Choices) -> None:
        self._choices, self._index = choices, EdgeIndex.of(choices.space)

    def failing(self, word: Ints, most: int, ways: int = 1) -> list[Counterexamples]:
        """One table for a number of steps: the fewest differences, and drawn ones."""
        space = self._choices.space
        if not self._choices.requires[space.starts].any():
            return []
        layers = _Walk(self._choices, self._index, word).layers()
        _backward(space, layers)
        return _retrace(space, layers, most, ways * _RANDOM_WAYS)


class _Walk:
    """The nodes from which some mixture can fail and the plans' sentences can agree."""

    def __init__(self, choices: Choices, index: EdgeIndex, word: Ints) -> None:
        self._choices, self._index, self._space = choices, index, choices.space
        before, after = word[self._space.sources], word[self._space.targets()]
        #: (edges): the word that a plan enters, `_NO_WORD` where it goes on in its word.
        self._entered = np.where(before == after, _NO_WORD, after)
        self._leads = _Leads()

    def layers(self) -> list[_Layer]:
        """The nodes: ``layers[k]`` has k joint steps to go."""
        space = self._space
        starts = np.unique(space.starts)
        layers: list[_Layer] = []

        def expand(nodes: Ints) -> Ints:
            layer, arriving = self._expand(nodes)
            layers.append(layer)
            return arriving

        begin = starts[self._choices.requires[starts]]
        tables = list(layered(space, begin, 4, expand))
        for layer, (_, child) in zip(layers, tables[1:], strict=True):
            layer.child = child
        none = np.zeros(0, np.int64)
        layers.append(_layer(tables[-1][0], none, np.zeros((0, 2), np.int64)))
        layers.reverse()
        return layers

    def _expand(self, nodes: Ints) -> tuple[_Layer, Ints]:
        """A layer with the moves out of its nodes, and the nodes that they lead to."""
        sources: list[Ints] = [np.zeros(0, np.int64)]
        edges: list[Ints] = [np.zeros((0, 2), np.int64)]
        children: list[Ints] = [np.zeros((0, 4), np.int64)]
        for every in moves(self._space, self._index, nodes[:, :3]):
            move, leads = self._in_agreement(nodes, every)
            targets = move.targets(self._space)
            fails = can_fail(self._choices, targets)
            sources.append(move.source[fails])
            edges.append(move.edges[fails])
            children.append(np.column_stack((targets[fails], leads[fails])))
        layer = _layer(nodes, np.concatenate(sources), np.concatenate(edges))
        return layer, np.concatenate(children)

    def _in_agreement(self, nodes: Ints, move: Moves) -> tuple[Moves, Ints]:
        """The moves after which the sentences can agree, and the leads then."""
        leads = self._leads.after(nodes[move.source, 3], *self._entered[move.edges].T)
        agree = leads != _PARTED
        agreeing = Moves(move.source[agree], move.edges[agree], move.mixed[agree])
        return agreeing, leads[agree]


def _layer(nodes: Ints, source: Ints, edges: Ints) -> _Layer:
    """A layer of which only the nodes and the moves out of them are known."""
    none = np.zeros(0, np.int64)
    return _Layer(nodes, source, edges, none, none, none, _OpenMoves(none, none))


def _backward(space: PlanSpace, layers: list[_Layer]) -> None:
    """Set ``best`` and ``choice`` of each node, goals first."""
    goal = layers[0]
    bad = (goal.nodes[:, 2] == len(space)) & (goal.nodes[:, 3] == _NO_LEAD)
    goal.best = np.where(bad, 0, _FAR)
    for below, layer in pairwise(layers):
        differs = layer.nodes[:, 0] != layer.nodes[:, 1]
        value = below.best[layer.child] if len(layer.child) else np.zeros(0, np.int64)
        best = np.full(len(layer.nodes), _FAR)
        np.minimum.at(best, layer.source, value)
        choice = np.full(len(layer.nodes), -1)
        tight = np.flatnonzero((value == best[layer.source]) & (value < _FAR))
        choice[layer.source[tight][::-1]] = tight[::-1]
        layer.choice = choice
        layer.open_moves = _OpenMoves.of_layer(layer, value < _FAR)
        layer.best = np.where(best < _FAR, best + differs, _FAR)


def _retrace(
    space: PlanSpace, layers: list[_Layer], most: int, ways: int = _RANDOM_WAYS
) -> list[Counterexamples]:
    """Ways from the nodes at which the plans and their mixture are one, and no sentence leads."""
    # Columns: fewest steps at which the plans differ, layer, row of the layer.
    starts = [np.zeros((0, 3), np.int64)]
    for number, layer in enumerate(layers[1:], 1):
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
    repeated = min(ways, most // len(table) - 1)
    found = []
    for number in np.unique(table[:, 1]).tolist():
        rows = table[table[:, 1] == number, 2]
        found.append(_follow(space, layers, number, rows, None))
        if repeated > 0:
            rows = np.repeat(rows, repeated)
            found.append(_follow(space, layers, number, rows, random))
    return found


def _follow(
    space: PlanSpace,
    layers: list[_Layer],
    number: int,
    rows: Ints,
    random: np.random.Generator | None,
) -> Counterexamples:
    """Ways from nodes of a layer to violations: the best, or at each node any that leads to one."""
    start = layers[number].nodes[rows, 0]
    edges = np.empty((len(rows), number, space.robots), np.int64)
    for step, layer in enumerate(layers[number:0:-1]):
        move = layer.choice[rows] if random is None else layer.open_moves.drawn(rows, random)
        edges[:, step] = layer.edges[move]
        rows = layer.child[move]
    states = np.empty((len(start), space.robots, number + 1), np.int64)
    states[:, :, 0] = space.state[start][:, None]
    states[:, :, 1:] = space.state[space.targets(edges)].transpose(0, 2, 1)
    return Counterexamples(start, edges, states)


class _Leads:
    """Leads: the words by which one plan's sentence is ahead of another's, numbered as met.

    A lead is which of two plans is ahead, 1 or 2, and the words; `_NO_LEAD` is (0, no words).
    """

    def __init__(self) -> None:
        self._leads: list[tuple[int, tuple[int, ...]]] = [(0, ())]
        self._number = {self._leads[_NO_LEAD]: _NO_LEAD}
        self._after: dict[tuple[int, int, int], int] = {}

    def after(self, lead: Ints, first: Ints, second: Ints) -> Ints:
        """The leads when the plans enter words ``first`` and ``second``, or `_NO_WORD`.

        `_PARTED` where their sentences part.  One entry for each of ``lead``.
        """
        words = int(max(first.max(initial=_NO_WORD), second.max(initial=_NO_WORD))) + 2
        codes = (lead * words + (first + 1)) * words + (second + 1)
        different, of_code = np.unique(codes, return_inverse=True)
        leads, entered = np.divmod(different, words * words)
        mine, theirs = np.divmod(entered, words)
        rows = zip(leads.tolist(), (mine - 1).tolist(), (theirs - 1).tolist(), strict=True)
        found: Ints = np.array([self._one(row) for row in rows], np.int64)[of_code.reshape(-1)]
        return found

    def _one(self, key: tuple[int, int, int]) -> int:
        known = self._after.get(key)
        if known is None:
            known = self._after[key] = self._between(*key)
        return known

    def _between(self, lead: int, first: int, second: int) -> int:
        """The number of the lead when the plans enter these words."""
        ahead, words = self._leads[lead]
        mine = _entered(words if ahead == 1 else (), first)
        theirs = _entered(words if ahead == 2 else (), second)
        shared = min(len(mine), len(theirs))
        if mine[:shared] != theirs[:shared]:
            return _PARTED
        if len(mine) == len(theirs):
            return _NO_LEAD
        rest = (1, mine[shared:]) if len(mine) > shared else (2, theirs[shared:])
        if rest not in self._number:
            self._number[rest] = len(self._leads)
            self._leads.append(rest)
        return self._number[rest]


def _entered(words: tuple[int, ...], word: int) -> tuple[int, ...]:
    return words if word == _NO_WORD else (*words, word)
