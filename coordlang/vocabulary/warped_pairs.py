# SPDX-License-Identifier: GPL-3.0-or-later
"""That pairs of plans that fail are told apart, for any number of words, as paths of one graph.

Two plans have one sentence iff a warping path goes through cells of one word each (Proposition 7 of
docs/concepts.md).  A path of the graph here is such a path of two plans of which a mixture fails:
until it fails both have to be known as far as the plan that is ahead, afterwards they go on as they
like.  So a formula of the graph's steps rules out all partitions in which two such plans agree.

Words are *stutter-free* if every step of every optimal plan enters another one.  Then only the path
that goes step by step matters (Proposition 27), so that larger tasks have a formula.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence
from itertools import product
from math import inf
from typing import NamedTuple

import numpy as np

from coordlang.language.warping import Clause, Pair, pair
from coordlang.vocabulary.plan_pairs import FAILED, PlanPairs
from coordlang.vocabulary.sat import END, START, PartitionProblem, Undecided
from planners.joint.tables import Ints, ranges, unique_rows
from planners.search.plan_space import PlanSpace

#: Steps by which one of two plans may be ahead before a mixture fails.  With 1 as few words of taxi
#: p09 (makespan) are refuted, but 5 are found after more than 20 rounds, with 2 after 6; with more
#: the formula is three times as large.
_WAITING = 2
#: A pair of states takes as long as so many clauses, besides those that it has.
_FOR_STATES = 8


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


def failing_pairs(pairs: PlanPairs, within: float, most: int) -> Ints:
    """Steps such that on each path from the start to the end two plans must be told apart.

    The paths are the pairs of plans that fail, of those that were looked at, step by step: from
    where they differ to ``within`` steps after a mixture has failed; 0: to that step, infinitely
    many: to their ends.  Raises `Undecided` if there are more than about ``most`` steps.  They are
    a table, see `PartitionProblem.separate_on_paths`.
    """
    walked = pairs.steps
    walked[walked[:, 0] < len(pairs.space), 0] = START
    return _FreeCells(pairs.space, 0, within, most).after(walked)


def joined_states(space: PlanSpace) -> list[Pair]:
    """The pairs of states that some step joins: stutter-free words tell each apart."""
    two = space.state[_steps_of(space)]
    return sorted({pair(a, b) for a, b in two.tolist() if a != b})


def steps_apart(space: PlanSpace, most: int) -> int:
    """By how many steps plans may be apart for a graph of about ``most`` steps; -1: not at all."""
    nodes = np.bincount(space.layer)
    edges = np.bincount(space.layer[_steps_of(space)[:, 0]], minlength=len(nodes))
    moves = np.outer(edges, edges) + np.outer(edges, nodes) + np.outer(nodes, edges)
    steps = [int(np.diagonal(moves, apart).sum()) for apart in range(len(nodes))]
    return int((np.cumsum(steps) <= most).sum()) - 1


def _steps_of(space: PlanSpace) -> Ints:
    """(steps, 2) the nodes that an edge leads from and to, each pair once."""
    return unique_rows(np.column_stack((space.sources, space.targets())))[0]


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
        for before, one, other, after in pairs.steps.tolist():
            self._steps[before].append((one, other, after))
        self._apart, self._waiting = apart, min(waiting, apart)

    def steps(self) -> Ints:
        """Steps such that on each path from the start to the end plans must be told apart.

        They are a table, see `PartitionProblem.separate_on_paths`.
        """
        begin = [_Cell(node, False, node, node) for node in self._steps if node < len(self._space)]
        number = dict.fromkeys(begin, START)
        left, found, last = begin, list[tuple[int, int, int, int]](), START
        while left:
            cell = left.pop()
            here = number[cell]
            for after in self._after_failing(cell) if cell.place == FAILED else self._moves(cell):
                is_free = after.place == FAILED and not after.waiting
                if not is_free and after not in number:
                    last += 1
                    number[after] = last
                    left.append(after)
                into = FAILED if is_free else number[after]
                found.append((here, after.first, after.second, into))
        walked = np.array(found, np.int64).reshape(-1, 4)
        return _FreeCells(self._space, self._apart).after(walked)

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

    A cell is two different nodes, at most so many layers ``apart``, and in how many steps from
    there the plans must be told apart: at most ``within`` after the mixture has failed.
    Raises `Undecided` where there are more than about ``most`` steps.
    """

    def __init__(
        self, space: PlanSpace, apart: int, within: float = inf, most: float = inf
    ) -> None:
        self._space, self._layer, self._apart, self._most = space, space.layer, apart, most
        #: More than the steps in which both plans end, if one goes at a time.
        self._end = 1 + 2 * int(space.layer.max(initial=0))
        self._within = int(min(within, self._end))
        self._edges = _steps_of(space)
        self._first = np.searchsorted(self._edges[:, 0], np.arange(len(space) + 1))

    def after(self, walked: Ints) -> Ints:
        """All steps: those ``walked``, and what follows those that lead to `FAILED`.

        Places of the first are numbered from `START` on.  Nodes become states.
        """
        fails = walked[:, 3] == FAILED
        one, other = walked[fails, 1:3].T
        begin = self._codes(one, other, np.full(len(one), self._within))
        places = walked[:, [0, 3]]
        free = 1 + int(places.max(initial=START))  # what is added to the codes of cells
        walked[fails, 3] = np.where(begin == END, END, begin + free)
        tables, number = [walked], len(walked)
        for table in self._steps(begin):
            number += len(table)
            if number > self._most:
                raise Undecided
            table[:, [0, 3]] += np.where(table[:, [0, 3]] == END, 0, free)
            tables.append(table)
        steps = np.concatenate(tables)
        steps[:, 1:3] = self._space.state[steps[:, 1:3]]
        # `END` is the least place, and `START` the next one.
        places = np.append(steps[:, [0, 3]], (END, START))
        numbers = np.unique(places, return_inverse=True)[1] + END
        steps[:, [0, 3]] = numbers[:-2].reshape(-1, 2)
        return steps

    def _steps(self, begin: Ints) -> Iterator[Ints]:
        """Tables of the steps from cells, and from all that follow: those before others first."""
        begin = np.unique(begin[begin != END])
        layers = self._layer[np.stack(self._nodes(begin)[:2])].sum(axis=0)
        arrived = defaultdict[int, list[Ints]](list)
        for total in reversed(range(1, self._end)):  # each step of a plan leads to a smaller sum
            cells = np.unique(np.concatenate((begin[layers == total], *arrived.pop(total, []))))
            low, high, left = self._nodes(cells)
            for steps, which, one, other in self._moves(low, high):
                ends = self._codes(one, other, left[which] - (self._within < self._end))
                arrived[total - steps].append(ends[ends != END])
                yield np.column_stack((cells[which], one, other, ends))

    def _moves(self, low: Ints, high: Ints) -> Iterator[tuple[int, Ints, Ints, Ints]]:
        """In how many plans a step is made, the rows of cells, and the nodes that are entered."""
        which, one = self._from(low)
        again, other = self._from(high[which])
        yield 2, which[again], one[again], other
        if self._apart:
            near = self._layer[high[which]] - self._layer[one] <= self._apart
            yield 1, which[near], one[near], high[which[near]]
            which, other = self._from(high)
            yield 1, which, low[which], other

    def _from(self, nodes: Ints) -> tuple[Ints, Ints]:
        """For each next node of each of some the row of this, and the next one."""
        counts = self._first[nodes + 1] - self._first[nodes]
        edges = ranges(self._first[nodes], counts)
        return np.repeat(np.arange(len(nodes)), counts), self._edges[edges, 1]

    def _codes(self, one: Ints, other: Ints, left: Ints) -> Ints:
        """The numbers of cells; `END` where plans that agree so far may agree to their ends."""
        low, high = np.minimum(one, other), np.maximum(one, other)
        code = (low * len(self._space) + high) * (self._end + 1) + left
        return np.where((low == high) | (self._layer[high] == 0) | (left == 0), END, code)

    def _nodes(self, codes: Ints) -> tuple[Ints, Ints, Ints]:
        """What `_codes` are made of: the nodes, nearer to its end first, and the steps left."""
        both, left = np.divmod(codes, self._end + 1)
        return *np.divmod(both, len(self._space)), left


