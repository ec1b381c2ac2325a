# SPDX-License-Identifier: GPL-3.0-or-later
"""The optimal plans of tasks as paths of one layered graph, and what can be asked of it.

Costs are lexicographic, makespan first: with ``d(s)`` the cost from ``s`` to the goal, the optimal
plans from ``I`` are exactly the paths of edges ``s -> t`` with ``d(s) = c(edge) + d(t)``.  All of
them have the same length (Proposition 1 of docs/concepts.md).  Plans within slack are paths of the
same kind of graph: all have as many steps as are allowed, the last of them at rest
(`planners.search.optimal_plans`).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from planners.joint.conditions import Labels
from planners.joint.model import Goal, JointModel
from planners.joint.tables import Bools, Ints, Numbers, Rows, kept_runs, narrow, ranges

#: More than any sum of costs, of nodes from which no way leads to a goal.
_NO_WAY = np.iinfo(np.int64).max // 4


class LayerEdges(NamedTuple):
    """All edges out of the nodes of one layer.

    ``edges`` are their numbers, one after another; ``source`` and ``target`` (edges) the nodes.
    """

    edges: Ints
    source: Ints
    target: Ints


@dataclass(frozen=True, slots=True, eq=False)
class PlanSpace:
    """The optimal plans of one or several tasks as paths of one layered graph.

    A *node* is a pair of a goal and a state that lies on some optimal plan to it; with slack, a
    goal, a state and the steps that are left.  Nodes are sorted by layer.

    ``rows`` (states, words) is the table of states; per node: ``state`` its number in ``rows``,
    ``goal`` the number of its goal, ``layer`` the joint steps left to the goal, ``first`` (nodes +
    1) delimits its edges in ``target`` (nodes), ``labels`` (edges, robots) and ``cost``, sorted by
    labels.  ``goals`` are the goals by number; ``starts`` holds the node of each task's initial
    state and ``second`` the second component of its optimal cost.
    """

    model: JointModel
    rows: Rows
    state: Ints
    goal: Ints
    layer: Ints
    first: Ints
    target: Numbers
    labels: Labels
    cost: Numbers
    goals: tuple[Goal, ...]
    starts: Ints
    second: Ints

    def __len__(self) -> int:
        """Count the nodes."""
        return len(self.state)

    def __repr__(self) -> str:
        """The sizes, not the tables."""
        return (
            f"PlanSpace(tasks={len(self.starts)}, layers={len(self.layers)}, nodes={len(self)}, "
            f"edges={len(self.target)})"
        )

    @property
    def layers(self) -> list[slice]:
        """The nodes of each layer, the goals' layer (0) first."""
        bounds = np.searchsorted(self.layer, np.arange(int(self.layer.max(initial=-1)) + 2))
        return [slice(int(a), int(b)) for a, b in pairwise(bounds)]

    @property
    def robots(self) -> int:
        """The number of robots: of columns of labels."""
        return int(self.labels.shape[1])

    def cost_of(self, task: int) -> tuple[int, int]:
        """What each plan of a task costs: (joint steps with those at rest, second component).

        Without slack this is the optimal cost.
        """
        return int(self.layer[self.starts[task]]), int(self.second[task])

    def least_makespan(self, task: int) -> int:
        """The makespan of an optimal plan of a task: what `cost_of` says, without the slack."""
        return int(self.layer[self.starts[task]]) - self.model.slack

    # ---- one node, one edge

    def out_edges(self, node: int) -> range:
        """The edges out of a node, in the order of their labels."""
        return range(int(self.first[node]), int(self.first[node + 1]))

    def target_of(self, edge: int) -> int:
        """The node that an edge leads to."""
        return int(self.target[edge])

    def labels_of(self, edge: int) -> tuple[int, ...]:
        """The robots' labels on an edge."""
        return tuple(self.labels[edge].tolist())

    def successors(self, node: int) -> list[int]:
        """The targets of `out_edges`: a node comes once for each edge that leads to it."""
        found: list[int] = self.target[self.first[node] : self.first[node + 1]].tolist()
        return found

    def edge_with(self, node: int, labels: Sequence[int]) -> int | None:
        """The edge out of a node with these labels, None if there is none; O(edges of the node)."""
        edges = self.out_edges(node)
        same = (self.labels[edges.start : edges.stop] == np.asarray(labels)).all(axis=1)
        found = np.flatnonzero(same)
        return edges.start + int(found[0]) if len(found) else None

    # ---- paths: plans as the edges that they take

    def first_path(self, node: int) -> list[int]:
        """The edges of the first plan from a node, in `planners.search.plans.Plans`' order."""
        path = []
        while self.layer[node] > 0:
            path.append(int(self.first[node]))
            node = int(self.target[path[-1]])
        return path

    def path_with(self, node: int, steps: Sequence[Sequence[int]]) -> list[int] | None:
        """The edges of the path from a node with these labels, None where it leaves the graph."""
        path = []
        for labels in steps:
            edge = self.edge_with(node, labels)
            if edge is None:
                return None
            path.append(edge)
            node = int(self.target[edge])
        return path

    def mixture_fails(self, node: int, paths: Sequence[Sequence[int]]) -> bool:
        """Whether no path from a node has the labels of each robot in its own one of these paths.

        ``paths`` are edges, of equal numbers.
        """
        steps = [
            [self.labels_of(edge)[robot] for robot, edge in enumerate(edges)]
            for edges in zip(*paths, strict=True)
        ]
        return self.path_with(node, steps) is None

    def path_of_robots(
        self, node: int, robots: Sequence[int], steps: Sequence[Sequence[int]]
    ) -> list[int] | None:
        """The edges of a plan from a node that begins with these labels of some robots.

        ``steps`` are their labels, step by step.  None if there is no such plan.  It goes on with
        first edges to a goal.  O(edges * steps).
        """
        paths: dict[int, list[int]] = {node: []}  # a path to each node that is reached
        for labels in steps:
            before, paths = paths, {}
            for source, path in before.items():
                leaving = self.out_edges(source)
                edges = np.arange(leaving.start, leaving.stop)
                own = self.labels[edges][:, list(robots)]
                for edge in edges[(own == np.asarray(labels)).all(axis=1)].tolist():
                    paths.setdefault(self.target_of(edge), [*path, edge])
        return next(([*path, *self.first_path(end)] for end, path in paths.items()), None)

    def nodes_on(self, node: int, path: Sequence[int]) -> list[int]:
        """The nodes that a path passes through: the one that it starts from, then its targets."""
        return [node, *self.target[list(path)].tolist()] if path else [node]

    # ---- many at once

    @property
    def sources(self) -> Ints:
        """The source node of each edge."""
        return np.repeat(np.arange(len(self)), np.diff(self.first))

    def sources_of(self, edges: Ints) -> Ints:
        """The source nodes of some edges: for few of them without a table of all."""
        return np.searchsorted(self.first, edges, side="right") - 1

    @property
    def out_degrees(self) -> Ints:
        """The number of edges out of each node."""
        return np.diff(self.first)

    def targets(self, edges: Ints | slice | None = None) -> Ints:
        """The nodes that these edges (None: all) lead to."""
        found = self.target if edges is None else self.target[edges]
        return found.astype(np.int64)

    def robot_labels(self, robot: int, edges: Ints | slice | None = None) -> Ints:
        """One robot's label on each of these edges (None: on all)."""
        column = self.labels[:, robot] if edges is None else self.labels[edges, robot]
        return column.astype(np.int64)

    def edges_from(self, nodes: Ints) -> tuple[Ints, Ints]:
        """All edges out of many nodes: for each its position in ``nodes``, and its number."""
        counts = self.first[nodes + 1] - self.first[nodes]
        return np.repeat(np.arange(len(nodes)), counts), ranges(self.first[nodes], counts)

    def layer_edges(self, layer: int) -> LayerEdges:
        """The edges out of the nodes of a layer, by its number (0: the goals, which have none)."""
        low, high = np.searchsorted(self.layer, (layer, layer + 1)).tolist()
        edges = np.arange(self.first[low], self.first[high])
        source = np.repeat(np.arange(low, high), np.diff(self.first[low : high + 1]))
        return LayerEdges(edges, source, self.targets(slice(self.first[low], self.first[high])))

    def edges_by_layer(self) -> Iterator[LayerEdges]:
        """`layer_edges` of every layer above the goals, the lowest first."""
        return map(self.layer_edges, range(1, int(self.layer.max(initial=0)) + 1))

    def labels_by_step(self, robot: int) -> list[list[int]]:
        """One robot's different labels in each step from the start down, in order."""
        steps = [np.unique(self.robot_labels(robot, own.edges)) for own in self.edges_by_layer()]
        return [labels.tolist() for labels in reversed(steps)]

    def descendants(self, nodes: Ints) -> Bools:
        """Which nodes paths from these nodes reach, these included (nodes).  O(edges)."""
        reached = np.zeros(len(self), np.bool_)
        reached[nodes] = True
        for layer in range(int(self.layer.max(initial=0)), 0, -1):
            below = self.layer_edges(layer)
            reached[below.target[reached[below.source]]] = True
        return reached

    def ancestors(self, nodes: Ints | Bools) -> Bools:
        """The nodes from which paths reach these (numbers or a mask), these included; O(edges)."""
        leads = np.zeros(len(self), np.bool_)
        leads[nodes] = True
        for below in self.edges_by_layer():
            leads[below.source[leads[below.target]]] = True
        return leads

    # ---- other plan spaces made of this one

    def with_tasks(self, starts: Ints, second: Ints) -> PlanSpace:
        """The same graph with other tasks, cut down to what their plans pass through."""
        return replace(self, starts=starts, second=second).reduced()

    def within(self, nodes: Bools) -> PlanSpace:
        """The plans that pass through these nodes (a mask) alone, of the tasks that have any."""
        kept = nodes & (self.layer == 0)
        for edges in self.edges_by_layer():
            kept[edges.source[kept[edges.target] & nodes[edges.source]]] = True
        tasks = kept[self.starts]
        fewer = replace(self, starts=self.starts[tasks], second=self.second[tasks])
        return fewer._cut(kept).reduced()

    def least_sums(self, cost: Numbers) -> Ints:
        """The least sum of the costs of edges (edges) on a way to a goal, per node; O(edges)."""
        value = np.where(self.layer == 0, 0, _NO_WAY)
        if not cost.any():
            return np.zeros_like(value)
        for below in self.edges_by_layer():
            np.minimum.at(value, below.source, cost[below.edges] + value[below.target])
        return value

    def cheapest(self, cost: Numbers) -> PlanSpace:
        """The plans for which the sum of the costs of their edges (edges) is least; O(edges)."""
        value = self.least_sums(cost)
        kept = cost + value[self.target] == value[self.sources]
        if kept.all():
            return self
        return self.along(kept)

    def along(self, edges: Bools) -> PlanSpace:
        """The part of the graph that paths over these edges (a mask) reach from the starts."""
        fewer = replace(
            self,
            first=kept_runs(self.first, edges),
            target=self.target[edges],
            labels=self.labels[edges],
            cost=self.cost[edges],
        )
        return fewer.reduced()

    def reduced(self) -> PlanSpace:
        """The part of the graph that the tasks' plans pass through."""
        return self._cut(self.descendants(self.starts))

    def _cut(self, kept: Bools) -> PlanSpace:
        """The nodes of a mask with the edges between them; all starts are among them."""
        return self if kept.all() else self.reordered(np.flatnonzero(kept))

    def reordered(self, order: Ints) -> PlanSpace:
        """The graph of some nodes, all starts among them: new node k is old node ``order[k]``."""
        number = np.full(len(self), -1)
        number[order] = np.arange(len(order))
        counts = self.out_degrees[order]
        edges = ranges(self.first[order], counts)
        kept = number[self.target[edges]] >= 0
        edges = edges[kept]
        return replace(
            self,
            state=self.state[order],
            goal=self.goal[order],
            layer=self.layer[order],
            first=kept_runs(np.concatenate(([0], np.cumsum(counts))), kept),
            target=narrow(number[self.target[edges]]),
            labels=self.labels[edges],
            cost=self.cost[edges],
            starts=number[self.starts],
        )

    def unfolded(
        self,
        layers: Sequence[Ints],
        steps: Sequence[tuple[Ints, Ints, Ints]],
        task: int,
        ends: Bools | None = None,
    ) -> PlanSpace:
        """A plan space of one task that unfolds part of this one: copies of its nodes and edges.

        ``layers`` are, from the start down, the nodes that each layer's nodes are copies of.
        ``steps`` are between consecutive layers: the sources of edges, numbered in the upper one,
        the edges that they are copies of, and their targets in the lower one; sorted by source,
        then by labels.  The new task starts at the only node of the first layer, and keeps the
        second cost component of ``task``.  What leads to none of the ``ends`` (of the last layer's
        nodes; default: all) is left out; some path must lead there.
        """
        node = np.concatenate(layers[::-1])
        begins = np.cumsum([0, *map(len, layers[::-1])])[-2::-1]
        parts = [
            (source + above, edge, target + below)
            for (source, edge, target), (above, below) in zip(steps, pairwise(begins), strict=True)
        ]
        nothing = (np.zeros(0, np.int64),) * 3
        source, edge, target = map(np.concatenate, zip(nothing, *reversed(parts), strict=True))
        whole = replace(
            self,
            state=self.state[node],
            goal=self.goal[node],
            layer=self.layer[node],
            first=np.searchsorted(source, np.arange(len(node) + 1)),
            target=narrow(target),
            labels=self.labels[edge],
            cost=self.cost[edge],
            starts=np.array([len(node) - 1]),
            second=self.second[[task]],
        )
        lasts = np.arange(len(layers[-1]))
        return whole._cut(whole.ancestors(lasts if ends is None else lasts[ends]))
