# SPDX-License-Identifier: GPL-3.0-or-later
"""Required coordination by walking n plans and their mixture in step: the twin of witnesses.

Plans ``pi_1 .. pi_n`` introduce RC iff their mixture, in which robot i does its part of ``pi_i``, is
not an optimal plan.  The walk goes through nodes ``(x_1 .. x_n, y)``: where the plans are, and where
the mixture is.
"""

from __future__ import annotations

from itertools import product

from planners.search.plan_space import PlanSpace

Nodes = tuple[int, ...]
#: For each node the next one by the labels of the step.
Steps = list[dict[Nodes, int]]


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
