# SPDX-License-Identifier: GPL-3.0-or-later
"""Required coordination from each robot's own label sequences: one look at each node, no pairs.

For a node ``p`` of a plan space let ``C_i(p)`` be the set of robot i's label sequences over all
optimal plans from ``p``.  Some mixture of plans from ``p`` fails iff some choice of one sequence
from each ``C_i(p)`` is no optimal plan from ``p``: of plan i the mixture uses robot i's labels
only.  Propositions 11 to 13 of docs/concepts.md say why.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from math import prod

import numpy as np

from coordlang.required.label_sets import END, LabelSets
from planners.joint.tables import Bools, Ints, unique_tuples
from planners.search.plan_space import PlanSpace
from planners.system.limits import reaching

#: A robot's choices below some node: each first label with the set of what may follow it.
Moves = dict[int, int]


@dataclass(frozen=True, slots=True)
class _RobotEdges:
    """What one robot's labels say of a layer's edges.

    ``here`` (nodes of the layer) are the sets ``C_i``, ``labels`` (nodes) how many first labels
    they have, ``following`` (edges) what the robot may do after the label of an edge, whichever
    edge with that label is taken.
    """

    here: Ints
    labels: Ints
    following: Ints


class Choices:
    """The sets ``C_i(p)`` of all nodes of a plan space, and which nodes require coordination.

    ``sets`` may be shared among plan spaces of one model.  O(edges) set operations, each on a
    different set once.
    """

    def __init__(self, space: PlanSpace, sets: LabelSets | None = None) -> None:
        self.space = space
        self.sets = sets or LabelSets()
        self._robots = space.labels.shape[1]
        #: (robots, nodes): the number of the set ``C_i(p)``.
        self.of_node: Ints = np.full((self._robots, len(space)), END, np.int64)
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
            nodes, first = np.unique(edges.source, return_index=True)
            degrees = np.diff(np.append(first, len(edges.source)))
            fails = self.requires[edges.target]
            combinations_of_labels = np.ones(len(nodes))
            for robot in range(self._robots):
                own = self._robot_edges(robot, edges.edges, edges.source - nodes[0], edges.target)
                self.of_node[robot, nodes] = own.here
                combinations_of_labels *= own.labels
                # A proper superset of what is optimal below: some sequence of it is not.
                fails |= own.following != self.of_node[robot, edges.target]
            # Different edges have different labels: fewer edges than combinations, and one is none.
            self.requires[nodes] = combinations_of_labels > degrees
            self.requires[edges.source[fails]] = True

    def _robot_edges(self, robot: int, edges: Ints, source: Ints, target: Ints) -> _RobotEdges:
        labels = self.space.robot_labels(robot, edges)
        table = np.column_stack((source, labels, self.of_node[robot, target]))
        rows, inverse = unique_tuples(table, [int(column.max()) + 1 for column in table.T])
        fresh = np.ones(len(rows), np.bool_)
        fresh[1:] = (rows[1:, :2] != rows[:-1, :2]).any(axis=1)
        first = np.flatnonzero(fresh)
        following = self.sets.unions(first, np.diff(np.append(first, len(rows))), rows[:, 2])
        groups = rows[first]
        _, start = np.unique(groups[:, 0], return_index=True)
        sizes = np.diff(np.append(start, len(groups)))
        here = self.sets.sets(start, sizes, groups[:, 1], following)
        group_of_row = np.cumsum(fresh) - 1
        return _RobotEdges(here, sizes, following[group_of_row[inverse]])

    # ---- does a mixture of given choices fail?

    def fails(self, chosen: tuple[int, ...], node: int) -> bool:
        """Whether some choice of one sequence from each set is no optimal plan from ``node``.

        ``chosen`` has one set for each robot, of sequences as long as the plans from the node.
        """
        key = (*chosen, node)
        known = self._failing.get(key)
        if known is None:
            self.evaluations += 1
            if not self.sets.all_within(chosen, self.of_node[:, node].tolist()):
                known = (
                    True  # that sequence is in no optimal plan, and the other sets are not empty
                )
            elif not self.requires[node]:
                known = False
            else:
                known = self.moves_fail([self.sets.moves(number) for number in chosen], node)
            self._failing[key] = known
        return known

    def fails_each(self, nodes: Ints) -> Bools:
        """Of nodes ``(x_1 .. x_n, y)`` whether some mixture of plans from the x_i fails from y.

        Parameters
        ----------
        nodes
            (k, robots + 1), of one layer in each row.
        """
        mixed = nodes[:, self._robots]
        fails = np.zeros(len(nodes), np.bool_)
        equal = np.ones(len(nodes), np.bool_)
        for robot in range(self._robots):
            mine = self.of_node[robot, nodes[:, robot]]
            theirs = self.of_node[robot, mixed]
            equal &= mine == theirs
            asked = np.flatnonzero((mine != theirs) & ~fails)
            fails[asked] = ~self.sets.within_each(mine[asked], theirs[asked])
        left = np.flatnonzero(~fails & self.requires[mixed])
        fails[left[equal[left]]] = True
        left = left[~equal[left]]
        chosen = self.of_node[np.arange(self._robots)[:, None], nodes[left, :-1].T]
        table, number = unique_tuples(
            np.column_stack((*chosen, mixed[left])),
            [len(self.sets)] * self._robots + [len(self.space)],
        )
        answers = [self.fails(tuple(row[:-1]), row[-1]) for row in table.tolist()]
        fails[left] = np.array(answers, np.bool_)[number]
        return fails

    def moves_fail(self, moves: Sequence[Moves], node: int) -> bool:
        """`fails` for sets given by their moves: each first label with the set of what follows."""
        edges = self.edges_of(node)
        if prod(map(len, moves)) > len(edges):
            return True  # different edges have different labels, so some choice is none of them
        for labels in product(*moves):
            target = edges.get(labels)
            if target is None or self.fails(
                tuple(own[label] for own, label in zip(moves, labels, strict=True)), target
            ):
                return True
        return False

    def edges_of(self, node: int) -> dict[tuple[int, ...], int]:
        """The targets of a node's edges, by labels."""
        if node not in self._edges:
            self._edges[node] = {
                self.space.labels_of(edge): self.space.target_of(edge)
                for edge in self.space.out_edges(node)
            }
        return self._edges[node]
