# SPDX-License-Identifier: GPL-3.0-or-later
"""What robots can still do, against plans that are listed."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from functools import cache
from itertools import product

import pytest

from coordlang.verification.sets import Continuations, SequenceSets
from planners.search.plan_space import PlanSpace
from planners.search.plans import counts
from tests.support.random_spaces import random_spaces, runs

#: Plans from a node that are listed, by the number of robots.
PLANS = {1: 40, 2: 40, 3: 12, 4: 8}
#: One robot's labels, step by step.
Sequence = tuple[int, ...]


def sequences(sets: SequenceSets, number: int) -> set[Sequence]:
    """The members of a set, written out."""
    if not sets.moves[number]:
        return {()}
    return {
        (label, *rest)
        for label, after in sets.moves[number].items()
        for rest in sequences(sets, after)
    }


class Listed:
    """The optimal plans from each node, as sequences of label tuples."""

    def __init__(self, space: PlanSpace) -> None:
        self.space = space
        self.plans = cache(self._plans)

    def _plans(self, node: int) -> frozenset[tuple[tuple[int, ...], ...]]:
        edges = self.space.out_edges(node)
        if not edges:
            return frozenset({()})
        return frozenset(
            (tuple(self.space.labels_of(edge)), *rest)
            for edge in edges
            for rest in self.plans(self.space.target_of(edge))
        )

    def own(self, robot: int, node: int) -> set[Sequence]:
        """The sequences of one robot's labels."""
        return {tuple(step[robot] for step in plan) for plan in self.plans(node)}

    def fails(self, x: tuple[int, ...], y: int) -> bool:
        """Whether some mixture of plans from the ``x`` is no optimal plan from ``y``."""
        parts = [self.own(robot, node) for robot, node in enumerate(x)]
        return any(
            tuple(zip(*mixed, strict=True)) not in self.plans(y) for mixed in product(*parts)
        )


def small_spaces(seeds: range, robots: int | None) -> Iterator[PlanSpace]:
    for _, space in random_spaces(seeds, robots, most=120):
        if len(space) and max(counts(space)) <= PLANS[space.robots]:
            yield space


def compared(seeds: range, robots: int | None) -> Counter[str]:
    met: Counter[str] = Counter()
    for space in small_spaces(seeds, robots):
        listed, found = Listed(space), Continuations(space)
        for robot, node in product(range(space.robots), range(len(space))):
            mine = sequences(found.sets, int(found.of[robot, node]))
            assert mine == listed.own(robot, node)
        for node in range(len(space)):
            fails = listed.fails((node,) * space.robots, node)
            assert found.fails[node] == fails
            met[f"nodes: {fails}"] += 1
    return met


@pytest.mark.parametrize(("robots", "seeds"), runs(120, 60, 60))
def test_continuations_are_those_of_listed_plans(robots: int | None, seeds: range) -> None:
    met = compared(seeds, robots)
    assert min(met["nodes: True"], met["nodes: False"]) >= 15
