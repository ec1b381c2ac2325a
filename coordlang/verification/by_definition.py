# SPDX-License-Identifier: GPL-3.0-or-later
"""Verification of a partition by definition, in code of its own.

Shares the joint model and the plan spaces with the builders, nothing else.  Walks n plans of a task
in step and carries ``(x_1 .. x_n, y or failed)`` and the *leads*: the words by which the sentence
of plan 1 is ahead of that of plan i, or behind it (one must be a prefix of the other, else the
sentences differ for good).  A violation is a walk that ends failed with all leads empty: n plans
with one sentence whose mixture is no optimal plan (Proposition 9 of docs/concepts.md).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from coordlang.language.partition import Partition
from coordlang.language.sentences import sentence
from coordlang.required.miscoordination import Miscoordination, Trail, describe_failure
from planners.errors import OutOfMemory
from planners.limits import memory_left, reaching
from planners.search.plan_space import PlanSpace
from planners.tables import Ints, unique_rows

_CHUNK = 500_000


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


def verify(partition: Partition, spaces: Sequence[PlanSpace]) -> Verdict:
    """Check a partition against the definition, for all tasks of ``spaces``.

    Every plan has a sentence under a partition, so RC-freeness of the plans of each sentence is all
    there is to check.
    """
    nodes = tasks = 0
    for space in spaces:
        check = _Check(space, partition.word_of(space.rows)[space.state])
        violation, walked = check.run(np.unique(space.starts))
        nodes += walked
        tasks += len(space.starts)
        if violation is not None:
            trail, walked = check.trace(violation)
            return Verdict(False, tasks, nodes + walked, _explain(space, partition, check, trail))
    return Verdict(True, tasks, nodes, None)


def _explain(
    space: PlanSpace, partition: Partition, check: _Check, trail: Trail
) -> Miscoordination:
    first_plan = space.nodes_on(trail.start, [step[0] for step in trail.edges])
    words = sentence(int(check.word[node]) for node in first_plan)
    return describe_failure(space, trail, tuple(partition.words[w] for w in words))


def _too_large(what: str) -> OutOfMemory:
    return OutOfMemory(
        f"verification needs more memory for {what}",
        remedy="Check fewer tasks at a time, or use a larger --memory-limit.",
    )


class _Leads:
    """Leads as numbers.  A lead is (who is ahead, the words ahead); number 0 is the empty lead."""

    def __init__(self) -> None:
        self._leads: list[tuple[bool, tuple[int, ...]]] = [(True, ())]
        self._numbers = {self._leads[0]: 0}
        self._after: dict[tuple[int, int, int], int] = {}

    def extend(self, lead: Ints, first: Ints, other: Ints) -> Ints:
        """Leads after plan 1 said ``first`` and the other plan said ``other`` (-1: nothing new).

        -1 where they differ.
        """
        combined = np.column_stack((lead, first, other))
        different, inverse = np.unique(combined, axis=0, return_inverse=True)
        result = [self._one(*row) for row in different.tolist()]
        return (
            np.array(result, np.int64)[inverse.reshape(-1)]
            if len(result)
            else np.zeros(0, np.int64)
        )

    def _one(self, lead: int, first: int, other: int) -> int:
        key = (lead, first, other)
        if key not in self._after:
            self._after[key] = self._compute(key)
        return self._after[key]

    def _compute(self, key: tuple[int, int, int]) -> int:
        lead, first, other = key
        first_ahead, words = self._leads[lead]
        mine = (words if first_ahead else ()) + ((first,) if first >= 0 else ())
        theirs = (() if first_ahead else words) + ((other,) if other >= 0 else ())
        common = min(len(mine), len(theirs))
        if mine[:common] != theirs[:common]:
            return -1
        rest = (True, mine[common:]) if len(mine) >= len(theirs) else (False, theirs[common:])
        if rest not in self._numbers:
            self._numbers[rest] = len(self._leads)
            self._leads.append(rest)
        return self._numbers[rest]


@dataclass(frozen=True, slots=True)
class _View:
    """What one robot's plan can still do and say from a node, and nothing else of the node.

    Two nodes of a layer with one goal are one *view* of robot i if they have the same word, and
    robot i the same moves, each to the same view.  Plans are mixed by their robots' labels and
    compared by their words, so no walk can tell such nodes apart.  ``of`` (nodes) is the number of
    each node's view; per view ``word``, and ``first`` delimits its moves in ``label`` and ``child``
    (a view).
    """

    of: Ints
    word: Ints
    first: Ints
    label: Ints
    child: Ints

    @classmethod
    def of_robot(cls, space: PlanSpace, robot: int, word: Ints) -> _View:
        """From the goals up, layer by layer; O(edges log edges)."""
        of = np.zeros(len(space), np.int64)
        size = len(space) + 1
        words: list[Ints] = []
        degrees: list[Ints] = []
        found: list[Ints] = []
        number = 0
        for layer, span in enumerate(space.layers):
            below = space.layer_edges(layer)
            move = space.robot_labels(robot, below.edges) * size + of[below.target]
            source = below.source - span.start
            pairs, _ = unique_rows(np.column_stack((source, move)).astype(np.uint64))
            degree = np.bincount(pairs[:, 0].astype(np.int64), minlength=span.stop - span.start)
            ends = np.cumsum(degree)
            for moves in np.unique(degree):
                node = np.flatnonzero(degree == moves)
                own = (
                    pairs[(ends[node] - moves)[:, None] + np.arange(moves), 1]
                    if moves
                    else np.zeros((len(node), 0))
                )
                here = node + span.start
                table = np.column_stack((word[here], space.goal[here], own)).astype(np.uint64)
                different, inverse = unique_rows(table)
                of[here] = inverse + number
                number += len(different)
                words.append(different[:, 0].astype(np.int64))
                degrees.append(np.full(len(different), moves))
                found.append(different[:, 2:].astype(np.int64).reshape(-1))
        codes = np.concatenate(found)
        first = np.concatenate(([0], np.cumsum(np.concatenate(degrees))))
        return cls(of, np.concatenate(words), first, codes // size, codes % size)


class _Check:
    """The walk of one plan space under one assignment of words to its nodes.

    A node of the walk is (view_1 .. view_n, y or failed, leads).
    """

    def __init__(self, space: PlanSpace, word: Ints) -> None:
        self.space = space
        self.word = word
        self.robots = space.robots
        self._failed = len(space)  # in place of y
        self._views = [_View.of_robot(space, robot, word) for robot in range(self.robots)]
        self._leads = _Leads()
        # A mixture is looked up robot by robot: (number of the labels so far, label) has a number
        # of its own.
        self._radix = [
            int(space.robot_labels(robot).max(initial=0)) + 1 for robot in range(self.robots)
        ]
        self._names: list[Ints] = []
        name = np.zeros(len(space.targets()), np.int64)
        for robot in range(self.robots):
            different, name = np.unique(
                name * self._radix[robot] + space.robot_labels(robot), return_inverse=True
            )
            self._names.append(different)
        self._edge_key = space.sources * (len(self._names[-1]) + 1) + name
        self._edge_order = np.argsort(self._edge_key)
        self._edge_sorted = self._edge_key[self._edge_order]

    def run(self, starts: Ints) -> tuple[int | None, int]:
        """The goal number of some violating walk (None: there is none), and the nodes walked."""
        table = np.zeros((0, 2 * self.robots), np.int64)
        walked = 0
        layers = len(self.space.layers)
        number = layers

        def so_far() -> str:
            return (
                f"layer {layers - number} of {layers} of the verification, {walked:,} nodes of "
                "its walk; "
                f"{len(table):,} in this layer"
            )

        with reaching(so_far, "fewer robots, smaller or fewer tasks, or --cost makespan+actions"):
            for number in range(layers - 1, 0, -1):
                table = self._with_starts(table, starts, number)
                walked += len(table)
                parts = [table[:0]]
                for _, _, child in self._moves(table):
                    parts.append(np.unique(child, axis=0))
                    if 4 * sum(part.nbytes for part in parts) > memory_left():
                        raise _too_large(f"a layer of {len(table):,} nodes")
                table = np.unique(np.concatenate(parts), axis=0)
        bad = self._violations(table)
        if len(bad):
            goal_of_view = np.zeros(len(self._views[0].word), np.int64)
            goal_of_view[self._views[0].of] = self.space.goal
            return int(goal_of_view[table[bad[0], 0]]), walked
        return None, walked

    def trace(self, goal: int) -> tuple[Trail, int]:
        """A violating walk of a goal's tasks, task by task so that little has to be remembered."""
        walked = 0
        starts = np.unique(self.space.starts[self.space.goal[self.space.starts] == goal])
        for start in starts[np.argsort(self.space.layer[starts], kind="stable")]:
            trail, nodes = self._trace_from(int(start))
            walked += nodes
            if trail is not None:
                return trail, walked
        raise AssertionError("the violation has a start")

    def _trace_from(self, start: int) -> tuple[Trail | None, int]:
        table = np.zeros((0, 2 * self.robots), np.int64)
        history: list[tuple[Ints, Ints]] = []
        walked = 0
        for number in range(int(self.space.layer[start]), 0, -1):
            table = self._with_starts(table, np.array([start]), number)
            walked += len(table)
            found = [
                np.column_stack((source, moves, child))
                for source, moves, child in self._moves(table)
            ]
            joined = (
                np.concatenate(found) if found else np.zeros((0, 3 * self.robots + 1), np.int64)
            )
            table, first = np.unique(joined[:, 1 + self.robots :], axis=0, return_index=True)
            history.append((joined[first, 0], joined[first, 1 : 1 + self.robots]))
        bad = self._violations(table)
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

    def _with_starts(self, table: Ints, starts: Ints, layer: int) -> Ints:
        here = starts[self.space.layer[starts] == layer]
        fresh = np.zeros((len(here), 2 * self.robots), np.int64)
        for robot, view in enumerate(self._views):
            fresh[:, robot] = view.of[here]
        fresh[:, self.robots] = here
        return np.unique(np.concatenate((table, fresh)), axis=0)

    def _violations(self, table: Ints) -> Ints:
        failed = table[:, self.robots] == self._failed
        return np.flatnonzero(failed & (table[:, self.robots + 1 :] == 0).all(axis=1))

    def _moves(self, table: Ints) -> Iterator[tuple[Ints, Ints, Ints]]:
        """(row, each robot's move, node reached) of every move whose sentences do not part."""
        sizes = np.ones(len(table))
        for robot, view in enumerate(self._views):
            sizes *= np.diff(view.first)[table[:, robot]]
        cuts = (
            np.searchsorted(np.cumsum(sizes), np.arange(_CHUNK, sizes.sum() + _CHUNK, _CHUNK)) + 1
        )
        bounds = np.unique(np.concatenate(([0], np.minimum(cuts, len(table)))))
        if 100 * sizes.max(initial=0) > memory_left():
            raise _too_large(f"a state with {sizes.max():,.0f} combinations of moves")
        for low, high in pairwise(bounds):
            yield self._some_moves(table, np.arange(low, high))

    def _some_moves(self, table: Ints, rows: Ints) -> tuple[Ints, Ints, Ints]:
        robots = self.robots
        moves = np.zeros((len(rows), 0), np.int64)
        leads = np.zeros((len(rows), 0), np.int64)
        said = np.zeros(0, np.int64)
        for robot, view in enumerate(self._views):
            at = table[rows, robot]
            counts = view.first[at + 1] - view.first[at]
            rows, moves, leads = (np.repeat(part, counts, axis=0) for part in (rows, moves, leads))
            within = np.arange(len(rows)) - np.repeat(np.cumsum(counts) - counts, counts)
            own = np.repeat(view.first[at], counts) + within
            before, after = view.word[np.repeat(at, counts)], view.word[view.child[own]]
            new = np.where(before != after, after, -1)
            moves = np.column_stack((moves, own))
            if robot == 0:
                said = new
                continue
            said = np.repeat(said, counts)
            lead = self._leads.extend(table[rows, robots + robot], said, new)
            keep = lead >= 0
            rows, moves, leads, said = rows[keep], moves[keep], leads[keep], said[keep]
            leads = np.column_stack((leads, lead[keep]))
        labels = [view.label[moves[:, robot]] for robot, view in enumerate(self._views)]
        children = [view.child[moves[:, robot]] for robot, view in enumerate(self._views)]
        mixed = self._mix(table[rows, robots], labels)
        return rows, moves, np.column_stack((*children, mixed, leads))

    def _mix(self, y: Ints, labels: Sequence[Ints]) -> Ints:
        """Where the mixture goes: the edge of ``y`` in which each robot does its plan's part."""
        if not len(self._edge_sorted):
            return np.full(len(y), self._failed)
        name = np.zeros(len(y), np.int64)
        for radix, known, label in zip(self._radix, self._names, labels, strict=True):
            code = np.where(name >= 0, name * radix + label, -1)
            place = np.minimum(np.searchsorted(known, code), len(known) - 1)
            name = np.where(known[place] == code, place, -1)
        key = np.where((y == self._failed) | (name < 0), -1, y * (len(self._names[-1]) + 1) + name)
        found = np.minimum(np.searchsorted(self._edge_sorted, key), len(self._edge_sorted) - 1)
        hit = self._edge_sorted[found] == key
        return np.where(hit, self.space.targets(self._edge_order[found]), self._failed)
