# SPDX-License-Identifier: GPL-3.0-or-later
"""The composition walk: n plans of a task in step, their mixture, and by which words they lead.

A node is ``(view_1 .. view_n, y or failed, lead_2 .. lead_n)``: what each plan can still do and say
(`coordlang.verification.walk`), the node of the plan space that the mixture has reached, and the
words by which the sentence of plan 1 is ahead of that of plan i, or behind it.  Moves whose
sentences differ for good are left out.  A walk that ends failed with all leads empty is a violation
(Proposition 9 of docs/concepts.md).

Nodes in which the plans and their mixture are in one state and nobody leads are *diagonal*: most
are, and of these a mask is kept.  So it is quick where tasks are many and words tell most plans
apart at once.  Where it grows, or meets a state with very many moves, it is left to the walk over
sets (`coordlang.verification.sets`), whose nodes are far fewer, and slower one by one.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planners.joint.tables import Bools, Ints, ranges, spans, unique_codes, unique_tuples
from planners.search.edge_index import EdgeIndex
from planners.search.plan_space import PlanSpace
from planners.system.limits import memory_left, reaching


@dataclass(frozen=True, slots=True)
class Views:
    """The views of one robot of the nodes of a plan space, under an assignment of words to nodes.

    Two nodes of a layer with one goal are one *view* of robot i if they have the same word, and
    robot i the same moves, each to the same view.  Plans are mixed by their robots' labels and
    compared by their words, so no walk can tell such nodes apart.

    ``of`` (nodes) is the number of each node's view; ``first`` delimits each view's
    moves in ``label``, ``child`` (a view) and ``said`` (the child's word, -1 where it is the view's
    own).
    """

    of: Ints
    first: Ints
    label: Ints
    child: Ints
    said: Ints


def views_of_robot(space: PlanSpace, robot: int, word: Ints) -> Views:
    """From the goals up, layer by layer; O(edges log edges).  ``word`` (nodes) are the words."""
    of = np.zeros(len(space), np.int64)
    labels = int(space.robot_labels(robot).max(initial=0)) + 1
    words, counts, moves = [], [np.zeros(1, np.int64)], []
    number = 0
    for layer, span in enumerate(space.layers):
        below = space.layer_edges(layer)
        table = np.column_stack(
            (below.source - span.start, space.robot_labels(robot, below.edges), of[below.target])
        )
        pairs, _ = unique_tuples(table, [span.stop - span.start, labels, max(1, number)])
        here = np.arange(span.start, span.stop)
        own = word[here] * (int(space.goal.max(initial=0)) + 1) + space.goal[here]
        view, some = numbered(own, pairs, [labels, max(1, number)])
        of[here] = view + number
        number += len(some)
        bounds = np.searchsorted(pairs[:, 0], np.arange(len(here) + 1))
        counts.append(np.diff(bounds)[some])
        words.append(word[here][some])
        moves.append(pairs[ranges(bounds[some], counts[-1]), 1:])
    view_word, first = np.concatenate(words), np.cumsum(np.concatenate(counts))
    label, child = np.concatenate(moves).T
    view = np.repeat(np.arange(number), np.diff(first))
    said = np.where(view_word[child] != view_word[view], view_word[child], -1)
    return Views(of, first, label, child, said)


def numbered(own: Ints, pairs: Ints, bounds: list[int]) -> tuple[Ints, Ints]:
    """Numbers of nodes, equal where ``own`` and all moves are, and a node for each number.

    ``pairs`` (moves, 3) are the moves (node, ..) of all nodes, sorted.  Move by move: nodes that
    begin alike have one number so far.  Numbers go by how many moves there are, then by ``own``,
    then by moves.
    """
    first = np.searchsorted(pairs[:, 0], np.arange(len(own) + 1))
    counts = np.diff(first)
    different, move = unique_tuples(pairs[:, 1:], bounds)
    _, number = unique_codes(own)
    base = len(own)
    for position in range(int(counts.max(initial=0))):
        open_nodes = np.flatnonzero(counts > position)
        so_far = number[open_nodes] * len(different) + move[first[open_nodes] + position]
        _, longer = unique_codes(so_far)
        number[open_nodes] = longer + base  # beyond those of all nodes with fewer moves
        base += len(own)
    some, number = unique_codes(number)
    return number, some


# ---- by which words the sentence of one plan is ahead of that of another


class Leads:
    """Leads as numbers.  A lead is (who is ahead, the words ahead); number 0 is the empty lead.

    ``words`` counts the words of the language.  A plan *says* a word where it goes from a state
    with another word to a state with this one, and -1 (nothing new) elsewhere.
    """

    def __init__(self, words: int) -> None:
        self._radix = words + 1
        self._leads: list[tuple[bool, tuple[int, ...]]] = [(True, ())]
        self._numbers = {self._leads[0]: 0}
        self._after: dict[int, int] = {}

    def after(self, lead: Ints, first: Ints, other: Ints) -> Ints:
        """Leads after plan 1 said ``first`` and the other plan said ``other``; -1: they differ."""
        codes = (lead * self._radix + first + 1) * self._radix + other + 1
        return _each(codes, self._after, self._compute_after)

    def _compute_after(self, code: int) -> int:
        rest, other = divmod(code, self._radix)
        mine, theirs = self._said(rest)
        theirs += (other - 1,) if other else ()
        common = min(len(mine), len(theirs))
        if mine[:common] != theirs[:common]:
            return -1
        ahead = (True, mine[common:]) if len(mine) >= len(theirs) else (False, theirs[common:])
        if ahead not in self._numbers:
            self._numbers[ahead] = len(self._leads)
            self._leads.append(ahead)
        return self._numbers[ahead]

    def _said(self, code: int) -> tuple[tuple[int, ...], tuple[int, ...]]:
        """The words of both plans that are not common, after plan 1 said its next word."""
        lead, first = divmod(code, self._radix)
        first_ahead, words = self._leads[lead]
        mine = (words if first_ahead else ()) + ((first - 1,) if first else ())
        return mine, () if first_ahead else words


def _each(codes: Ints, known: dict[int, int], compute: Callable[[int], int]) -> Ints:
    """A function of codes, computed once for each."""
    position, inverse = unique_codes(codes)
    different = codes[position].tolist()
    for code in different:
        if code not in known:
            known[code] = compute(code)
    return np.array([known[code] for code in different], np.int64)[inverse]


#: In place of the node that a mixture reaches: it is no optimal plan any more.
_FAILED = -1
#: Moves of the walk handled together.
_CHUNK = 2_000_000


@dataclass(frozen=True, slots=True)
class _Moves:
    """Moves out of a table of walk nodes, so far as some robots have moved.

    ``row`` numbers in the table, ``own`` are the robots' moves, ``leads`` those after them,
    ``said`` is what plan 1 says, ``prefix`` where the mixture is in the index of edges.
    """

    row: Ints
    own: tuple[Ints, ...]
    leads: tuple[Ints, ...]
    said: Ints
    prefix: Ints

    def take(self, which: Ints) -> _Moves:
        """Some of the moves, by number."""
        own, leads = (tuple(part[which] for part in parts) for parts in (self.own, self.leads))
        return _Moves(self.row[which], own, leads, self.said[which], self.prefix[which])


class Grown(Exception):
    """The walk has become larger than it should."""


class Walk:
    """The walk of one plan space under one assignment of words to its nodes.

    ``growth``: moves, for each node of the plan space, with which it is given up.
    """

    def __init__(self, space: PlanSpace, word: Ints, growth: float) -> None:
        self.space = space
        self.robots = space.robots
        self._growth = growth
        self._views = [views_of_robot(space, robot, word) for robot in range(space.robots)]
        self._leads = Leads(int(word.max(initial=0)) + 1)
        self._index = EdgeIndex.of(space)
        self._diagonal = np.zeros(len(space), np.bool_)
        self._diagonal[space.starts] = True
        self._moves_made = 0

    # ---- is there a violation?

    def run(self) -> tuple[int | None, int]:
        """The goal number of some violation (None: there is none), and the nodes walked.

        Raises `Grown` where it is better left to the walk over sets.
        """
        table = np.zeros((0, 2 * self.robots), np.int64)
        walked = 0
        layers = self.space.layers
        number = len(layers)

        def so_far() -> str:
            return (
                f"layer {len(layers) - number} of {len(layers)} of the verification, {walked:,} "
                f"nodes of its walk; {len(table):,} in this layer"
            )

        with reaching(so_far, self.space.model.smaller("fewer robots", "smaller or fewer tasks")):
            for number in range(len(layers) - 1, 0, -1):
                table = np.concatenate((self._diagonal_in(layers[number]), table))
                walked += len(table)
                table = self._after(table)
        bad = table[self._violates(table), 0]
        if not len(bad):
            return None, walked
        node = int(np.flatnonzero(self._views[0].of == bad.min())[0])
        return int(self.space.goal[node]), walked

    def _violates(self, table: Ints) -> Bools:
        """Which nodes of the last layer are violations."""
        found: Bools = (table[:, self.robots] == _FAILED) & ~table[:, self.robots + 1 :].any(axis=1)
        return found

    def _diagonal_in(self, layer: slice) -> Ints:
        """The diagonal nodes of a layer."""
        nodes = np.flatnonzero(self._diagonal[layer]) + layer.start
        table = np.zeros((len(nodes), 2 * self.robots), np.int64)
        for robot, views in enumerate(self._views):
            table[:, robot] = views.of[nodes]
        table[:, self.robots] = nodes
        return table

    def _after(self, table: Ints) -> Ints:
        """The nodes one step on that are not diagonal; those that are get into the mask."""
        sizes = self._sizes(table)
        if 100 * sizes.max(initial=0) > memory_left():
            raise Grown
        parts = [table[:0]]
        for span in spans(sizes, _CHUNK):
            child = self._children(self._moves(table[span]))
            self._moves_made += len(child)
            if self._moves_made > self._growth * len(self.space):
                raise Grown
            parts.append(_different(child[~self._on_diagonal(child)]))
            if 4 * sum(part.nbytes for part in parts) > memory_left():
                raise Grown
        return _different(np.concatenate(parts))

    def _sizes(self, table: Ints) -> NDArray[np.float64]:
        """How many combinations of the plans' moves each node has."""
        sizes = np.ones(len(table))
        for robot, views in enumerate(self._views):
            sizes *= np.diff(views.first)[table[:, robot]]
        return sizes

    def _on_diagonal(self, child: Ints) -> Bools:
        """Which nodes are diagonal; they are entered in the mask."""
        y = child[:, self.robots]
        same: Bools = (y != _FAILED) & ~child[:, self.robots + 1 :].any(axis=1)
        for robot, views in enumerate(self._views):
            same &= views.of[y] == child[:, robot]
        self._diagonal[y[same]] = True
        return same

    # ---- moves

    def _moves(self, table: Ints) -> _Moves:
        """All moves out of a table of nodes whose sentences do not part."""
        none = np.zeros(len(table), np.int64)
        moves = _Moves(np.arange(len(table)), (), (), none, table[:, self.robots])
        for robot in range(self.robots):
            moves = self._extended(table, moves, robot)
        return moves

    def _extended(self, table: Ints, moves: _Moves, robot: int) -> _Moves:
        """The moves with those of one more robot."""
        views = self._views[robot]
        at = table[moves.row, robot]
        first, count = views.first[at], views.first[at + 1] - views.first[at]
        kept, own = np.repeat(np.arange(len(at)), count), ranges(first, count)
        if robot == 0:
            longer = moves.take(kept)
            said, leads = views.said[own], longer.leads
        else:
            lead = table[moves.row[kept], self.robots + robot]
            after = self._leads.after(lead, moves.said[kept], views.said[own])
            fits = np.flatnonzero(after >= 0)
            own, longer = own[fits], moves.take(kept[fits])
            said, leads = longer.said, (*longer.leads, after[fits])
        prefix = self._index.follow(robot, longer.prefix, views.label[own])
        return _Moves(longer.row, (*longer.own, own), leads, said, prefix)

    def _children(self, moves: _Moves) -> Ints:
        """The nodes that moves lead to; each may come many times."""
        children = [views.child[own] for views, own in zip(self._views, moves.own, strict=True)]
        edge = moves.prefix
        mixed = np.full(len(edge), _FAILED)
        mixed[edge >= 0] = self.space.targets(edge[edge >= 0])
        return np.column_stack((*children, mixed, *moves.leads))


def _different(table: Ints) -> Ints:
    """The different rows, sorted."""
    low = table.min(axis=0, initial=0)
    bounds = [int(bound) for bound in table.max(axis=0, initial=0) - low + 1]
    different, _ = unique_tuples(table - low, bounds)
    different += low
    return different
