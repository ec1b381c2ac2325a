# SPDX-License-Identifier: GPL-3.0-or-later
"""What the verifier's walks look things up in, and where they are cut off.

A walk may leave out nodes from which no mixture fails, whatever is said.  Most walks are about as
large as the plan space, and do without.  One that grows, or that meets a state with very many
moves, has the robots' continuations worked out once, and is cut off from then on.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from coordlang.verification.continuations import Continuations
from coordlang.verification.leads import Leads
from coordlang.verification.mixtures import FAILED, Mixtures
from coordlang.verification.views import Views, views_of_robot
from planners.joint.tables import Bools, Ints
from planners.search.plan_space import PlanSpace


class Cut:
    """What is cut off from the walk of a plan space: nothing until `begin` is called."""

    def __init__(self, space: PlanSpace, views: Sequence[Views]) -> None:
        self._space = space
        self._views = views
        self._continuations: Continuations | None = None
        self._of_view: list[Ints] = []

    @property
    def begun(self) -> bool:
        """Whether the continuations are worked out."""
        return self._continuations is not None

    def begin(self) -> None:
        """Work out the continuations; of nodes with one view they are the same."""
        self._continuations = Continuations(self._space)
        for views, of_node in zip(self._views, self._continuations.of, strict=True):
            of_view = np.zeros(len(views.word), np.int64)
            of_view[views.of] = of_node
            self._of_view.append(of_view)

    def kept(self, table: Ints) -> Ints:
        """The walk nodes (view_1 .. view_n, y or failed, ..) from which a mixture may fail."""
        return table[self.which(table)] if self.begun else table

    def which(self, table: Ints) -> Bools:
        """Whether a mixture may fail from each walk node."""
        if self._continuations is None:
            return np.ones(len(table), np.bool_)
        robots = len(self._views)
        y = table[:, robots]
        kept: Bools = y == FAILED
        going = np.flatnonzero(~kept)
        mine = np.stack([of_view[table[going, k]] for k, of_view in enumerate(self._of_view)])
        kept[going] = self._continuations.can_fail(mine, y[going])
        return kept

    def kept_nodes(self, nodes: Ints) -> Ints:
        """The nodes of the plan space from which a mixture of plans fails."""
        if self._continuations is None:
            return nodes
        return nodes[self._continuations.fails[nodes]]


@dataclass(frozen=True, slots=True)
class WalkTables:
    """What walks of one plan space look things up in, under one assignment of words to its nodes.

    ``views`` are the robots' views of the nodes, ``leads`` numbers what plans are ahead by,
    ``mixtures`` says where mixtures go, ``cut`` what is left out.
    """

    space: PlanSpace
    views: list[Views]
    leads: Leads
    mixtures: Mixtures
    cut: Cut

    @classmethod
    def of(cls, space: PlanSpace, word: Ints) -> WalkTables:
        """Of a plan space; ``word`` (nodes) are the words.  O(edges log edges)."""
        views = [views_of_robot(space, robot, word) for robot in range(space.robots)]
        leads = Leads(int(word.max(initial=0)) + 1)
        return cls(space, views, leads, Mixtures.of(space), Cut(space, views))
