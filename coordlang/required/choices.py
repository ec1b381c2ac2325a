# SPDX-License-Identifier: GPL-3.0-or-later
"""Required coordination from each robot's own label sequences: one look at each node, no pairs.

For a node ``p`` of a plan space let ``C_i(p)`` be the set of robot i's label sequences over all
optimal plans from ``p``.  Some mixture of plans from ``p`` fails iff some choice of one sequence
from each ``C_i(p)`` is no optimal plan from ``p``: of plan i the mixture uses robot i's labels
only.  Propositions 11 to 13 of docs/concepts.md say why.

The sets are kept as canonical, deterministic, acyclic automata: a set of sequences of one length is
written as its *moves*, each first label with the set of what may follow it.  Equal sets have one
number, as in a decision diagram, so that equality is equality of numbers, and unions and inclusions
are worked out once for each different pair.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from itertools import product
from math import prod

import numpy as np

from planners.joint.tables import Bools, Ints, differs, of_each_row, unique_rows
from planners.search.plan_space import LayerEdges, PlanSpace
from planners.system.limits import reaching

# Sets are followed along plans by recursion, with some calls a step: plans may have 1,500 steps.
sys.setrecursionlimit(max(sys.getrecursionlimit(), 5_000))

#: The set that holds only the empty sequence.
END = 0


class LabelSets:
    """All sets of label sequences that were met, by number; equal sets have one number.

    All sequences of a set have one length.
    """

    def __init__(self) -> None:
        self._moves: list[dict[int, int]] = [{}]
        self._number: dict[tuple[tuple[int, int], ...], int] = {(): END}
        self._union: dict[tuple[int, int], int] = {}
        self._within: dict[tuple[int, int], bool] = {}
        self._sizes = {END: 1}

    def __len__(self) -> int:
        return len(self._moves)

    def moves(self, number: int) -> dict[int, int]:
        """Each first label of a set with the number of the set of what follows it."""
        return self._moves[number]

    def of_moves(self, moves: dict[int, int]) -> int:
        """The number of the set with these moves."""
        return self.of_sorted(tuple(sorted(moves.items())))

    def of_sorted(self, moves: tuple[tuple[int, int], ...]) -> int:
        """The same for moves that are sorted by label."""
        number = self._number.setdefault(moves, len(self._moves))
        if number == len(self._moves):
            self._moves.append(dict(moves))
        return number

    def union(self, one: int, other: int) -> int:
        """The union of two sets of sequences of one length."""
        if one == other:
            return one
        key = (one, other) if one < other else (other, one)
        known = self._union.get(key)
        if known is None:
            together = dict(self.moves(one))
            for label, after in self.moves(other).items():
                together[label] = self.union(together.get(label, after), after)
            known = self._union[key] = self.of_moves(together)
        return known

    def within(self, one: int, other: int) -> bool:
        """Whether every sequence of ``one`` is one of ``other``; both have one length."""
        if one == other:
            return True
        key = (one, other)
        known = self._within.get(key)
        if known is None:
            theirs = self.moves(other)
            known = self._within[key] = all(
                label in theirs and self.within(after, theirs[label])
                for label, after in self.moves(one).items()
            )
        return known

    def size(self, number: int) -> int:
        """How many sequences a set has."""
        if number not in self._sizes:
            self._sizes[number] = sum(map(self.size, self.moves(number).values()))
        return self._sizes[number]

    def sequences(self, number: int) -> Iterator[tuple[int, ...]]:
        """The sequences of a set, in the order of labels."""
        if number == END:
            yield ()
        for label, after in self.moves(number).items():
            yield from ((label, *rest) for rest in self.sequences(after))

    def unions(self, first: Ints, sizes: Ints, members: Ints) -> Ints:
        """For each group, ``members[first : first + size]``, the union of its sets."""
        result = members[first].copy()
        for position in range(1, int(sizes.max(initial=0))):
            open_groups = np.flatnonzero(sizes > position)
            pairs = np.column_stack((result[open_groups], members[first[open_groups] + position]))
            result[open_groups] = of_each_row(pairs, self.union)
        return result


class Choices:
    """The sets ``C_i(p)`` of all nodes of a plan space, and which nodes require coordination.

    ``sets`` may be shared among plan spaces of one model.  O(edges) set operations, each on a
    different set once.
    """

    def __init__(self, space: PlanSpace, sets: LabelSets | None = None) -> None:
        self.space = space
        self.sets = sets or LabelSets()
        #: (robots, nodes): the number of the set ``C_i(p)``.
        self.of_node: Ints = np.full((space.robots, len(space)), END, np.int64)
        #: (nodes): do some plans from the node introduce RC?
        self.requires: Bools = np.zeros(len(space), np.bool_)
        #: How often it was asked whether a mixture of given choices fails.
        self.evaluations = 0
        self._failing: dict[tuple[int, ...], bool] = {}
        self._edges: dict[int, dict[tuple[int, ...], int]] = {}

        def so_far() -> str:
            return (
                f"the robots' choices in {len(self.sets):,} sets, over {len(space):,} states on "
                f"{space.model.kept_plans}"
            )

        with reaching(so_far, self.space.model.smaller("smaller tasks")):
            self._fill()

    def _fill(self) -> None:
        """From the goals up, a layer at a time."""
        for edges in self.space.edges_by_layer():
            nodes, degrees = np.unique(edges.source, return_counts=True)
            fails = self.requires[edges.target]
            combinations_of_labels = np.ones(len(nodes))
            for robot in range(self.space.robots):
                here, labels, following = self._robot_edges(robot, edges)
                self.of_node[robot, nodes] = here
                combinations_of_labels *= labels
                # A proper superset of what is optimal below: some sequence of it is not.
                fails |= following != self.of_node[robot, edges.target]
            # Different edges have different labels: fewer edges than combinations, and one is none.
            self.requires[nodes] = combinations_of_labels > degrees
            self.requires[edges.source[fails]] = True

    def _robot_edges(self, robot: int, edges: LayerEdges) -> tuple[Ints, Ints, Ints]:
        """What one robot's labels say of a layer's edges.

        (nodes) the sets ``C_i``, (nodes) how many first labels they have, (edges) what the robot
        may do after the label of an edge, whichever edge with that label is taken.
        """
        labels, after = self.space.robot_labels(robot, edges.edges), self.of_node[robot]
        table = np.column_stack((edges.source - edges.source.min(), labels, after[edges.target]))
        rows, inverse = unique_rows(table)
        fresh = differs(rows[:, 0]) | differs(rows[:, 1])
        first = np.flatnonzero(fresh)
        following = self.sets.unions(first, np.diff(np.append(first, len(rows))), rows[:, 2])
        groups = rows[first]
        _, start, sizes = np.unique(groups[:, 0], return_index=True, return_counts=True)
        pairs = tuple(zip(groups[:, 1].tolist(), following.tolist(), strict=True))
        ends = (start + sizes).tolist()
        own = map(pairs.__getitem__, map(slice, start.tolist(), ends))
        here = np.array([*map(self.sets.of_sorted, own)], np.int64)
        group_of_row = np.cumsum(fresh) - 1
        return here, sizes, following[group_of_row[inverse]]

    # ---- does a mixture of given choices fail?

    def fails(self, chosen: tuple[int, ...], node: int) -> bool:
        """Whether some choice of one sequence from each set is no optimal plan from ``node``.

        ``chosen`` has one set for each robot, of sequences as long as the plans from the node.
        """
        key = (*chosen, node)
        known = self._failing.get(key)
        if known is None:
            self.evaluations += 1
            known = self._failing[key] = self._some_fails(chosen, node)
        return known

    def _some_fails(self, chosen: tuple[int, ...], node: int) -> bool:
        if not all(map(self.sets.within, chosen, self.of_node[:, node].tolist())):
            return True  # that sequence is in no optimal plan, the other sets are not empty
        if not self.requires[node]:
            return False
        edges = self.edges_of(node)
        if prod(len(self.sets.moves(number)) for number in chosen) > len(edges):
            return True  # different edges have different labels, so some choice is none of them
        return any(
            labels not in edges or self.fails(after, edges[labels])
            for labels, after in self.steps(chosen)
        )

    def steps(self, chosen: tuple[int, ...]) -> Iterator[tuple[tuple[int, ...], tuple[int, ...]]]:
        """All first labels of some sets of the robots, each with the sets of what follows them."""
        moves = [self.sets.moves(number) for number in chosen]
        for labels in product(*moves):
            yield labels, tuple(own[label] for own, label in zip(moves, labels, strict=True))

    def fails_each(self, nodes: Ints) -> Bools:
        """Of nodes ``(x_1 .. x_n, y)`` whether some mixture of plans from the x_i fails from y.

        ``nodes``: (k, robots + 1), of one layer in each row.
        """
        mixed = nodes[:, -1]
        fails = np.zeros(len(nodes), np.bool_)
        equal = np.ones(len(nodes), np.bool_)
        for robot in range(self.space.robots):
            mine = self.of_node[robot, nodes[:, robot]]
            theirs = self.of_node[robot, mixed]
            equal &= mine == theirs
            asked = np.flatnonzero((mine != theirs) & ~fails)
            pairs = np.column_stack((mine[asked], theirs[asked]))
            fails[asked] = of_each_row(pairs, self.sets.within) == 0
        left = np.flatnonzero(~fails & self.requires[mixed])
        fails[left[equal[left]]] = True
        left = left[~equal[left]]
        chosen = self.of_node[np.arange(self.space.robots)[:, None], nodes[left, :-1].T]
        table, number = unique_rows(np.column_stack((*chosen, mixed[left])))
        answers = [self.fails(tuple(row[:-1]), row[-1]) for row in table.tolist()]
        fails[left] = np.array(answers, np.bool_)[number]
        return fails

    def edges_of(self, node: int) -> dict[tuple[int, ...], int]:
        """The targets of a node's edges, by labels."""
        if node not in self._edges:
            self._edges[node] = {
                self.space.labels_of(edge): self.space.target_of(edge)
                for edge in self.space.out_edges(node)
            }
        return self._edges[node]
