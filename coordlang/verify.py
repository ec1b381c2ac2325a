"""Is it a coordination language?  Checked by definition, in code of its own.

Shares the joint model and the plan spaces with the builders, nothing else.  Walks n plans of a task in step and carries
``(x_1 .. x_n, y or failed)`` and the *leads*: the words by which the sentence of plan 1 is ahead of that of plan i, or
behind it (one must be a prefix of the other, else the sentences differ for good).  A violation is a walk that ends failed
with all leads empty: n plans with one sentence whose mixture is no optimal plan.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from coordlang.language import WordTable, sentence
from coordlang.witness import Miscoordination, Trail, describe_failure
from planners.errors import OutOfMemory
from planners.limits import memory_left
from planners.matching import Ints
from planners.optimal import PlanSpace

_CHUNK = 500_000


@dataclass(frozen=True, slots=True)
class Verdict:
    """``holds``: is it a coordination language for these tasks?  If not, ``witness`` shows one miscoordination.

    ``tasks`` were checked with ``nodes`` nodes of the walk.
    """

    holds: bool
    tasks: int
    nodes: int
    witness: Miscoordination | None


def verify(table: WordTable, spaces: Sequence[PlanSpace]) -> Verdict:
    """Check a partition against the definition, for all tasks of ``spaces``.

    Every plan has a sentence under a partition, so RC-freeness of the plans of each sentence is all there is to check.
    """
    nodes = tasks = 0
    for space in spaces:
        check = _Check(space, table.of_rows(space.rows)[space.state])
        violation, walked = check.run(np.unique(space.starts))
        nodes += walked
        tasks += len(space.starts)
        if violation is not None:
            trail, walked = check.trace(violation)
            return Verdict(False, tasks, nodes + walked, _explain(space, table, check, trail))
    return Verdict(True, tasks, nodes, None)


def _explain(space: PlanSpace, table: WordTable, check: _Check, trail: Trail) -> Miscoordination:
    first_plan = [trail.start, *(int(space.target[step[0]]) for step in trail.edges)]
    words = sentence(int(check.word[node]) for node in first_plan)
    return describe_failure(space, trail, tuple(table.words[w] for w in words))


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
        """Leads after plan 1 said ``first`` and the other plan said ``other`` (-1: nothing new); -1 where they differ."""
        combined = np.column_stack((lead, first, other))
        different, inverse = np.unique(combined, axis=0, return_inverse=True)
        result = [self._one(*row) for row in different.tolist()]
        return np.array(result, np.int64)[inverse.reshape(-1)] if len(result) else np.zeros(0, np.int64)

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


class _Check:
    """The walk of one plan space under one assignment of words to its nodes."""

    def __init__(self, space: PlanSpace, word: Ints) -> None:
        self.space = space
        self.word = word
        self.robots = space.labels.shape[1]
        self._failed = len(space)  # in place of y
        self._degree = np.diff(space.first)
        self._leads = _Leads()
        # One number per label tuple: the mixture is looked up as (node, that number).
        self._names: dict[tuple[int, ...], int] = {}
        numbers = [self._names.setdefault(tuple(row), len(self._names)) for row in space.labels.tolist()]
        self._name_of_edge = np.array(numbers, np.int64)
        self._edge_key = space.sources * (len(self._names) + 1) + self._name_of_edge
        self._edge_order = np.argsort(self._edge_key)
        self._edge_sorted = self._edge_key[self._edge_order]

    def run(self, starts: Ints) -> tuple[int | None, int]:
        """The goal number of some violating walk (None: there is none), and the nodes walked."""
        table = np.zeros((0, 2 * self.robots), np.int64)
        walked = 0
        for number in range(len(self.space.layers) - 1, 0, -1):
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
            return int(self.space.goal[table[bad[0], 0]]), walked
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
            found = [np.column_stack((source, edges, child)) for source, edges, child in self._moves(table)]
            joined = np.concatenate(found) if found else np.zeros((0, 3 * self.robots + 1), np.int64)
            table, first = np.unique(joined[:, 1 + self.robots :], axis=0, return_index=True)
            history.append((joined[first, 0], joined[first, 1 : 1 + self.robots]))
        bad = self._violations(table)
        if not len(bad):
            return None, walked
        row, steps = int(bad[0]), []
        for parent, edges in reversed(history):
            steps.append(tuple(edges[row].tolist()))
            row = int(parent[row])
        return Trail(start, tuple(reversed(steps))), walked

    def _with_starts(self, table: Ints, starts: Ints, layer: int) -> Ints:
        here = starts[self.space.layer[starts] == layer]
        fresh = np.zeros((len(here), 2 * self.robots), np.int64)
        fresh[:, : self.robots + 1] = here[:, None]
        return np.unique(np.concatenate((table, fresh)), axis=0)

    def _violations(self, table: Ints) -> Ints:
        failed = table[:, self.robots] == self._failed
        return np.flatnonzero(failed & (table[:, self.robots + 1 :] == 0).all(axis=1))

    def _moves(self, table: Ints) -> Iterator[tuple[Ints, Ints, Ints]]:
        """(row, edges taken, node reached) of every move, without those whose sentences part."""
        sizes = np.prod(self._degree[table[:, : self.robots]].astype(np.float64), axis=1)
        cuts = np.searchsorted(np.cumsum(sizes), np.arange(_CHUNK, sizes.sum() + _CHUNK, _CHUNK)) + 1
        bounds = np.unique(np.concatenate(([0], np.minimum(cuts, len(table)))))
        if 100 * sizes.max(initial=0) > memory_left():
            raise _too_large(f"a state with {sizes.max():,.0f} combinations of moves")
        for low, high in pairwise(bounds):
            yield self._some_moves(table, np.arange(low, high))

    def _some_moves(self, table: Ints, rows: Ints) -> tuple[Ints, Ints, Ints]:
        space, robots = self.space, self.robots
        edges = np.zeros((len(rows), 0), np.int64)
        for robot in range(robots):
            at = table[rows, robot]
            counts = self._degree[at]
            rows, edges = np.repeat(rows, counts), np.repeat(edges, counts, axis=0)
            within = np.arange(len(rows)) - np.repeat(np.cumsum(counts) - counts, counts)
            edges = np.column_stack((edges, np.repeat(space.first[at], counts) + within))
        target = space.target[edges]
        leads = table[rows, robots + 1 :]
        said = np.where(self.word[target] != self.word[table[rows, :robots]], self.word[target], -1)
        for other in range(1, robots):
            after = self._leads.extend(leads[:, other - 1], said[:, 0], said[:, other])
            leads[:, other - 1] = after
            keep = after >= 0
            rows, edges, target = rows[keep], edges[keep], target[keep]
            leads, said = leads[keep], said[keep]
        mixed = self._mix(table[rows, robots], edges)
        return rows, edges, np.column_stack((target, mixed, leads))

    def _mix(self, y: Ints, edges: Ints) -> Ints:
        """Where the mixture goes: the edge of ``y`` in which each robot does its own plan's part."""
        labels = np.stack([self.space.labels[edges[:, i], i] for i in range(self.robots)], axis=1)
        different, inverse = np.unique(labels, axis=0, return_inverse=True)
        unknown = len(self._names)
        names = np.array([self._names.get(tuple(row), unknown) for row in different.tolist()], np.int64)
        key = np.where(y == self._failed, -1, y * (unknown + 1) + names[inverse.reshape(-1)]) if len(y) else y
        if not len(self._edge_sorted):
            return np.full(len(y), self._failed)
        found = np.minimum(np.searchsorted(self._edge_sorted, key), len(self._edge_sorted) - 1)
        hit = self._edge_sorted[found] == key
        return np.where(hit, self.space.target[self._edge_order[found]], self._failed)
