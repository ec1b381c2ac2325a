# SPDX-License-Identifier: GPL-3.0-or-later
"""What each robot can still do from a node: the verifier's own sets of label sequences.

A *continuation* of robot i at a node is the sequence of its labels on some optimal plan from there.
Plans are mixed by their robots' labels alone.  So if the continuations of robot i at ``x_i`` are
continuations at ``y``, for all robots, and no mixture of plans from ``y`` fails, then no mixture of
plans from ``x_1 .. x_n`` fails from ``y`` (Proposition 12 of docs/concepts.md).
"""

from __future__ import annotations

from collections.abc import Iterable
from itertools import pairwise

import numpy as np

from coordlang.verification.views import numbered
from planners.joint.tables import Bools, Ints, ranges, unique_tuples
from planners.search.plan_space import PlanSpace
from planners.system.limits import reaching

#: The set that holds the empty sequence only.
_EMPTY = 0


class SequenceSets:
    """Sets of label sequences of one length, by number; equal sets have equal numbers.

    A set is kept as its first labels, each with the set of what follows it.  No method recurses:
    sequences are as long as plans.
    """

    def __init__(self) -> None:
        #: Per set the first labels with the set of what follows each.
        self.moves: list[dict[int, int]] = [{}]
        self._numbers: dict[tuple[tuple[int, int], ...], int] = {(): _EMPTY}
        self._unions: dict[tuple[int, ...], int] = {}
        self._inside: dict[tuple[int, int], bool] = {}

    def __len__(self) -> int:
        """Count the different sets."""
        return len(self.moves)

    def number(self, moves: Iterable[tuple[int, int]]) -> int:
        """The set with these first labels, in ascending order, and what follows each."""
        key = tuple(moves)
        known = self._numbers.get(key)
        if known is None:
            known = self._numbers[key] = len(self.moves)
            self.moves.append(dict(key))
        return known

    def union(self, members: tuple[int, ...]) -> int:
        """The union of different sets, given in ascending order."""
        if len(members) == 1:
            return members[0]
        todo = [] if members in self._unions else [members]
        while todo:
            following = self._following(todo[-1])
            missing = [
                below
                for below in following.values()
                if len(below) > 1 and below not in self._unions
            ]
            if missing:
                todo += missing
                continue
            self._unions[todo.pop()] = self.number(
                (label, self._unions[below] if len(below) > 1 else below[0])
                for label, below in sorted(following.items())
            )
        return self._unions[members]

    def _following(self, members: tuple[int, ...]) -> dict[int, tuple[int, ...]]:
        """Each first label of some of the sets, with the sets of what follows it."""
        found: dict[int, set[int]] = {}
        for member in members:
            for label, after in self.moves[member].items():
                found.setdefault(label, set()).add(after)
        return {label: tuple(sorted(after)) for label, after in found.items()}

    def inside(self, one: int, other: int) -> bool:
        """Whether every sequence of the one set is one of the other."""
        if one == other:
            return True
        if (one, other) not in self._inside:
            # If it holds for this pair, it holds for all that were met on the way.
            met, todo, holds = {(one, other)}, [(one, other)], True
            while todo and holds:
                holds, below = self._compared(*todo.pop())
                todo += [pair for pair in below if pair not in met]
                met.update(below)
            self._inside.update(dict.fromkeys(met, True) if holds else {(one, other): False})
        return self._inside[one, other]

    def _compared(self, one: int, other: int) -> tuple[bool, list[tuple[int, int]]]:
        """Whether nothing speaks against it yet, and the pairs for which it must hold, too."""
        mine, theirs = self.moves[one], self.moves[other]
        if not mine.keys() <= theirs.keys():
            return False, []
        below = [(after, theirs[label]) for label, after in mine.items() if after != theirs[label]]
        known = [self._inside.get(pair) for pair in below]
        if False in known:
            return False, []
        return True, [pair for pair, answer in zip(below, known, strict=True) if answer is None]


class Continuations:
    """The continuations of every robot at the nodes of a plan space, and where mixtures fail.

    ``of`` (robots, nodes) are numbers of ``sets``.  ``fails`` (nodes) says from which nodes some
    mixture of plans is no optimal plan: those from which a node is reached where either the robots'
    first labels have more combinations than there are edges, or a robot may go on, after the label
    of an edge, in a way that this edge does not allow, but another one with that label does.
    O(edges log edges), and the work of the sets.
    """

    def __init__(self, space: PlanSpace) -> None:
        self.sets = SequenceSets()
        self.of: Ints = np.full((space.robots, len(space)), _EMPTY, np.int64)
        self._combinations = np.ones(len(space))
        self._loses = np.zeros(len(space), np.bool_)

        def so_far() -> str:
            return f"{len(self.sets):,} sets of what robots can still do"

        with reaching(so_far, space.model.smaller("smaller tasks")):
            for robot in range(space.robots):
                self._fill(space, robot)
        # Different edges differ in their labels.
        here = self._combinations > np.maximum(1, space.out_degrees)
        self.fails: Bools = space.ancestors(here | self._loses)

    def _fill(self, space: PlanSpace, robot: int) -> None:
        """One robot's continuations, goals first."""
        mine = self.of[robot]
        labels = int(space.robot_labels(robot).max(initial=0)) + 1
        for below in space.edges_by_layer():
            low, high = int(below.source[0]), int(below.source[-1]) + 1
            table = np.column_stack(
                (below.source - low, space.robot_labels(robot, below.edges), mine[below.target])
            )
            rows, _ = unique_tuples(table, [high - low, labels, len(self.sets)])
            fresh = np.ones(len(rows), np.bool_)
            fresh[1:] = (rows[1:, :2] != rows[:-1, :2]).any(axis=1)
            moves, move = rows[fresh], np.cumsum(fresh) - 1
            several = np.bincount(move) > 1
            moves[several, 2] = self._unions(move, rows[:, 2], several)
            self._loses[low + rows[rows[:, 2] != moves[move, 2], 0]] = True
            mine[low:high] = self._sets(moves, high - low, labels)
            self._combinations[low:high] *= np.bincount(moves[:, 0])

    def _unions(self, move: Ints, member: Ints, several: Bools) -> Ints:
        """The unions for the moves that have several members."""
        rows = several[move]
        owner = (np.cumsum(several) - 1)[move[rows]]
        pairs = np.column_stack((owner, member[rows]))
        kind, some = numbered(np.zeros(int(several.sum()), np.int64), pairs, [len(self.sets)])
        unions = [self.sets.union(tuple(own)) for own in _lists(pairs[:, 0], pairs[:, 1], some)]
        return np.array(unions, np.int64)[kind]

    def _sets(self, moves: Ints, nodes: int, labels: int) -> Ints:
        """The set of each node of a layer, by its moves (node, label, what follows)."""
        kind, some = numbered(np.zeros(nodes, np.int64), moves, [labels, len(self.sets)])
        sets = [
            self.sets.number(map(tuple, own)) for own in _lists(moves[:, 0], moves[:, 1:], some)
        ]
        return np.array(sets, np.int64)[kind]


def _lists(owner: Ints, entries: Ints, some: Ints) -> list[list]:  # type: ignore[type-arg]
    """The entries of some owners, as lists; ``owner`` is ascending."""
    first = np.searchsorted(owner, some)
    counts = np.searchsorted(owner, some, side="right") - first
    listed = entries[ranges(first, counts)].tolist()
    return [listed[start:end] for start, end in pairwise([0, *np.cumsum(counts).tolist()])]
