# SPDX-License-Identifier: GPL-3.0-or-later
"""Optimal plans counted, iterated, ranked and sampled, without listing them; or those in slack."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from planners.joint.model import JointModel
from planners.search.plan_space import PlanSpace

if TYPE_CHECKING:
    from planners.search.asynchronous import Timing

#: A plan: the label numbers of all robots, step by step.
Plan = tuple[tuple[int, ...], ...]
#: A joint step as text: each robot's subaction, None where it idles.
Texts = tuple[str | None, ...]


def texts(model: JointModel, plan: Plan) -> tuple[Texts, ...]:
    """A plan's label numbers as text."""
    return tuple(model.texts(step) for step in plan)


def counts(space: PlanSpace) -> list[int]:
    """For each node the exact number of optimal plans from it, as big integers.

    Plans are different sequences of joint *actions*; they may pass through the same states.
    O(edges) additions.
    """
    values = np.ones(len(space), np.object_)
    for nodes, edges in zip(space.layers[1:], space.edges_by_layer(), strict=True):
        first = np.searchsorted(edges.source, np.arange(nodes.start, nodes.stop))
        values[nodes] = np.add.reduceat(values[edges.target], first)
    found: list[int] = values.tolist()
    return found


@dataclass(frozen=True)
class Plans:
    """The optimal plans of one task as a sequence, in lexicographic order of label numbers.

    ``space`` holds the task's plans as paths from node ``start``; ``counted`` is `counts` of it.
    """

    space: PlanSpace
    start: int
    counted: list[int]

    @classmethod
    def of(cls, space: PlanSpace, task: int = 0) -> Plans:
        """The plans of one task of a plan space, counted."""
        return cls(space, int(space.starts[task]), counts(space))

    @property
    def count(self) -> int:
        """How many plans there are, exactly."""
        return self.counted[self.start]

    @cached_property
    def _timing(self) -> Timing | None:
        if not self.space.model.events:
            return None
        from planners.search.asynchronous import Timing

        return Timing(self.space)

    def steps(self, plan: Plan) -> Plan:
        """The joint steps of a plan.

        Without a common step all is done as soon as possible.  With slack the rest at the end is
        left out: where robots have several ways to do nothing only the first one, so that different
        plans stay different.
        """
        if self._timing:
            return self._timing.steps(plan, self.states(plan))
        path = self.space.path_with(self.start, plan) if self.space.model.slack else None
        if path is None:
            return plan
        nodes = self.space.nodes_on(self.start, path)
        length = len(plan)
        while length and path[length - 1] == self._rest(nodes[length - 1]):
            length -= 1
        return plan[:length]

    def of_steps(self, steps: Plan) -> Plan | None:
        """The plan with these joint steps, and with slack a rest at the end.

        None if they begin no plan, or are too many.  Without a common step whatever their timing;
        what is no event of a plan here is -1.
        """
        if self._timing:
            return self._timing.labels(self.start, steps)
        path = self.space.path_with(self.start, steps)
        if path is None:
            return None
        node = self.space.nodes_on(self.start, path)[-1]
        while self.space.layer[node] > 0:
            edge = self._rest(node)
            if edge is None:
                return None
            steps = (*steps, self.space.labels_of(edge))
            node = self.space.target_of(edge)
        return steps

    def __iter__(self) -> Iterator[Plan]:
        """All plans, lazily: memory is one plan, with the edges beside it."""
        space = self.space
        begun: list[tuple[int, Plan]] = [(self.start, ())]
        while begun:
            node, plan = begun.pop()
            if space.layer[node] == 0:
                yield plan
            begun.extend(
                (space.target_of(edge), (*plan, space.labels_of(edge)))
                for edge in reversed(space.out_edges(node))
            )

    def unrank(self, rank: int) -> Plan:
        """The plan at a position of the order; raises `IndexError` outside ``0 .. count - 1``."""
        if not 0 <= rank < self.count:
            raise IndexError(f"there are {self.count} plans, no plan number {rank}")
        plan = []
        node = self.start
        while self.space.layer[node] > 0:
            edge = self.space.out_edges(node).start
            while rank >= (below := self.counted[self.space.target_of(edge)]):
                rank -= below
                edge += 1
            plan.append(self.space.labels_of(edge))
            node = self.space.target_of(edge)
        return tuple(plan)

    def rank(self, plan: Plan) -> int | None:
        """The position of a plan, or None if it is not an optimal plan of the task."""
        if len(plan) != self.space.layer[self.start]:
            return None
        path = self.space.path_with(self.start, plan)
        if path is None:
            return None
        before = [
            range(self.space.out_edges(node).start, edge)
            for node, edge in zip(self.space.nodes_on(self.start, path), path, strict=False)
        ]
        return sum(self.counted[self.space.target_of(e)] for edges in before for e in edges)

    def _rest(self, node: int) -> int | None:
        """The edge from a goal's node in which every robot idles, None if there is none."""
        space = self.space
        row = space.model.forgetting_slack(space.rows[space.state[[node]]])
        is_over = space.model.holds(space.goals[space.goal[node]], row)[0]
        return space.edge_with(node, (0,) * space.robots) if is_over else None

    def sample(self, number: int, seed: int) -> Iterator[Plan]:
        """Plans drawn uniformly and independently; the same seed draws the same plans."""
        from random import Random

        random = Random(seed)
        for _ in range(number):
            yield self.unrank(random.randrange(self.count))

    def states(self, plan: Plan) -> list[int]:
        """The state numbers (in ``space.rows``) that a plan passes through, first to last."""
        path = self.space.path_with(self.start, plan)
        if path is None:
            raise ValueError(f"this is no {self.space.model.kept_plan} of the task")
        found: list[int] = self.space.state[self.space.nodes_on(self.start, path)].tolist()
        return found
