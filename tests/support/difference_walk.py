# SPDX-License-Identifier: GPL-3.0-or-later
"""Last differences by a composition walk that nothing cuts off: the twin of `DifferenceWalk`."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from coordlang.required.composition_walk import FAILED, moves
from coordlang.required.last_differences import DifferenceWalk, _Layer
from planners.joint.tables import Ints, unique_tuples
from planners.search.edge_index import EdgeIndex
from planners.search.plan_space import PlanSpace


class UncutWalk(DifferenceWalk):
    """All nodes are walked; what cannot end in a failed mixture is left out afterwards.

    ``walked`` counts the nodes, these included.
    """

    def __init__(self, space: PlanSpace) -> None:
        self._space = space
        self._robots = space.robots
        self._layers, self.walked = _walk(space)


def _walk(space: PlanSpace) -> tuple[list[_Layer], int]:
    """All layers, goals first, without what cannot fail."""
    robots = space.robots
    failed = len(space)
    index = EdgeIndex.of(space)
    tables: list[Ints] = []
    links: list[tuple[Ints, Ints]] = []
    arriving = np.zeros((0, robots + 1), np.int64)
    spans = space.layers
    for number in range(len(spans) - 1, -1, -1):
        starting = np.repeat(
            np.arange(spans[number].start, spans[number].stop)[:, None], robots + 1, axis=1
        )
        table, place = unique_tuples(
            np.concatenate((starting, arriving)), [failed + 1] * (robots + 1)
        )
        if links:
            links[-1] = (links[-1][0], place[len(starting) :][links[-1][1]])
        tables.append(table)
        if number:
            source, arriving, child = _links(space, index, table)
            links.append((source, child))
    return _pruned(space, tables[::-1], links[::-1]), sum(map(len, tables))


def _links(space: PlanSpace, index: EdgeIndex, table: Ints) -> tuple[Ints, Ints, Ints]:
    """Links out of a table of nodes.

    (source, different children, number of each link's child among them).
    """
    robots = table.shape[1] - 1
    failed = len(space)
    bounds = [failed + 1] * (robots + 1)
    y = table[:, robots]
    walking = np.column_stack((table[:, :robots], np.where(y == failed, FAILED, y)))
    sources: list[Ints] = [np.zeros(0, np.int64)]
    children: list[Ints] = [np.zeros((0, robots + 1), np.int64)]
    numbers: list[Ints] = [np.zeros(0, np.int64)]
    count = 0
    for move in moves(space, index, walking):
        mixed = np.where(move.mixed == FAILED, failed, move.mixed)
        fresh, number = unique_tuples(np.column_stack((space.targets(move.edges), mixed)), bounds)
        pairs, _ = unique_tuples(np.column_stack((move.source, number)), [len(table), len(fresh)])
        sources.append(pairs[:, 0])
        numbers.append(pairs[:, 1] + count)
        children.append(fresh)
        count += len(fresh)
    merged, place = unique_tuples(np.concatenate(children), bounds)
    return np.concatenate(sources), merged, place[np.concatenate(numbers)]


def _pruned(
    space: PlanSpace, tables: Sequence[Ints], links: Sequence[tuple[Ints, Ints]]
) -> list[_Layer]:
    """Only what can end in a failed mixture."""
    robots = tables[0].shape[1] - 1
    failed = len(space)
    none = np.zeros(0, np.int64)
    nothing = np.zeros(0, np.bool_)
    kept = tables[0][:, robots] == failed
    x = tables[0][kept, :robots]
    layers = [_Layer(x, none, none, nothing, nothing, (x == x[:, :1]).all(axis=1))]
    for table, (source, child) in zip(tables[1:], links, strict=True):
        number = np.cumsum(kept) - 1
        alive = kept[child]
        source, child = source[alive], number[child[alive]]
        kept = np.zeros(len(table), np.bool_)
        kept[source] = True
        source = (np.cumsum(kept) - 1)[source]
        table = table[kept]
        x, below = table[:, :robots], layers[-1]
        together = (x == x[:, :1]).all(axis=1)
        joined = (below.x == below.x[:, :1]).all(axis=1)
        tail = np.zeros(len(x), np.bool_)
        tail[source[together[source] & joined[child] & below.tail[child]]] = True
        diagonal = together & (table[:, robots] == x[:, 0])
        parts = diagonal[source] & ~joined[child]
        meets = ~together[source] & joined[child]
        layers.append(_Layer(x, source, child, parts, meets, tail))
    return layers
