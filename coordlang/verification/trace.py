# SPDX-License-Identifier: GPL-3.0-or-later
"""A violation shown: the walk of the verifier again, for the tasks of one goal, with its steps."""

from __future__ import annotations

import numpy as np

from coordlang.required.miscoordination import Trail
from coordlang.verification.leads import Leads
from coordlang.verification.mixtures import FAILED, Mixtures
from coordlang.verification.views import views_of_robot
from planners.search.plan_space import PlanSpace
from planners.tables import Ints, ranges


def trace(space: PlanSpace, word: Ints, goal: int) -> tuple[Trail, int]:
    """A violating walk of a goal's tasks, and the nodes walked.

    Task by task, so that little has to be remembered.  ``word`` (nodes) are the words.
    """
    walked = 0
    check = _Trace(space, word)
    starts = np.unique(space.starts[space.goal[space.starts] == goal])
    for start in starts[np.argsort(space.layer[starts], kind="stable")]:
        trail, nodes = check.from_start(int(start))
        walked += nodes
        if trail is not None:
            return trail, walked
    raise AssertionError("the violation has a start")


class _Trace:
    def __init__(self, space: PlanSpace, word: Ints) -> None:
        self.space = space
        self.robots = space.robots
        self._views = [views_of_robot(space, robot, word) for robot in range(self.robots)]
        self._leads = Leads(int(word.max(initial=0)) + 1)
        self._mixtures = Mixtures.of(space)

    def from_start(self, start: int) -> tuple[Trail | None, int]:
        """A violating walk of the task that starts in this node, and the nodes walked."""
        views = [int(view.of[start]) for view in self._views]
        table = np.array([[*views, start, *[0] * (self.robots - 1)]], np.int64)
        history: list[tuple[Ints, Ints]] = []
        walked = 0
        for _ in range(int(self.space.layer[start])):
            walked += len(table)
            source, moves, child = self._moves(table)
            table, first = np.unique(child, axis=0, return_index=True)
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