class PairsApart:
    """Partitions that satisfy all known clauses and tell pairs of plans apart, for every size.

    ``states`` need words; ``clauses``: a list that only grows; ``table``: what
    `PartitionProblem.separate_on_paths` asks for; ``joined``: pairs of states that are in different
    words, too.  ``random`` draws the words that are tried first.  ``steps`` and ``conflicts`` count
    those of the solvers so far.
    """

    def __init__(
        self,
        states: Sequence[int],
        clauses: Sequence[Clause],
        table: Ints,
        random: np.random.Generator | None = None,
        joined: Sequence[Pair] = (),
    ) -> None:
        self._states, self._clauses, self._table = states, clauses, table
        self._problem: PartitionProblem | None = None
        self._size, self._random, self._joined = 0, random, joined
        self._different = len(unique_rows(np.sort(table[:, 1:3], axis=1))[0])
        self.steps = self.conflicts = 0

    def number_of_clauses(self, words: int) -> int:
        """How many clauses a solver gets for so many words; one for a pair of states is dear."""
        return len(self._table) + self._different * (words + _FOR_STATES)

    def find(self, size: int, room: int, conflicts: int) -> dict[int, int] | None:
        """A partition into ``size`` words, or None if there is none.

        Raises `Undecided` after so many ``conflicts`` of the solver.  A new one has ``room`` for so
        many words: larger sizes may be asked for next.
        """
        problem = self._problem
        if problem is None or size > problem.size:
            problem = self._start(room)
        problem.require(self._clauses)
        before = problem.conflicts
        if size != self._size and self._random is not None:
            problem.prefer_any(self._random, size)
            self._size = size
        try:
            return problem.solve(conflicts, size)
        finally:
            self.conflicts += problem.conflicts - before

    def _start(self, size: int) -> PartitionProblem:
        self.close()
        self._problem = problem = PartitionProblem(self._states, size, "minisat22", named=False)
        for states in self._joined:
            problem.separate_one([states])
        problem.separate_on_paths(self._table)
        self.steps += len(self._table)
        self._size = 0
        return problem

    def close(self) -> None:
        """Give back what the solver holds."""
        if self._problem is not None:
            self._problem.close()
        self._problem = None
