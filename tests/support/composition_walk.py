# SPDX-License-Identifier: GPL-3.0-or-later
"""Required coordination by walking n plans and their mixture in step: the twin of the choices.

Plans ``pi_1 .. pi_n`` introduce RC iff their mixture, in which robot i does its part of ``pi_i``, is
not an optimal plan.  The walk goes through nodes ``(x_1 .. x_n, y)``: where the plans are, and where
the mixture is.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product

import numpy as np

from coordlang.required.divergences import Divergences
from planners.joint.tables import Bools
from planners.search.plan_space import PlanSpace

Nodes = tuple[int, ...]
#: For each node the next one by the labels of the step.
Steps = list[dict[Nodes, int]]


@dataclass(frozen=True, slots=True)
class Walk:
    """What a walk found.

    ``requires`` (plan-space nodes): do some plans from this node introduce RC?  ``divergences``:
    where such plans part first, those that no other one implies.
    """

    requires: Bools
    divergences: Divergences


def steps_of(space: PlanSpace) -> Steps:
    steps: Steps = [{} for _ in range(len(space))]
    table = zip(space.sources.tolist(), space.labels.tolist(), space.target.tolist(), strict=True)
    for node, labels, target in table:
        steps[node][tuple(labels)] = target
    return steps


def first_break(steps: Steps, robots: int, starts: list[int], *, together: bool) -> int | None:
    """The least step after which a mixture of plans from one of the nodes begins no optimal plan;
    with ``together`` of plans in the same states only.
    """
    layer, step = {((start,) * robots, start) for start in starts}, 0
    seen = {*layer}
    while layer:
        after = set()
        for plans, mixture in layer:
            for chosen in product(*(steps[node].items() for node in plans)):
                ends = tuple(target for _, target in chosen)
                if together and len({*ends}) > 1:
                    continue
                mixed = tuple(labels[robot] for robot, (labels, _) in enumerate(chosen))
                if mixed not in steps[mixture]:
                    return step
                after.add((ends, steps[mixture][mixed]))
        layer, step = after - seen, step + 1
        seen |= after
    return None


def walk(space: PlanSpace) -> Walk:
    """Walk from every node ``p`` of the plan space with all plans and the mixture in ``p``.

    Where no plans are inseparable (`inseparable`), the divergences at ``p`` depend on ``p`` only,
    whatever was done before: the proof is in docs/concepts.md.
    """
    steps = steps_of(space)
    known: dict[tuple[Nodes, int], bool] = {}

    def moves(plans: Nodes, mixture: int) -> Iterator[tuple[Nodes, int | None]]:
        """What one step leads to; None: the mixture is no optimal plan any more."""
        for chosen in product(*(steps[node].items() for node in plans)):
            mixed = tuple(labels[robot] for robot, (labels, _) in enumerate(chosen))
            yield tuple(target for _, target in chosen), steps[mixture].get(mixed)

    def fails(plans: Nodes, mixture: int | None) -> bool:
        """Whether some plans from here have a mixture that is none."""
        if mixture is None:
            return True
        if (plans, mixture) not in known:
            known[plans, mixture] = any(fails(*after) for after in {*moves(plans, mixture)})
        return known[plans, mixture]

    requires = np.zeros(len(space), np.bool_)
    found: dict[int, set[frozenset[int]]] = {}
    for node in range(len(space)):
        together = (node,) * space.robots
        requires[node] = fails(together, node)
        parting = {after for after in moves(together, node) if len({*after[0]}) > 1}
        own = {
            frozenset(space.state[[*plans]].tolist()) for plans, at in parting if fails(plans, at)
        }
        found.setdefault(int(space.state[node]), set()).update(own)
    rows = sorted(
        (last, *sorted(states), *[-1] * (space.robots - len(states)))
        for last, sets in found.items()
        for states in sets
        if not any(other < states for other in sets)
    )
    array = np.array(rows, np.int64).reshape(len(rows), space.robots + 1)
    return Walk(requires, Divergences(array[:, 0], array[:, 1:]))
