# SPDX-License-Identifier: GPL-3.0-or-later
"""Divergences: where plans that introduce RC part, in one plan space.

The sets ``alpha*`` of the paper's Theorem 3 (Proposition 3 of docs/concepts.md): at a node ``p`` a
set of two or more different next nodes is a divergence iff for some way to give each robot one of
them, all of them used, some choice of labels into these nodes, and of sequences from there on, is
no optimal plan.  Minimal sets say all.  A set of states that is known to be a divergence, from
another goal, is not looked at again.

Where no plans are inseparable, the divergences at a node depend on that node only, whatever was
done before (Proposition 2 of docs/concepts.md): one look at each node.

Whole tables are handled at a time: that there is no mixed step, or that a robot's choices are none
where the mixed step leads, decides nearly all sets, and only the others are looked at one by one.
"""

from __future__ import annotations

from itertools import combinations, islice, product
from math import inf

import numpy as np

from coordlang.required.choices import Choices
from coordlang.required.composition_walk import can_fail, in_one_state, layered, move_counts, moves
from planners.joint.tables import Bools, Ints, Rows, find_rows, ranges, spans, unique_rows
from planners.search.edge_index import EdgeIndex

#: Rows of a table handled together.
_CHUNK = 1_000_000
#: Ways to mix next steps that are handled together at most, where sets are few.
_AT_ONCE = 50_000
#: What rows are filled up with: -1 among `Rows`.
_NONE = np.uint64(2**64 - 1)


class TooManyDivergences(Exception):
    """To find divergences takes more work than it was given."""


def divergences(choices: Choices, chunk: int = _CHUNK, most: float = inf) -> Ints:
    """Find the divergences of a plan space, (k, 1 + robots).

    The last shared state, then up to as many next states as there are robots, sorted, filled up
    with -1.  One may imply another one, see `minimal`; ``chunk`` rows are handled together.
    Raises `TooManyDivergences` where more than ``most`` ways to mix next steps are to be looked at.
    """
    if not choices.space.model.nodes_are_states:
        return _walked_divergences(choices, most)
    space = choices.space
    nodes = np.flatnonzero(choices.requires)
    index = EdgeIndex.of(space)
    found: Rows = np.zeros((0, 1 + space.robots), np.uint64)
    for span in spans(space.out_degrees[nodes].astype(np.float64) ** 2, chunk):
        here = _Mixing(choices, index, nodes[span], most)
        found = _with_failing(found, here, here.pairs(), chunk)
        most -= here.looked_at
    return found.astype(np.int64)


def _with_failing(known: Rows, here: _Mixing, sets: Ints, chunk: int) -> Rows:
    """Known divergences, those among sets of one size, and those among larger sets without one."""
    rows = here.states_of(sets)
    open_rows = find_rows(known, rows) < 0
    sets = sets[open_rows]
    different, number = unique_rows(rows[open_rows])
    fails = here.failing(sets, number, len(different))
    known, _ = unique_rows(np.concatenate((known, different[fails])))
    if 1 + sets.shape[1] == known.shape[1]:
        return known
    good = sets[~fails[number]]
    for span in spans(here.nodes_after(good).astype(np.float64), chunk):
        larger = here.extended(good[span])
        larger = larger[~_implied(known, here.states_of(larger))]
        known = _with_failing(known, here, larger, chunk)
    return known


def _walked_divergences(choices: Choices, most: float) -> Ints:
    """`divergences` where nodes are more than states.

    There plans may part and still pass the same states for a while: they are walked until their
    states differ.  O(edges of this part of the composition walk).
    """
    space, index = choices.space, EdgeIndex.of(choices.space)
    found: Rows = np.zeros((0, 1 + space.robots), np.uint64)

    def expand(table: Ints) -> Ints:
        nonlocal found, most
        if (most := most - move_counts(space, table[:, :-1]).sum()) < 0:
            raise TooManyDivergences
        going_on = [np.zeros((0, table.shape[1]), np.int64)]
        for source, _, targets in moves(space, index, table):
            fails = can_fail(choices, targets)
            last, after = space.state[table[source, 0]], space.state[targets[:, :-1]]
            one = in_one_state(space, targets[:, :-1])
            rows = np.column_stack((last.astype(np.uint64), _distinct(after)))[fails & ~one]
            found, _ = unique_rows(np.concatenate((found, rows)))
            # From one node, which their mixture is at, too, all plans begin anyway.
            going_on.append(targets[fails & one & (targets != targets[:, :1]).any(axis=1)])
        return np.unique(np.concatenate(going_on), axis=0)

    begin = np.flatnonzero(choices.requires)
    for _ in layered(space, begin, 1 + space.robots, expand):
        pass
    return found.astype(np.int64)


def _distinct(states: Ints) -> Rows:
    """The different numbers of each row (k, robots), sorted, filled up."""
    ordered = np.sort(states, axis=1).astype(np.uint64)
    again = ordered[:, 1:] == ordered[:, :-1]
    ordered[:, 1:][again] = _NONE
    ordered.sort(axis=1)
    return ordered


