# SPDX-License-Identifier: GPL-3.0-or-later
"""The composition walk: n plans of a task in step, their mixture, and by which words they lead.

A node is ``(view_1 .. view_n, y or failed, lead_2 .. lead_n)``: what each plan can still do and say
(`coordlang.verification.views`), the node of the plan space that the mixture has reached, and the
words by which the sentence of plan 1 is ahead of that of plan i, or behind it.  Moves whose
sentences differ for good are left out.  A walk that ends failed with all leads empty is a violation
(Proposition 9 of docs/concepts.md).

Nodes in which the plans and their mixture are in one state and nobody leads are *diagonal*: most
are, and of these a mask is kept.  A walk that grows, or that meets a state with very many moves,
has the robots' continuations worked out once, and is cut off from then on where no mixture of the
plans can fail, whatever their sentences are (`coordlang.verification.continuations`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from coordlang.required.miscoordination import Trail
from coordlang.verification.continuations import Continuations
from coordlang.verification.views import ANY, NEVER, Leads, views_of_robot
from planners.joint.tables import Bools, Ints, ranges, spans, unique_tuples
from planners.search.edge_index import EdgeIndex
from planners.search.plan_space import PlanSpace
from planners.system.errors import OutOfMemory
from planners.system.limits import memory_left, more_memory, reaching

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


class Walk:
    """The walk of one plan space under one assignment of words to its nodes.

    ``growth``: nodes off the diagonal, for each node of the plan space, with which it begins to be
    cut off.
    """

    def __init__(self, space: PlanSpace, word: Ints, growth: float) -> None:
        self.space = space
        self.robots = space.robots
        self._growth = growth
        self._views = [views_of_robot(space, robot, word) for robot in range(space.robots)]
        self._leads = Leads(int(word.max(initial=0)) + 1)
        self._index = EdgeIndex.of(space)
        self._continuations: Continuations | None = None
        self._of_view: list[Ints] = []
        self._diagonal = np.zeros(len(space), np.bool_)
        self._diagonal[space.starts] = True
        self._off_diagonal = 0

    # ---- is there a violation?

    def run(self) -> tuple[int | None, int]:
        """The goal number of some violation (None: there is none), and the nodes walked."""
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
        nodes = np.flatnonzero(self._diagonal[layer]) + layer.start
        if self._continuations is not None:
            nodes = nodes[self._continuations.fails[nodes]]
        return self._shared(nodes)

    def _shared(self, nodes: Ints) -> Ints:
        """Walk nodes in which all plans and their mixture are in these nodes, and nobody leads."""
        table = np.zeros((len(nodes), 2 * self.robots), np.int64)
        for robot, views in enumerate(self._views):
            table[:, robot] = views.of[nodes]
        table[:, self.robots] = nodes
        return table

    def _after(self, table: Ints) -> Ints:
        """The nodes one step on that are not diagonal; those that are get into the mask."""
        sizes = self._sizes(table)
        if 100 * sizes.max(initial=0) > memory_left() and self._continuations is None:
            self._begin_to_cut()
            table = table[self._can_fail(table)]
            sizes = self._sizes(table)
        if 100 * sizes.max(initial=0) > memory_left():
            raise _too_large(f"a state with {sizes.max():,.0f} combinations of moves")
        parts = [table[:0]]
        for span in spans(sizes, _CHUNK):
            child = self._children(self._moves(table[span]))
            child = _different(child[~self._on_diagonal(child)])
            parts.append(child[self._can_fail(child)])
            met = self._off_diagonal + sum(map(len, parts))
            if self._continuations is None and met > self._growth * len(self.space):
                self._begin_to_cut()
                parts = [part[self._can_fail(part)] for part in parts]
            if 4 * sum(part.nbytes for part in parts) > memory_left():
                raise _too_large(f"a layer of {len(table):,} nodes")
        after = _different(np.concatenate(parts))
        self._off_diagonal += len(after)
        return after

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

    # ---- where it is cut off

    def _begin_to_cut(self) -> None:
        """Work out the continuations; of nodes with one view they are the same."""
        self._continuations = Continuations(self.space)
        for views, of_node in zip(self._views, self._continuations.of, strict=True):
            of_view = np.zeros(len(views.word), np.int64)
            of_view[views.of] = of_node
            self._of_view.append(of_view)

    def _can_fail(self, table: Ints) -> Bools:
        """From which nodes a mixture may fail, so far as that is looked at."""
        if self._continuations is None:
            return np.ones(len(table), np.bool_)
        y = table[:, self.robots]
        kept: Bools = y == _FAILED
        going = np.flatnonzero(~kept)
        mine = np.stack([of_view[table[going, k]] for k, of_view in enumerate(self._of_view)])
        kept[going] = self._continuations.can_fail(mine, y[going])
        return kept

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
        if robot == 0:
            kept, own = np.repeat(np.arange(len(at)), count), ranges(first, count)
            longer = moves.take(kept)
            said, leads = views.said[own], longer.leads
        else:
            lead = table[moves.row, self.robots + robot]
            wanted = self._leads.wanted(lead, moves.said)
            free, one = np.flatnonzero(wanted == ANY), np.flatnonzero(wanted > NEVER)
            one = one[wanted[one] != ANY]
            which, found = [np.repeat(free, count[free])], [ranges(first[free], count[free])]
            for words in (np.full(len(one), -1), wanted[one]):  # it says nothing, or that word
                start, number = views.moves_saying(at[one], words)
                which.append(np.repeat(one, number))
                found.append(views.by_word[ranges(start, number)])
            kept, own = np.concatenate(which), np.concatenate(found)
            longer = moves.take(kept)
            said = longer.said
            leads = (*longer.leads, self._leads.after(lead[kept], said, views.said[own]))
        prefix = self._index.follow(robot, longer.prefix, views.label[own])
        return _Moves(longer.row, (*longer.own, own), leads, said, prefix)

    def _children(self, moves: _Moves) -> Ints:
        """The nodes that moves lead to; each may come many times."""
        children = [views.child[own] for views, own in zip(self._views, moves.own, strict=True)]
        edge = moves.prefix
        mixed = np.full(len(edge), _FAILED)
        mixed[edge >= 0] = self.space.targets(edge[edge >= 0])
        return np.column_stack((*children, mixed, *moves.leads))

    # ---- a violation shown

    def violation(self, goal: int) -> tuple[Trail, int]:
        """Plans of a task of a goal that has a violation, and the nodes walked to find them.

        Task by task, short ones first, so that little has to be remembered.
        """
        walked = 0
        starts = np.unique(self.space.starts[self.space.goal[self.space.starts] == goal])
        for start in starts[np.argsort(self.space.layer[starts], kind="stable")].tolist():
            trail, nodes = self._violation_from(start)
            walked += nodes
            if trail is not None:
                return trail, walked
        raise AssertionError("the violation has a start")

    def _violation_from(self, start: int) -> tuple[Trail | None, int]:
        """A violation of the task that starts in this node, and the nodes walked."""
        table = self._shared(np.array([start]))
        history: list[_Moves] = []
        walked = 0
        for _ in range(int(self.space.layer[start])):
            walked += len(table)
            moves = self._moves(table)
            moves = moves.take(np.lexsort((*reversed(moves.own), moves.row)))
            table, first = np.unique(self._children(moves), axis=0, return_index=True)
            kept = self._can_fail(table)
            table = table[kept]
            history.append(moves.take(first[kept]))
        bad = np.flatnonzero(self._violates(table))
        if not len(bad):
            return None, walked
        row, steps = int(bad[0]), []
        for moves in reversed(history):
            steps.append([int(own[row]) for own in moves.own])
            row = int(moves.row[row])
        plans = [self._edges(k, start, own) for k, own in enumerate(zip(*steps[::-1], strict=True))]
        return Trail(start, tuple(zip(*plans, strict=True))), walked

    def _edges(self, robot: int, node: int, moves: tuple[int, ...]) -> list[int]:
        """Edges of the plan space that stand behind the moves between a robot's views."""
        space, view = self.space, self._views[robot]
        edges = []
        for move in moves:
            wanted = int(view.label[move]), int(view.child[move])
            edges.append(
                next(
                    edge
                    for edge in space.out_edges(node)
                    if (space.labels_of(edge)[robot], int(view.of[space.target_of(edge)])) == wanted
                )
            )
            node = space.target_of(edges[-1])
        return edges


def _too_large(what: str) -> OutOfMemory:
    return OutOfMemory(
        f"verification needs more memory for {what}",
        remedy=f"Check fewer tasks at a time, or use {more_memory()}.",
    )


def _different(table: Ints) -> Ints:
    """The different rows, sorted."""
    low = table.min(axis=0, initial=0)
    bounds = [int(bound) for bound in table.max(axis=0, initial=0) - low + 1]
    different, _ = unique_tuples(table - low, bounds)
    different += low
    return different
