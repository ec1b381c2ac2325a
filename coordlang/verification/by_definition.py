# SPDX-License-Identifier: GPL-3.0-or-later
"""Verification of a partition by definition, in code of its own.

Shares the joint model and the plan spaces with the builders, nothing else.  Walks n plans of a task
in step and carries ``(x_1 .. x_n, y or failed)`` and the *leads*: the words by which the sentence
of plan 1 is ahead of that of plan i, or behind it (one must be a prefix of the other, else the
sentences differ for good).  A violation is a walk that ends failed with all leads empty: n plans
with one sentence whose mixture is no optimal plan (Proposition 9 of docs/concepts.md).  A walk that
grows is cut off where no mixture of the plans can fail, whatever their sentences are.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from coordlang.language.partition import Partition
from coordlang.language.sentences import sentence
from coordlang.required.miscoordination import Miscoordination, Trail, describe_failure
from coordlang.verification.leads import ANY, NEVER
from coordlang.verification.mixtures import FAILED
from coordlang.verification.trace import trace
from coordlang.verification.walk_tables import WalkTables
from planners.joint.tables import Bools, Ints, ranges, spans, unique_tuples
from planners.search.plan_space import PlanSpace
from planners.system.errors import OutOfMemory
from planners.system.limits import memory_left, more_memory, reaching

#: Moves of the walk handled together.
_CHUNK = 2_000_000
#: Nodes off the diagonal, for each node of the plan space, with which a walk begins to be cut off.
#: The robots' continuations take about as long as the walk of so many.
GROWTH = 1.0


@dataclass(frozen=True, slots=True)
class Verdict:
    """``holds`` says whether it is a coordination language for these tasks.

    If not, ``witness`` shows one miscoordination.

    ``tasks`` were checked with ``nodes`` nodes of the walk.
    """

    holds: bool
    tasks: int
    nodes: int
    witness: Miscoordination | None


def verify(partition: Partition, spaces: Sequence[PlanSpace], growth: float = GROWTH) -> Verdict:
    """Check a partition against the definition, for all tasks of ``spaces``.

    Every plan has a sentence under a partition, so RC-freeness of the plans of each sentence is all
    there is to check.  ``growth`` says when walks begin to be cut off, and changes only ``nodes``.
    """
    nodes = tasks = 0
    for space in spaces:
        word = partition.word_of(space.rows)[space.state]
        tables = WalkTables.of(space, word)
        goal, walked = _Walk(tables, growth).run()
        nodes += walked
        tasks += len(space.starts)
        if goal is not None:
            trail, walked = trace(tables, goal)
            return Verdict(False, tasks, nodes + walked, _explain(space, partition, word, trail))
    return Verdict(True, tasks, nodes, None)


def _explain(space: PlanSpace, partition: Partition, word: Ints, trail: Trail) -> Miscoordination:
    first_plan = space.nodes_on(trail.start, [step[0] for step in trail.edges])
    words = sentence(int(word[node]) for node in first_plan)
    return describe_failure(space, trail, tuple(partition.words[w] for w in words))


def _too_large(what: str) -> OutOfMemory:
    return OutOfMemory(
        f"verification needs more memory for {what}",
        remedy=f"Check fewer tasks at a time, or use {more_memory()}.",
    )


@dataclass(frozen=True, slots=True)
class _Moves:
    """Moves out of a table of walk nodes whose sentences do not part.

    ``row`` numbers in the table, ``own`` (robots) are the robots' moves, ``leads`` (robots - 1)
    those after them; ``said`` is what plan 1 says.
    """

    row: Ints
    own: tuple[Ints, ...]
    leads: tuple[Ints, ...]
    said: Ints

    def take(self, which: Ints | Bools) -> _Moves:
        return _Moves(
            self.row[which],
            tuple(own[which] for own in self.own),
            tuple(lead[which] for lead in self.leads),
            self.said[which],
        )


class _Walk:
    """The walk of one plan space under one assignment of words to its nodes.

    A node of the walk is (view_1 .. view_n, y or failed, leads).  Nodes in which the plans and
    their mixture are in one state and nobody leads are *diagonal*: of them a mask is kept, as most
    nodes are, and the others in a table.
    """

    def __init__(self, tables: WalkTables, growth: float) -> None:
        self.space = tables.space
        self.robots = tables.space.robots
        self._growth = growth
        self._views = tables.views
        self._leads = tables.leads
        self._mixtures = tables.mixtures
        self._cut = tables.cut
        self._diagonal = np.zeros(len(self.space), np.bool_)
        self._diagonal[self.space.starts] = True
        self._off_diagonal = 0

    def run(self) -> tuple[int | None, int]:
        """The goal number of some violating walk (None: there is none), and the nodes walked."""
        table = np.zeros((0, 2 * self.robots), np.int64)
        walked = 0
        layers = self.space.layers
        number = len(layers)
        smaller = self.space.model.smaller("fewer robots", "smaller or fewer tasks")

        def so_far() -> str:
            return (
                f"layer {len(layers) - number} of {len(layers)} of the verification, {walked:,} "
                f"nodes of its walk; {len(table):,} in this layer"
            )

        with reaching(so_far, smaller):
            for number in range(len(layers) - 1, 0, -1):
                table = np.concatenate((self._diagonal_in(layers[number]), table))
                walked += len(table)
                table = self._after(table)
        bad = table[
            (table[:, self.robots] == FAILED) & (table[:, self.robots + 1 :] == 0).all(axis=1), 0
        ]
        if len(bad):
            view = self._views[0]
            node = int(np.flatnonzero(view.of == bad.min())[0])
            return int(self.space.goal[node]), walked
        return None, walked

    def _diagonal_in(self, layer: slice) -> Ints:
        nodes = self._cut.kept_nodes(np.flatnonzero(self._diagonal[layer]) + layer.start)
        table = np.zeros((len(nodes), 2 * self.robots), np.int64)
        for robot, views in enumerate(self._views):
            table[:, robot] = views.of[nodes]
        table[:, self.robots] = nodes
        return table

    def _after(self, table: Ints) -> Ints:
        """The nodes one step on that are not diagonal; those that are get into the mask."""
        sizes = self._sizes(table)
        if 100 * sizes.max(initial=0) > memory_left() and not self._cut.begun:
            self._cut.begin()
            table = self._cut.kept(table)
            sizes = self._sizes(table)
        if 100 * sizes.max(initial=0) > memory_left():
            raise _too_large(f"a state with {sizes.max():,.0f} combinations of moves")
        parts = [table[:0]]
        for span in spans(sizes, _CHUNK):
            child = self._children(table[span])
            child = child[~self._on_diagonal(child)]
            parts.append(self._cut.kept(_different(child)))
            met = self._off_diagonal + sum(map(len, parts))
            if not self._cut.begun and met > self._growth * len(self.space):
                self._cut.begin()
                parts = list(map(self._cut.kept, parts))
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
        same: Bools = (y != FAILED) & (child[:, self.robots + 1 :] == 0).all(axis=1)
        for robot, views in enumerate(self._views):
            same &= views.of[y] == child[:, robot]
        self._diagonal[y[same]] = True
        return same

    def _children(self, table: Ints) -> Ints:
        """The nodes reached from those of a table; each may come many times."""
        moves = _Moves(np.arange(len(table)), (), (), np.zeros(len(table), np.int64))
        for robot in range(self.robots):
            moves = self._extended(table, moves, robot)
        own = list(zip(self._views, moves.own, strict=True))
        mixed = self._mixtures.of_labels(
            table[moves.row, self.robots], [views.label[move] for views, move in own]
        )
        children = [views.child[move] for views, move in own]
        return np.column_stack((*children, mixed, *moves.leads))

    def _extended(self, table: Ints, moves: _Moves, robot: int) -> _Moves:
        """The moves with those of one more robot."""
        views = self._views[robot]
        at = table[moves.row, robot]
        first, count = views.first[at], views.first[at + 1] - views.first[at]
        if robot == 0:
            row, own = np.repeat(moves.row, count), ranges(first, count)
            return _Moves(row, (own,), (), views.said[own])
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
        after = self._leads.after(lead[kept], longer.said, views.said[own])
        return _Moves(longer.row, (*longer.own, own), (*longer.leads, after), longer.said)


def _different(table: Ints) -> Ints:
    """The different rows, sorted."""
    low = table.min(axis=0, initial=0)
    bounds = [int(bound) for bound in table.max(axis=0, initial=0) - low + 1]
    different, _ = unique_tuples(table - low, bounds)
    different += low
    return different
