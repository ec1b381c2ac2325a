# SPDX-License-Identifier: GPL-3.0-or-later
"""Plans and their mixture walked in step: what shows a miscoordination and finds counterexamples.

Plans ``pi_1 .. pi_n``, one for each robot, introduce RC iff their *mixture* - robot i does its part
of ``pi_i``, step by step - is not an optimal plan (the paper, section 3; for two robots, iff one of
the two recombinations is not).  The walk goes through n plans in step and carries the state that
the mixture has reached: nodes ``(x_1 .. x_n, y)``.  An edge of it *fails* when the mixed joint
action is not an edge of the plan space in ``y``.  All starts and goals walk at once, layer by
layer, in numpy, and only as far as some mixture can fail, which the robots' choices say.
Propositions 2 and 14 of docs/concepts.md say why this decides what it decides.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations, pairwise

import numpy as np
from numpy.typing import NDArray

from coordlang.required.choices import Choices
from planners.joint.states import bits
from planners.joint.tables import Bools, Ints, spans, unique_rows
from planners.search.edge_index import EdgeIndex
from planners.search.plan_space import PlanSpace
from planners.system.errors import OutOfMemory
from planners.system.limits import memory_left, more_memory

#: Bytes for which it is not asked how much memory is left, which takes longer than small layers.
_ALWAYS_THERE = 1 << 20
#: Walk edges handled at a time; it changes no result.
_PIECE = 1_000_000
#: Walk edges out of one layer; more are hours of work.
_MOST = 1e10


def moves(space: PlanSpace, index: EdgeIndex, nodes: Ints) -> Iterator[tuple[Ints, Ints, Ints]]:
    """All moves of n plans and their mixture out of walk nodes ``(x_1 .. x_n, y)``, in chunks.

    One for every choice of the plans' next steps: (k) its row in ``nodes``, (k, robots) the edge
    that each plan takes, (k, robots + 1) the node that they lead to, where a mixture that breaks is
    at the number of nodes of the plan space.  Raises `OutOfMemory` where these are hours of work,
    or one node needs too much at once.
    """
    robots = nodes.shape[1] - 1
    sizes = move_counts(space, nodes[:, :-1])
    _check_size(sizes, space)
    for span in spans(sizes, _PIECE):
        source = np.arange(span.start, span.stop)
        prefix = nodes[span, robots]
        columns: list[Ints] = []
        for robot in range(robots):
            which, edge = space.edges_from(nodes[source, robot])
            source, prefix = source[which], prefix[which]
            columns = [*(old[which] for old in columns), edge]
            prefix = index.follow(robot, prefix, space.robot_labels(robot, edge))
        edges, mixed = np.stack(columns, axis=1), np.full(len(source), len(space))
        mixed[prefix >= 0] = space.targets(prefix[prefix >= 0])
        yield source, edges, np.column_stack((space.targets(edges), mixed))


def move_counts(space: PlanSpace, plans: Ints) -> NDArray[np.float64]:
    """(k) how many choices of next steps plans have that are at nodes ``plans`` (k, robots)."""
    counts: NDArray[np.float64] = np.prod(space.out_degrees.astype(np.float64)[plans], axis=1)
    return counts


def can_fail(choices: Choices, nodes: Ints) -> Bools:
    """Whether mixtures can fail from walk nodes; one that is broken has failed.

    What cannot need not be walked further, whatever the words are.
    """
    possible: Bools = nodes[:, -1] == len(choices.space)
    open_rows = np.flatnonzero(~possible)
    possible[open_rows] = choices.fails_each(nodes[open_rows])
    return possible


def layered(
    space: PlanSpace, begin: Ints, width: int, expand: Callable[[Ints], Ints]
) -> Iterator[tuple[Ints, Ints]]:
    """The nodes of a walk by steps to go, most first: tables with ``width`` columns.

    With each table come the rows to which the links out of the table before lead.  The walk begins
    where all plans and their mixture are at one of the nodes ``begin``; further columns are 0
    there.  ``expand`` gives for a table of nodes where each link out of them leads.
    """
    arriving = np.zeros((0, width), np.int64)
    for number in reversed(range(len(space.layers))):
        here = begin[space.layer[begin] == number]
        fresh = np.zeros((len(here), width), np.int64)
        fresh[:, : space.robots + 1] = here[:, None]
        table, place = unique_rows(np.concatenate((fresh, arriving)))
        yield table, place[len(here) :]
        if number:
            arriving = expand(table)


def _check_size(sizes: NDArray[np.float64], space: PlanSpace) -> None:
    """Stop before one node needs too much at once, or a layer too much work."""
    largest, total = sizes.max(initial=0), sizes.sum()
    robots, instead = space.robots, space.model.smaller("fewer robots", "smaller tasks")
    # One row of a chunk holds its source, a prefix and an edge for each robot, and copies of them.
    at_once = 100 * largest
    if at_once > _ALWAYS_THERE and at_once > memory_left():
        raise OutOfMemory(
            f"a state has {largest:,.0f} combinations of {robots} plans' next steps: about "
            f"{at_once / 2**30:,.1f} GiB at once",
            remedy=f"Use {instead}, or {more_memory()}.",
        )
    if total > _MOST:
        raise OutOfMemory(
            f"the {len(sizes):,} nodes of one layer of the walk have {total:.1e} combinations "
            f"of {robots} plans' next steps",
            remedy=f"Use {instead}.",
        )


#: The shared state (-1: there is none, the plans end in different states), then the different ones,
#: sorted.
Difference = tuple[int, ...]

#: Links of a walk up to which all differences may be listed.
_LINKS = 1_000_000


@dataclass(frozen=True, slots=True)
class _Layer:
    """Walk nodes with as many joint steps to go, and what links them to the layer below.

    ``x`` (k, robots) are the plans' nodes, ``parts``, ``meets`` (links) say whether states differ
    after a link for the first time since all plans and their mixture were at one node, or before it
    for the last time on some way to a failure.
    """

    x: Ints
    source: Ints
    child: Ints
    parts: Bools
    meets: Bools


class DifferenceWalk:
    """The composition walk of one plan space, kept whole, from every node of the plan space.

    Each tuple of plans that introduce RC has a *first difference* ``alpha = (p; s_1 .. s_n)``, the
    last shared state and the next ones, and a *last difference* ``beta = (t_1 .. t_n; q)``, or ends
    in different goal states.  A partition is a coordination language if for every such tuple some
    two different ``s_i, s_j`` and ``p`` lie in three different words, or some two different ``t_i,
    t_j`` and ``q`` do, or two of the different goal states lie in different words (Theorem 3;
    Propositions 5 and 6 of docs/concepts.md).

    Only nodes from which some mixture fails are walked; memory is that of the links between them.
    Raises `OutOfMemory` before the memory budget is used up.
    """

    def __init__(self, space: PlanSpace) -> None:
        self._space = space
        self._layers = _walk(space)
        #: How many nodes and edges the walk has.
        self.nodes = sum(len(layer.x) for layer in self._layers)
        self.edges = sum(len(layer.source) for layer in self._layers)

    def unseparated(
        self, word: Ints, random: np.random.Generator
    ) -> Iterator[tuple[Difference, Difference]]:
        """First and last differences that ``word`` (the word number of each state) leaves together.

        For every unseparated first difference of plans that introduce RC, one of their unseparated
        last differences, drawn at random.  None at all: the partition satisfies Theorem 3 for
        these tasks.  O(links).
        """
        state = self._space.state
        x = state[self._layers[0].x]
        bad = (x != x[:, :1]).any(axis=1) & (word[x] == word[x[:, :1]]).all(axis=1)
        # Per node: a link (of any layer, numbered through) or goal node that ends badly.
        ending = np.where(bad, np.arange(len(x)), -1)
        # Rows (q, t_1 .. t_n), or (-1, t_1 .. t_n) for different goal states.
        endings = [np.column_stack((np.full(len(x), -1), x))]
        offset = len(x)
        for below, layer in pairwise(self._layers):
            first = state[layer.x[layer.source]]
            after = state[below.x[layer.child]]
            rows = np.flatnonzero(layer.parts & (ending[layer.child] >= 0))
            rows = rows[~_separated(word, first[rows, 0], after[rows])]
            yield from self._with_endings(
                first[rows, 0], after[rows], endings, ending[layer.child[rows]]
            )
            last = np.flatnonzero(layer.meets)
            last = last[~_separated(word, after[last, 0], first[last])]
            endings.append(np.column_stack((after[last, 0], first[last])))
            on = np.flatnonzero(ending[layer.child] >= 0)
            source = np.concatenate((layer.source[last], layer.source[on]))
            value = np.concatenate((offset + np.arange(len(last)), ending[layer.child[on]]))
            offset += len(last)
            order = random.permutation(len(source))
            ending = np.full(len(layer.x), -1)
            ending[source[order]] = value[order]

    def every(self, most: int) -> list[tuple[Difference, Difference]] | None:
        """Each first difference with each last difference that can follow, of these tasks.

        None if there are more than ``most``.  O(links x last differences / block size).
        """
        if self.edges > _LINKS:
            return None
        firsts, lasts = self._differences()
        if sum(ends.bit_count() for ends in firsts.values()) > most:
            return None
        return [(first, lasts[number]) for first, ends in firsts.items() for number in bits(ends)]

    def _differences(self) -> tuple[dict[Difference, int], list[Difference]]:
        """First differences, with bits: the numbers of the last ones that follow; all last ones."""
        state = self._space.state
        number: dict[Difference, int] = {}
        firsts: dict[Difference, int] = {}
        following = [
            1 << number.setdefault((-1, *sorted(row)), len(number)) if len(set(row)) > 1 else 0
            for row in state[self._layers[0].x].tolist()
        ]
        for below, layer in pairwise(self._layers):
            here, after = state[layer.x[layer.source]], state[below.x[layer.child]]
            ends = [0] * len(layer.x)
            columns = (layer.source, layer.child, layer.parts, layer.meets)
            links = zip(*(column.tolist() for column in columns), strict=True)
            for link, (source, child, parts, meet) in enumerate(links):
                more = following[child]
                if parts and more:
                    first = (int(here[link, 0]), *sorted(after[link].tolist()))
                    firsts[first] = firsts.get(first, 0) | more
                if meet:
                    last = (int(after[link, 0]), *sorted(here[link].tolist()))
                    more |= 1 << number.setdefault(last, len(number))
                ends[source] |= more
            following = ends
        return firsts, list(number)

    def _with_endings(
        self, shared: Ints, following: Ints, endings: Sequence[Ints], ending: Ints
    ) -> Iterator[tuple[Difference, Difference]]:
        if not len(shared):
            return
        ends = np.concatenate(endings)[ending]
        columns = (shared, np.sort(following, axis=1), ends[:, :1], np.sort(ends[:, 1:], axis=1))
        table = np.unique(np.column_stack(columns), axis=0)
        # One ending for each first difference will do in one round.
        size = 1 + self._space.robots
        _, fresh = np.unique(table[:, :size], axis=0, return_index=True)
        for row in table[fresh].tolist():
            yield tuple(row[:size]), tuple(row[size:])


def _separated(word: Ints, shared: Ints, others: Ints) -> Bools:
    """For each difference whether some two of ``others`` and ``shared`` lie in three words.

    Shapes: ``others`` (k, robots), ``shared`` (k).
    """
    good = np.zeros(len(shared), np.bool_)
    common = word[shared]
    for i, j in combinations(range(others.shape[1]), 2):
        a, b = word[others[:, i]], word[others[:, j]]
        good |= (a != b) & (a != common) & (b != common)
    return good


def _walk(space: PlanSpace) -> list[_Layer]:
    """All layers, goals first, of nodes from which some mixture fails.

    The walk carries whether states differed since plans and mixture were at one node: where nodes
    are more than states plans may part and pass the same states for a while.
    """
    choices, index, width = Choices(space), EdgeIndex.of(space), space.robots + 2
    sources: list[Ints] = []
    nodes = 0

    def expand(table: Ints) -> Ints:
        nonlocal nodes
        nodes += len(table)
        links = [np.zeros((0, 1 + width), np.int64)]
        for source, _, targets in moves(space, index, table[:, :-1]):
            parted = (table[source, -1] > 0) | ~in_one_state(space, targets[:, :-1])
            parted &= (targets != targets[:, :1]).any(axis=1)
            rows = np.column_stack((source, targets, parted))[can_fail(choices, targets)]
            links.append(unique_rows(rows)[0])
        together = np.concatenate(links)
        sources.append(together[:, 0])
        if 8 * sum(own.nbytes for own in sources) > memory_left():
            raise OutOfMemory(
                f"the composition walk has more than {nodes:,} nodes: too large to keep",
                remedy=f"Use --method greedy or minimal, fewer tasks, or {more_memory()}.",
            )
        return together[:, 1:]

    tables, children = zip(
        *layered(space, np.flatnonzero(choices.requires), width, expand), strict=True
    )
    x = tables[-1][:, :-2]
    same = tail = in_one_state(space, x)  # tail: can plans stay in the same states and still fail?
    none, nothing = np.zeros(0, np.int64), np.zeros(0, np.bool_)
    layers = [_Layer(x, none, none, nothing, nothing)]
    for table, source, child in zip(tables[-2::-1], sources[::-1], children[:0:-1], strict=True):
        x = table[:, :-2]
        together = in_one_state(space, x)
        parts = (table[source, -1] == 0) & ~same[child]
        layers.append(_Layer(x, source, child, parts, ~together[source] & tail[child]))
        stays = source[together[source] & tail[child]]
        same, tail = together, np.zeros(len(x), np.bool_)
        tail[stays] = True
    return layers


def in_one_state(space: PlanSpace, x: Ints) -> Bools:
    """Whether all of some nodes (k, robots) are of one state."""
    states = space.state[x]
    one: Bools = (states == states[:, :1]).all(axis=1)
    return one