def minimal(rows: Ints) -> Ints:
    """The divergences (as `divergences` finds them) that no other one implies, sorted."""
    known, _ = unique_rows(rows.astype(np.uint64))
    return known[~_implied(known, known)].astype(np.int64)


def _implied(known: Rows, rows: Rows) -> Bools:
    """Which of some divergences hold a known one that is smaller."""
    implied = np.zeros(len(rows), np.bool_)
    used = int((rows != _NONE).any(axis=0).sum())  # with many robots few columns are
    for size in range(2, used - 1):
        for some in combinations(range(1, used), size):
            left = np.flatnonzero(~implied)
            part = np.full((len(left), rows.shape[1]), _NONE)
            part[:, : 1 + size] = rows[left][:, [0, *some]]
            smaller = (part != rows[left]).any(axis=1)
            implied[left] = smaller & (find_rows(known, part) >= 0)
    return implied


class _Mixing:
    """Mixtures of edges out of some nodes of a plan space.

    A *way* is a pair of a node and the target of some of its edges: ways are numbered by node, then
    by the target's state.  ``_labels[i]`` delimits, for each way, the labels of robot i on its
    edges.  ``looked_at`` counts the mixtures.
    """

    def __init__(self, choices: Choices, index: EdgeIndex, nodes: Ints, most: float) -> None:
        self._choices, self._index, self._most = choices, index, most
        self.looked_at = 0
        space = self._space = choices.space
        position, edges = space.edges_from(nodes)
        target = space.targets(edges)
        ways, way = unique_rows(np.column_stack((position, space.state[target], target)))
        self._node, self._target = nodes[ways[:, 0]], ways[:, 2]
        #: One more than the last way out of the same node.
        self._end = np.searchsorted(ways[:, 0], ways[:, 0], side="right")
        self._labels: list[tuple[Ints, Ints]] = []
        for robot in range(space.robots):
            pairs, _ = unique_rows(np.column_stack((way, space.robot_labels(robot, edges))))
            first = np.searchsorted(pairs[:, 0], np.arange(len(self._node) + 1))
            self._labels.append((first, pairs[:, 1]))

    def pairs(self) -> Ints:
        """All pairs of ways out of one node, the first before the second."""
        return self.extended(np.arange(len(self._node))[:, None])

    def nodes_after(self, sets: Ints) -> Ints:
        """How many ways out of the same node come after the last one of each set."""
        after: Ints = self._end[sets[:, -1]] - sets[:, -1] - 1
        return after

    def extended(self, sets: Ints) -> Ints:
        """The sets with one more way out of the same node, after all that they have."""
        counts = self.nodes_after(sets)
        more = ranges(sets[:, -1] + 1, counts)
        return np.column_stack((np.repeat(sets, counts, axis=0), more))

    def states_of(self, sets: Ints) -> Rows:
        """(state of the node, states of the ways' targets) of each set, filled up."""
        state = self._space.state
        rows = np.full((len(sets), 1 + self._space.robots), _NONE)
        rows[:, 0] = state[self._node[sets[:, 0]]]
        rows[:, 1 : 1 + sets.shape[1]] = state[self._target[sets]]
        return rows

    def failing(self, sets: Ints, number: Ints, count: int) -> Bools:
        """Which of ``count`` sets of states fail in some way; ``number`` says which each set is."""
        fails = np.zeros(count, np.bool_)
        size, robots = sets.shape[1], self._space.robots
        ways = (a for a in product(range(size), repeat=robots) if len(set(a)) == size)
        at_once = 1  # most sets that fail do so in the first ways
        while (assigned := list(islice(ways, at_once))) and not fails.all():
            undecided = np.flatnonzero(~fails[number])
            rows = np.repeat(undecided, len(assigned))
            self.looked_at += len(rows)
            if self.looked_at > self._most:
                raise TooManyDivergences
            given = sets[undecided][:, assigned].reshape(-1, robots)
            row, nodes, missing = self._mixed(given)
            fails[number[rows[missing]]] = True
            which = number[rows[row]]
            left = np.flatnonzero(~fails[which])
            fails[which[left[self._choices.fails_each(nodes[left])]]] = True
            at_once = max(1, min(2 * at_once, _AT_ONCE // len(sets)))
        return fails

    def _mixed(self, ways: Ints) -> tuple[Ints, Ints, Ints]:
        """The edges that mix the ways given to the robots.

        (numbers of the rows that they are for, the nodes that the robots were given and where the
        edges lead, the rows where an edge is missing).
        """
        row = np.arange(len(ways))
        prefix = self._node[ways[:, 0]]
        missing = [row[:0]]
        for robot, (first, labels) in enumerate(self._labels):
            own = ways[row, robot]
            counts = first[own + 1] - first[own]
            row, prefix = np.repeat(row, counts), np.repeat(prefix, counts)
            prefix = self._index.follow(robot, prefix, labels[ranges(first[own], counts)])
            missing.append(row[prefix < 0])
            row, prefix = row[prefix >= 0], prefix[prefix >= 0]
        nodes = np.column_stack((self._target[ways[row]], self._space.targets(prefix)))
        return row, nodes, np.concatenate(missing)
