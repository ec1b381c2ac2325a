# SPDX-License-Identifier: GPL-3.0-or-later
"""Plans whose mixture breaks, found without walking along several plans at once.

The earliest break of a task's mixtures comes from the robots' choices: breadth first over nodes
``(D_1 .. D_n, y)``, what each robot may still do and where the mixture is.  There are never more
mixed actions to look at than a node has edges and one more, because different edges have different
labels.  Plans that stay in the same states share all of them: their walk is over nodes ``(x, y)``.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from coordlang.required.choices import Choices
from planners.joint.tables import Bools, unique_tuples
from planners.search.plan_space import PlanSpace
from planners.system.limits import reaching

#: The labels of all robots in one joint step.
Labels = tuple[int, ...]
#: Nodes ``(D_1 .. D_n, y)`` from which some mixture fails, and the mixed labels on a way to them.
_Failing = dict[tuple[int, ...], tuple[Labels, ...]]


@dataclass(frozen=True, slots=True)
class Trail:
    """Plans to a breaking step: where they start, and the edges of each plan, step by step."""

    start: int
    edges: tuple[tuple[int, ...], ...]


# ---- any plans


def earliest_witness(choices: Choices, start: int) -> Trail:
    """Plans from a node that requires coordination whose mixture breaks in the fewest steps.

    As many robots as is easily possible follow the same plan.
    """
    labels = _earliest_labels(choices, start)
    space = choices.space

    def plan_of(robots: Sequence[int]) -> list[int] | None:
        return space.path_of_robots(start, robots, [[step[r] for r in robots] for step in labels])

    plans = _shared_plans(space.robots, plan_of)
    return Trail(start, tuple(zip(*(plan[: len(labels)] for plan in plans), strict=True)))


def _earliest_labels(choices: Choices, start: int) -> list[Labels]:
    """The mixed labels, step by step, of a failing choice that breaks earliest; the last breaks."""
    layer: _Failing = {(*choices.of_node[:, start].tolist(), start): ()}
    steps = 0

    def so_far() -> str:
        return (
            f"{steps} of {int(choices.space.layer[start])} steps to the first break of a mixture, "
            f"{len(layer):,} nodes"
        )

    with reaching(so_far, choices.space.model.smaller("smaller tasks")):
        while True:
            layer, broken = _steps_of_choices(choices, layer)
            if broken is not None:
                return broken
            steps += 1


def _steps_of_choices(choices: Choices, layer: _Failing) -> tuple[_Failing, list[Labels] | None]:
    """The failing choices one step on; or none, and the labels up to the first break."""
    below: _Failing = {}
    for (*chosen, node), path in layer.items():
        moves = [choices.sets.moves(number) for number in chosen]
        edges = choices.edges_of(node)
        for labels in product(*moves):
            target = edges.get(labels)
            if target is None:
                return {}, [*path, labels]
            after = tuple(own[label] for own, label in zip(moves, labels, strict=True))
            if (*after, target) not in below and choices.fails(after, target):
                below[*after, target] = (*path, labels)
    return below, None


def _shared_plans(
    robots: int, plan_of: Callable[[Sequence[int]], list[int] | None]
) -> list[list[int]]:
    """A plan for each robot, the same one for robots for which one is found together."""
    groups: list[list[int]] = []
    plans: list[list[int]] = []
    for robot in range(robots):
        for number, group in enumerate(groups):
            if (together := plan_of([*group, robot])) is not None:
                group.append(robot)
                plans[number] = together
                break
        else:
            alone = plan_of([robot])
            assert alone is not None, "the robot's labels are those of some plan"
            groups.append([robot])
            plans.append(alone)
    of_robot = {r: plan for group, plan in zip(groups, plans, strict=True) for r in group}
    return [of_robot[robot] for robot in range(robots)]


# ---- plans through the same states

#: Edges that join the same two nodes: plans through the same states choose among them freely.
_Bundle = list[int]
#: A node ``(x, y)`` of the walk: where the plans are, and where their mixture is.
_Pair = tuple[int, int]
#: How the walk came to a node: the way before, and what the plans and their mixture did; at the
#: beginning the number of a node of the plan space.
_Way = int | tuple["_Way", _Bundle, Labels]


def witness_in_same_states(space: PlanSpace) -> Trail | None:
    """Plans of some task that pass through the same states and yet introduce RC, or None.

    While all mixtures of the edges between two states are edges between them, the mixture is where
    the plans are.  So the walk begins only where some are not; O(nodes of a layer) for each node in
    the worst case.
    """
    leaking = np.flatnonzero(_leaks(space))
    arriving: dict[_Pair, _Way] = {}
    steps = nodes = 0

    def so_far() -> str:
        return f"{steps} of {len(space.layers) - 1} steps along equal states, {nodes:,} nodes"

    with reaching(so_far, space.model.smaller("smaller tasks")):
        for layer in range(len(space.layers) - 1, 0, -1) if len(leaking) else ():
            here = leaking[space.layer[leaking] == layer].tolist()
            ways = {pair: arriving[pair] for pair in sorted(arriving)}
            ways.update(((node, node), node) for node in here)
            steps, nodes = steps + 1, nodes + len(ways)
            arriving, broken = _steps_in_same_states(space, ways)
            if broken is not None:
                return _trail_in_same_states(space, broken)
    return None


def _leaks(space: PlanSpace) -> Bools:
    """(nodes) out of which some mixture of the edges of a bundle is none of them.

    O(edges log edges).
    """
    ends = np.column_stack((space.sources, space.targets()))
    pairs, bundle = unique_tuples(ends, [len(space)] * 2)
    mixtures = np.ones(len(pairs))
    for robot in range(space.robots):
        own = space.robot_labels(robot)
        bounds = [max(1, len(pairs)), int(own.max(initial=0)) + 1]
        different, _ = unique_tuples(np.column_stack((bundle, own)), bounds)
        mixtures *= np.bincount(different[:, 0], minlength=len(pairs))
    found = np.zeros(len(space), np.bool_)
    found[pairs[mixtures > np.bincount(bundle, minlength=len(pairs)), 0]] = True
    return found


def _steps_in_same_states(
    space: PlanSpace, ways: Mapping[_Pair, _Way]
) -> tuple[dict[_Pair, _Way], _Way | None]:
    """The nodes off the diagonal one step on, and the first mixture that breaks, if any does."""
    below: dict[_Pair, _Way] = {}
    for (x, y), way in ways.items():
        bundles: dict[int, _Bundle] = {}
        for edge in space.out_edges(x):
            bundles.setdefault(space.target_of(edge), []).append(edge)
        targets = {space.labels_of(edge): space.target_of(edge) for edge in space.out_edges(y)}
        for target in sorted(bundles):
            labels = zip(*map(space.labels_of, bundles[target]), strict=True)
            for mixed in product(*(sorted(set(own)) for own in labels)):
                longer = (way, bundles[target], mixed)
                if mixed not in targets:
                    return {}, longer
                if targets[mixed] != target:
                    below.setdefault((target, targets[mixed]), longer)
    return below, None


def _trail_in_same_states(space: PlanSpace, way: _Way) -> Trail:
    """The plans behind a break: from a start to where the mixture leaves them, and on."""
    steps: list[tuple[_Bundle, Labels]] = []
    while not isinstance(way, int):
        way, edges, mixed = way
        steps.insert(0, (edges, mixed))
    start, before = _way_to(space, way)

    def plan_of(robots: Sequence[int]) -> list[int] | None:
        path = []
        for edges, mixed in steps:
            labels = [mixed[r] for r in robots]
            own = (e for e in edges if [space.labels_of(e)[r] for r in robots] == labels)
            if (edge := next(own, None)) is None:
                return None
            path.append(edge)
        return path

    plans = _shared_plans(space.robots, plan_of)
    shared = [(edge,) * space.robots for edge in before]
    return Trail(start, (*shared, *zip(*plans, strict=True)))


def _way_to(space: PlanSpace, node: int) -> tuple[int, list[int]]:
    """The nearest start of a task on whose plans a node lies, and the edges from it to the node."""
    leads = space.ancestors(np.array([node]))
    starts = space.starts[leads[space.starts]]
    start = at = int(starts[np.argmin(space.layer[starts])])
    path = []
    while at != node:
        path.append(next(e for e in space.out_edges(at) if leads[space.target_of(e)]))
        at = space.target_of(path[-1])
    return start, path
