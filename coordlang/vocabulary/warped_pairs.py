# SPDX-License-Identifier: GPL-3.0-or-later
"""That pairs of plans that fail are told apart, for any number of words, as paths of one graph.

Two plans have one sentence iff a warping path goes through cells of one word each (Proposition 7 of
docs/concepts.md).  A path of the graph here is such a path of two plans of which a mixture fails:
until it fails both have to be known as far as the plan that is ahead, afterwards they go on as they
like.  So a formula of the graph's steps rules out all partitions in which two such plans agree.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence
from itertools import product
from typing import NamedTuple

import numpy as np

from coordlang.language.warping import Clause
from coordlang.vocabulary.plan_pairs import FAILED, PlanPairs
from coordlang.vocabulary.sat import END, START, PartitionProblem
from planners.joint.tables import Ints, unique_rows
from planners.search.plan_space import PlanSpace

#: Steps by which one of two plans may be ahead before a mixture fails.  With 1 as few words of taxi
#: p09 (makespan) are refuted, but 5 are found after more than 20 rounds, with 2 after 6; with more
#: the formula is three times as large.
_WAITING = 2
#: A solver has so many words more than it is asked for at first: larger sizes are asked for next.
_FURTHER = 2


class _Cell(NamedTuple):
    """A cell of a warping path of two plans, the first of which is ahead or neither.

    ``place``: where both are, with all mixtures, once the other has caught up (`PlanPairs`), or
    `FAILED`.  ``swapped``: whether the first one is the second one there.  ``first``, ``second``:
    the nodes that they are in.  ``waiting``: those that the second one has still to enter until it
    has caught up, or the mixture has failed.
    """

    place: int
    swapped: bool
    first: int
    second: int
    waiting: tuple[int, ...] = ()


def steps_apart(space: PlanSpace, most: int) -> int:
    """By how many steps plans may be apart for a graph of about ``most`` steps; -1: not at all."""
    nodes, edges = np.bincount(space.layer), np.array([*map(len, _successors(space))])
    moves = np.outer(edges, edges) + np.outer(edges, nodes) + np.outer(nodes, edges)
    steps = [int(np.diagonal(moves, apart).sum()) for apart in range(len(nodes))]
    return int((np.cumsum(steps) <= most).sum()) - 1


def _successors(space: PlanSpace) -> list[Ints]:
    """By layer the nodes (steps, 2) that an edge leads from and to, each pair once."""
    layers = map(space.layer_edges, range(len(space.layers)))
    return [unique_rows(np.column_stack((own.source, own.target)))[0] for own in layers]


class WarpedPairs:
    """The pairs of plans that fail, of those that were looked at, along their warping paths.

    Plans are at most so many steps ``apart``, and until a mixture fails at most ``waiting``.  Fewer
    ask for less: every language tells pairs of plans apart along all paths.
    """

    def __init__(self, pairs: PlanPairs, apart: int, waiting: int = _WAITING) -> None:
        space = self._space = pairs.space
        self._after: list[list[int]] = [
            sorted(set(space.successors(node))) for node in range(len(space))
        ]
        self._layer: list[int] = space.layer.tolist()
        self._steps = defaultdict[int, list[tuple[int, int, int]]](list)
        for before, nodes, after in sorted(pairs.steps):
            self._steps[before].append((*nodes, after))
        self._apart, self._waiting = apart, min(waiting, apart)
        self._free = _FreeCells(space, apart)

    def steps(self) -> Iterator[Ints]:
        """Tables of steps: on each path from the start to the end plans must be told apart.

        See `PartitionProblem.separate_on_paths`.
        """
        yield from self._free.steps()
        begin = [_Cell(node, False, node, node) for node in self._steps if node < len(self._space)]
        number = dict.fromkeys(begin, START)
        left, found, last = begin, list[tuple[int, int, int, int]](), self._free.last
        while left:
            cell = left.pop()
            here = number[cell]
            for after in self._after_failing(cell) if cell.place == FAILED else self._moves(cell):
                is_free = after.place == FAILED and not after.waiting
                if not is_free and after not in number:
                    last += 1
                    number[after] = last
                    left.append(after)
                into = START if is_free else number[after]
                found.append((here, after.first, after.second, into))
        before, one, other, places = np.array(found, np.int64).reshape(-1, 4).T
        places = np.where(places == START, self._free.number(one, other), places)
        yield _with_states(self._space, before, one, other, places)

    def _after_failing(self, cell: _Cell) -> Iterator[_Cell]:
        """The cells after one in which the second plan has still to catch up."""
        behind = [(cell.second, cell.waiting), (cell.waiting[0], cell.waiting[1:])]
        for first, (second, waiting) in product([cell.first, *self._after[cell.first]], behind):
            after = _Cell(FAILED, False, first, second, waiting)
            if after != cell and self._layer[second] - self._layer[first] <= self._apart:
                yield after

    def _moves(self, cell: _Cell) -> Iterator[_Cell]:
        """The cells after one, until a mixture has failed."""
        place, swapped, first, second, waiting = cell
        if waiting:
            yield _named(_Cell(place, swapped, first, waiting[0], waiting[1:]))
        both = (swapped,) if waiting else (False, True)
        for (one, other, after), is_second in product(self._steps[place], both):
            ahead, behind = (other, one) if is_second else (one, other)
            here = second if is_second == swapped else first
            queue = (*waiting, behind)
            yield _named(_Cell(after, is_second, ahead, queue[0], queue[1:]))
            if len(waiting) < self._waiting:
                yield _named(_Cell(after, is_second, ahead, here, queue))


def _named(cell: _Cell) -> _Cell:
    """The cell, by one name of those that it has."""
    place, swapped, first, second, waiting = cell
    if place == FAILED:
        return _Cell(place, False, first, second, waiting)
    return _Cell(place, False, second, first) if swapped and not waiting else cell


class _FreeCells:
    """Two plans after a mixture has failed, neither of which has to catch up.

    A cell is two different nodes, in layers that are at most ``apart`` from each other.  They are
    numbered from 1; ``last`` is the last number.
    """

    def __init__(self, space: PlanSpace, apart: int) -> None:
        self._space, self._apart, self._layer = space, apart, space.layer
        counts = self._counts = np.bincount(space.layer)
        self._first = np.cumsum([0, *counts])
        self._edges = _successors(space)
        #: By the layers of the two nodes: the number before the first cell.
        sizes = np.triu(np.tri(len(counts), k=apart, dtype=np.int64)) * np.outer(counts, counts)
        self._before = np.cumsum(sizes).reshape(sizes.shape) - sizes
        self.last = int(sizes.sum())

    def number(self, one: Ints, other: Ints) -> Ints:
        """The numbers of the cells of pairs of nodes; `END` where plans that agree may end."""
        first, second = np.minimum(one, other), np.maximum(one, other)
        low, high = self._layer[first], self._layer[second]
        row, column = first - self._first[low], second - self._first[high]
        found = 1 + self._before[low, high] + row * self._counts[high] + column
        return np.where((first == second) | (high == 0), END, found)

    def steps(self) -> Iterator[Ints]:
        """The steps between them, a table for each layer of the node that is nearer to its end."""
        layers = len(self._edges)
        for low in range(layers):
            others = range(low, min(layers, low + self._apart + 1))
            steps = [own for high in others for own in self._between(low, high)]
            yield np.concatenate(steps)

    def _between(self, low: int, high: int) -> Iterator[Ints]:
        """From the nodes of two layers on both plans, or one of them."""
        nodes = [np.arange(*self._first[layer : layer + 2]) for layer in (low, high)]
        (stay, go), (other_stays, other_goes) = (
            (np.column_stack((own, own)), self._edges[layer])
            for own, layer in zip(nodes, (low, high), strict=True)
        )
        for apart, mine, theirs in (
            (high - low, go, other_goes),
            (high - low + 1, go, other_stays),
            (abs(high - low - 1), stay, other_goes),
        ):
            if apart <= self._apart:
                row, column = np.divmod(np.arange(len(mine) * len(theirs)), max(1, len(theirs)))
                (first, here), (second, target) = mine[row].T, theirs[column].T
                # Of two nodes of one layer the first one has the smaller number.
                kept = np.flatnonzero(first < second)
                first, second, here, target = first[kept], second[kept], here[kept], target[kept]
                before, after = self.number(first, second), self.number(here, target)
                yield _with_states(self._space, before, here, target, after)


def _with_states(space: PlanSpace, before: Ints, one: Ints, other: Ints, after: Ints) -> Ints:
    """A table of steps with states in place of nodes."""
    return np.column_stack((before, space.state[one], space.state[other], after))


class PairsApart:
    """Partitions that satisfy all known clauses and tell pairs of plans apart, for every size.

    ``states`` need words; ``clauses``: a list that only grows; ``pairs``: what no two plans of
    which may agree; ``random`` draws the words that are tried first.  ``steps`` and ``conflicts``:
    those of the graphs and of the solvers so far.
    """

    def __init__(
        self,
        states: Sequence[int],
        clauses: Sequence[Clause],
        pairs: WarpedPairs,
        random: np.random.Generator,
    ) -> None:
        self._states, self._clauses, self._pairs = states, clauses, pairs
        self._problem: PartitionProblem | None = None
        self._required, self._size, self._random = 0, 0, random
        self.steps = self.conflicts = 0

    def find(self, size: int, conflicts: int) -> dict[int, int] | None:
        """A partition into ``size`` words, or None if there is none.

        Raises `Undecided` after so many ``conflicts`` of the solver.
        """
        problem = self._problem
        if problem is None or size > problem.size:
            problem = self._start(size + _FURTHER)
        for clause in self._clauses[self._required :]:
            problem.separate_one(clause)
        self._required, before = len(self._clauses), problem.conflicts
        if size != self._size:
            problem.prefer_any(self._random, size)
            self._size = size
        try:
            return problem.solve(conflicts, size)
        finally:
            self.conflicts += problem.conflicts - before

    def _start(self, size: int) -> PartitionProblem:
        self.close()
        self._problem = problem = PartitionProblem(self._states, size, "minisat22", named=False)
        for steps in self._pairs.steps():
            problem.separate_on_paths(steps)
            self.steps += len(steps)
        self._required = self._size = 0
        return problem

    def close(self) -> None:
        """Give back what the solver holds."""
        if self._problem is not None:
            self._problem.close()
        self._problem = None
