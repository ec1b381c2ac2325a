# SPDX-License-Identifier: GPL-3.0-or-later
"""A violation shown: the walk of the verifier again, for the tasks of one goal, with its steps."""

from __future__ import annotations

import numpy as np

from coordlang.required.miscoordination import Trail
from coordlang.verification.mixtures import FAILED
from coordlang.verification.walk_tables import WalkTables
from planners.joint.tables import Ints, ranges


def trace(tables: WalkTables, goal: int) -> tuple[Trail, int]:
    """A violating walk of a goal's tasks, and the nodes walked.

    Task by task, so that little has to be remembered.
    """
    walked = 0
    space, check = tables.space, _Trace(tables)
    starts = np.unique(space.starts[space.goal[space.starts] == goal])
    for start in starts[np.argsort(space.layer[starts], kind="stable")]:
        trail, nodes = check.from_start(int(start))
        walked += nodes
        if trail is not None:
            return trail, walked
    raise AssertionError("the violation has a start")


class _Trace:
    def __init__(self, tables: WalkTables) -> None:
        self.space = tables.space
        self.robots = tables.space.robots
        self._views = tables.views
        self._leads = tables.leads
        self._mixtures = tables.mixtures
        self._cut = tables.cut

    def from_start(self, start: int) -> tuple[Trail | None, int]:
        """A violating walk of the task that starts in this node, and the nodes walked."""
        views = [int(view.of[start]) for view in self._views]
        table = np.array([[*views, start, *[0] * (self.robots - 1)]], np.int64)
        history: list[tuple[Ints, Ints]] = []
        walked = 0
        for _ in range(int(self.space.layer[start])):
            walked += len(table)
            source, moves, child = self._moves(table)
            different, first = np.unique(child, axis=0, return_index=True)
            kept = self._cut.which(different)
            table, first = different[kept], first[kept]
            history.append((source[first], moves[first]))
        failed = table[:, self.robots] == FAILED
        bad = np.flatnonzero(failed & (table[:, self.robots + 1 :] == 0).all(axis=1))
        if not len(bad):
            return None, walked
        row, steps = int(bad[0]), []
        for parent, moves in reversed(history):
            steps.append(moves[row].tolist())
            row = int(parent[row])
        plans = [
            self._edges(robot, start, [step[robot] for step in reversed(steps)])
            for robot in range(self.robots)
        ]
        return Trail(start, tuple(zip(*plans, strict=True))), walked

    def _edges(self, robot: int, node: int, moves: list[int]) -> list[int]:
        """Edges of the plan space that stand behind the moves between a robot's views."""
        space, view = self.space, self._views[robot]
        edges = []
        for move in moves:
            wanted = int(view.label[move]), int(view.child[move])
            edge = next(
                e
                for e in space.out_edges(node)
                if (space.labels_of(e)[robot], int(view.of[space.target_of(e)])) == wanted
            )
            edges.append(edge)
            node = space.target_of(edge)
        return edges

    def _moves(self, table: Ints) -> tuple[Ints, Ints, Ints]:
        """(row, each robot's move, node reached) of every move whose sentences do not part."""
        rows = np.arange(len(table))
        moves = np.zeros((len(rows), 0), np.int64)
        leads = np.zeros((len(rows), 0), np.int64)
        said = np.zeros(len(rows), np.int64)
        for robot, view in enumerate(self._views):
            at = table[rows, robot]
            counts = view.first[at + 1] - view.first[at]
            own = ranges(view.first[at], counts)
            rows, moves, leads, said = (
                np.repeat(part, counts, axis=0) for part in (rows, moves, leads, said)
            )
            moves = np.column_stack((moves, own))
            if robot == 0:
                said = view.said[own]
                continue
            lead = self._leads.after(table[rows, self.robots + robot], said, view.said[own])
            keep = lead >= 0
            rows, moves, said = rows[keep], moves[keep], said[keep]
            leads = np.column_stack((leads[keep], lead[keep]))
        own_moves = list(zip(self._views, moves.T, strict=True))
        mixed = self._mixtures.of_labels(
            table[rows, self.robots], [view.label[move] for view, move in own_moves]
        )
        children = [view.child[move] for view, move in own_moves]
        return rows, moves, np.column_stack((*children, mixed, leads))
