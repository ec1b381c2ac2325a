# SPDX-License-Identifier: GPL-3.0-or-later
"""Where plans that introduce RC part first: the divergences of a plan space, from its choices.

At a node ``p`` a set of two or more different next nodes is a divergence iff for some way to give
each robot one of them, all of them used, some choice of labels into these nodes, and of sequences
from there on, is no optimal plan.  Minimal sets say all.  A set of states that is known to be a
divergence, from another goal, is not looked at again.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations, product

import numpy as np

from coordlang.required.choices import Choices, Moves
from planners.search.edge_index import EdgeIndex
from planners.tables import Bools, Ints, Rows, find_rows, spans, unique_rows

#: Pairs of edges looked at together.
_CHUNK = 1_000_000


class Partings:
    """The divergences found so far, over as many plan spaces of one table of states as are added.

    With two robots they are pairs of next states and found for whole tables of nodes; with more,
    sets of up to as many states as there are robots, node by node.
    """

    def __init__(self, robots: int, chunk: int = _CHUNK) -> None:
        self._robots, self._chunk = robots, chunk
        self._pairs: Rows = np.zeros((0, 3), np.uint64)
        self._sets: dict[int, list[frozenset[int]]] = {}

    def add(self, choices: Choices) -> None:
        """Look for divergences at the nodes of a plan space that require coordination."""
        nodes = np.flatnonzero(choices.requires)
        if self._robots == 2:
            self._add_pairs(choices, nodes)
        else:
            for node in nodes.tolist():
                known = self._sets.setdefault(int(choices.space.state[node]), [])
                known += _sets_at(choices, node, known)

    def table(self) -> Ints:
        """The divergences, (k, 1 + robots): the last shared state, then next states, sorted.

        Filled up with -1; only those that no other one implies.
        """
        if self._robots == 2:
            return self._pairs.astype(np.int64)
        rows = [
            (state, *sorted(found), *[-1] * (self._robots - len(found)))
            for state, sets in sorted(self._sets.items())
            for found in sorted(sets, key=sorted)
            if not any(other < found for other in sets)
        ]
        return np.array(rows, np.int64).reshape(len(rows), 1 + self._robots)

    # ---- two robots

    def _add_pairs(self, choices: Choices, nodes: Ints) -> None:
        space = choices.space
        index = EdgeIndex.of(space)
        for span in spans(space.out_degrees[nodes].astype(np.float64) ** 2, self._chunk):
            at = nodes[span]
            position, first = space.edges_from(at)
            pairing, second = space.edges_from(at[position])
            node, first = at[position[pairing]], first[pairing]
            targets = np.column_stack((space.targets(first), space.targets(second)))
            states = np.sort(space.state[targets], axis=1)
            rows = np.column_stack((space.state[node], states)).astype(np.uint64)
            fresh = (targets[:, 0] != targets[:, 1]) & (find_rows(self._pairs, rows) < 0)
            self._enter(rows[fresh][self._certain(choices, index, node, first, second, fresh)])
            self._search(choices, index, node, first, second, rows)

    def _enter(self, rows: Rows) -> None:
        self._pairs, _ = unique_rows(np.concatenate((self._pairs, rows)))

    def _certain(
        self,
        choices: Choices,
        index: EdgeIndex,
        node: Ints,
        first: Ints,
        second: Ints,
        fresh: Bools,
    ) -> Bools:
        """Which pairs surely fail: there is no mixed step, or a robot's choices are none there."""
        node, first, second = node[fresh], first[fresh], second[fresh]
        mixed = _mixed(choices, index, node, first, second)
        fails = mixed < 0
        there = np.flatnonzero(~fails)
        for robot, edges in enumerate((first, second)):
            mine = choices.of_node[robot, choices.space.targets(edges[there])]
            theirs = choices.of_node[robot, mixed[there]]
            fails[there] |= ~choices.sets.within_each(mine, theirs)
        return fails

    def _search(
        self, choices: Choices, index: EdgeIndex, node: Ints, first: Ints, second: Ints, rows: Rows
    ) -> None:
        """The other pairs, one after another, each until it is known."""
        space = choices.space
        one, other = space.targets(first), space.targets(second)
        left = np.flatnonzero((one != other) & (find_rows(self._pairs, rows) < 0))
        mixed = _mixed(choices, index, node[left], first[left], second[left])
        asks = (mixed >= 0) & choices.requires[np.maximum(mixed, 0)]
        left, mixed = left[asks], mixed[asks]
        found: set[tuple[int, ...]] = set()
        chosen = zip(
            choices.of_node[0, one[left]].tolist(),
            choices.of_node[1, other[left]].tolist(),
            strict=True,
        )
        for row, sets, target in zip(rows[left].tolist(), chosen, mixed.tolist(), strict=True):
            if tuple(row) not in found and choices.fails(sets, target):
                found.add(tuple(row))
        if found:
            self._enter(np.array(sorted(found), np.uint64))


def _mixed(choices: Choices, index: EdgeIndex, node: Ints, first: Ints, second: Ints) -> Ints:
    """Where robot 1's label of the first edge and robot 2's of the second lead, -1 for nowhere."""
    space = choices.space
    prefix = index.follow(0, node, space.robot_labels(0, first).astype(np.int32))
    edge = index.follow(1, prefix, space.robot_labels(1, second).astype(np.int32))
    return np.where(edge >= 0, space.targets(np.maximum(edge, 0)), -1)


# ---- any number of robots


def _sets_at(choices: Choices, node: int, known: list[frozenset[int]]) -> Iterator[frozenset[int]]:
    """The minimal sets of next states at a node that are divergences, but those already known."""
    into = _moves_into(choices, node)
    found: list[frozenset[int]] = []
    for size in range(2, min(len(choices.of_node), len(into)) + 1):
        for states in combinations(sorted(into), size):
            parting = frozenset(states)
            if any(other <= parting for other in (*known, *found)):
                continue
            if _some_assignment_fails(choices, node, states, into):
                found.append(parting)
                yield parting


def _moves_into(choices: Choices, node: int) -> dict[int, list[Moves]]:
    """For each next state and robot: the robot's labels on edges there, and what may follow."""
    into: dict[int, list[Moves]] = {}
    for labels, target in choices.edges_of(node).items():
        state = int(choices.space.state[target])
        own = into.setdefault(state, [{} for _ in labels])
        for robot, label in enumerate(labels):
            own[robot][label] = int(choices.of_node[robot, target])
    return into


def _some_assignment_fails(
    choices: Choices, node: int, states: tuple[int, ...], into: dict[int, list[Moves]]
) -> bool:
    for assigned in product(states, repeat=len(choices.of_node)):
        if len(set(assigned)) == len(states) and choices.moves_fail(
            [into[state][robot] for robot, state in enumerate(assigned)], node
        ):
            return True
    return False
