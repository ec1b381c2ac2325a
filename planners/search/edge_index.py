# SPDX-License-Identifier: GPL-3.0-or-later
"""Finding edges by the robots' labels, one robot after another: for tables, and node by node."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from planners.joint.tables import Ints, differs, find_rows
from planners.search.plan_space import PlanSpace


@dataclass(frozen=True, slots=True)
class EdgeIndex:
    """Finds a node's edge by its labels, robot by robot: a tree over label tuples, no overflow.

    ``keys[i]`` are sorted codes (prefix, label of robot i); a prefix is first the node, then the
    number of the code one robot earlier; the last number is the edge itself.
    """

    radix: tuple[int, ...]
    keys: tuple[Ints, ...]

    @classmethod
    def of(cls, space: PlanSpace) -> EdgeIndex:
        """The index of all edges of a plan space."""
        prefix = space.sources
        radix, keys = [], []
        for robot in range(space.robots):
            labels = space.robot_labels(robot)
            size = int(labels.max(initial=0)) + 1
            code = prefix * size + labels
            fresh = differs(code)
            radix.append(size)
            keys.append(code[fresh])
            prefix = np.cumsum(fresh) - 1
        return cls(tuple(radix), tuple(keys))

    def follow(self, robot: int, prefix: Ints, label: NDArray[np.integer[Any]]) -> Ints:
        """The prefixes one robot further; -1 where there is none (and where ``prefix`` is -1)."""
        size = self.radix[robot]
        wanted = np.where((prefix >= 0) & (label < size), prefix * size + label, -1)
        return find_rows(self.keys[robot][:, None], wanted[:, None])


def edge_trees(space: PlanSpace) -> Callable[[int], dict[int, Any]]:
    """The targets of each node's edges, by the robots' labels one after another.

    A tree for each node, made when it is asked for: robot 1's label -> robot 2's -> .. -> target; a
    label that no edge has, after those before it, is not in it.
    """

    @cache
    def tree_of(node: int) -> dict[int, Any]:
        tree: dict[int, Any] = {}
        for edge in space.out_edges(node):
            *first, last = space.labels_of(edge)
            at = tree
            for label in first:
                at = at.setdefault(label, {})
            at[last] = space.target_of(edge)
        return tree

    return tree_of
