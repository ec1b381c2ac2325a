# SPDX-License-Identifier: GPL-3.0-or-later
"""The earliest break of a mixture by walking along n plans in step: the twin of `breaks`."""

from __future__ import annotations

import numpy as np

from coordlang.required.composition_walk import FAILED, Moves, moves
from coordlang.required.witnesses import Trail
from planners.joint.tables import Ints, unique_tuples
from planners.search.edge_index import EdgeIndex
from planners.search.plan_space import PlanSpace


def walk_to_a_witness(space: PlanSpace, starts: Ints, *, together: bool) -> Trail | None:
    """Breadth first through the layers, until a mixture breaks; with ``together`` along plans in
    the same states only.
    """
    robots = space.robots
    index = EdgeIndex.of(space)
    table = np.zeros((0, robots + 1), np.int64)
    history: list[
        tuple[Ints, Ints, Ints]
    ] = []  # per layer: nodes, parents, the edges that led there
    parents, came = np.zeros(0, np.int64), np.zeros((0, robots), np.int64)
    for number in range(len(space.layers) - 1, 0, -1):
        fresh = starts[space.layer[starts] == number]
        table = np.concatenate((table, np.repeat(fresh[:, None], robots + 1, axis=1)))
        parents = np.concatenate((parents, np.full(len(fresh), -1)))
        came = np.concatenate((came, np.full((len(fresh), robots), -1)))
        history.append((table, parents, came))
        found: list[Ints] = []
        for move in moves(space, index, table):
            if together:
                ends = space.targets(move.edges)
                same = (ends == ends[:, :1]).all(axis=1)
                move = Moves(move.source[same], move.edges[same], move.mixed[same])
            broken = np.flatnonzero(move.mixed == FAILED)
            if len(broken):
                first = broken[0]
                return _retrace(history, int(move.source[first]), tuple(move.edges[first].tolist()))
            target = space.targets(move.edges)
            found.append(np.column_stack((target, move.mixed, move.source, move.edges)))
        step = np.concatenate(found) if found else np.zeros((0, 2 * robots + 2), np.int64)
        table, number_of = unique_tuples(step[:, : robots + 1], [len(space)] * (robots + 1))
        one = np.zeros(len(table), np.int64)
        one[number_of[::-1]] = np.arange(len(step))[::-1]
        parents, came = step[one, robots + 1], step[one, robots + 2 :]
    return None


def _retrace(history: list[tuple[Ints, Ints, Ints]], row: int, last: tuple[int, ...]) -> Trail:
    edges = [last]
    for table, parents, came in reversed(history):
        if parents[row] < 0:
            return Trail(int(table[row, 0]), tuple(reversed(edges)))
        edges.append(tuple(came[row].tolist()))
        row = int(parents[row])
    raise AssertionError("a walk starts somewhere")
