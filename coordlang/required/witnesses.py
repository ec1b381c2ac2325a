# SPDX-License-Identifier: GPL-3.0-or-later
"""Plans whose mixture breaks, found without walking along several plans at once.

The earliest break of a task's mixtures comes from the robots' choices: breadth first over nodes
``(D_1 .. D_n, y)``, what each robot may still do and where the mixture is.  There are never more
mixed actions to look at than a node has edges and one more, because different edges have different
labels.  Plans that stay in the same states share all of them: their walk is over nodes ``(x, y)``.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from coordlang.required.choices import Choices
from planners.joint.tables import Bools, Ints, ranges, spans, unique_tuples
from planners.search.edge_index import EdgeIndex
from planners.search.plan_space import PlanSpace
from planners.system.limits import reaching

#: The labels of all robots in one joint step.
Labels = tuple[int, ...]
#: Moves of one layer that are handled at a time.
_PIECE = 1_000_000


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
    layer: dict[tuple[int, ...], tuple[Labels, ...]] = {
        (*choices.of_node[:, start].tolist(), start): ()
    }

    def so_far() -> str:
        steps = len(next(iter(layer.values())))
        return (
            f"{steps} of {int(choices.space.layer[start])} steps to the first break of a mixture, "
            f"{len(layer):,} nodes"
        )

    with reaching(so_far, choices.space.model.smaller("smaller tasks")):
        while True:
            below, broken = _steps_of_choices(choices, layer)
            if broken is not None:
                return broken
            layer = below


def _steps_of_choices(
    choices: Choices, layer: Mapping[tuple[int, ...], tuple[Labels, ...]]
) -> tuple[dict[tuple[int, ...], tuple[Labels, ...]], list[Labels] | None]:
    """The failing choices one step on; or none, and the labels up to the first break."""
    below: dict[tuple[int, ...], tuple[Labels, ...]] = {}
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


@dataclass(frozen=True, slots=True)
class _Bundles:
    """The edges that join the same two nodes, bundled: plans through the same states choose freely.

    ``order`` lists the edges bundle by bundle; ``first`` (bundles + 1) delimits them in it.  Per
    bundle ``source`` and ``target``; per robot the different ``labels`` of a bundle, delimited by
    ``starts`` (bundles + 1); ``leaks``: is some mixture of a bundle's edges none of them?
    """

    order: Ints
    first: Ints
    source: Ints
    target: Ints
    starts: tuple[Ints, ...]
    labels: tuple[Ints, ...]
    leaks: Bools

    @classmethod
    def of(cls, space: PlanSpace) -> _Bundles:
        """The bundles of a plan space, sorted by source; O(edges log edges)."""
        source, target = space.sources, space.targets()
        pairs, number = unique_tuples(np.column_stack((source, target)), [len(space)] * 2)
        order = np.argsort(number, kind="stable")
        first = np.searchsorted(number[order], np.arange(len(pairs) + 1))
        starts, labels = [], []
        combinations = np.ones(len(pairs))
        for robot in range(space.robots):
            own = space.robot_labels(robot)
            bounds = [len(pairs), int(own.max(initial=0)) + 1]
            different, _ = unique_tuples(np.column_stack((number, own)), bounds)
            starts.append(np.searchsorted(different[:, 0], np.arange(len(pairs) + 1)))
            labels.append(different[:, 1])
            combinations *= np.diff(starts[-1])
        leaks = combinations > np.diff(first)
        return cls(order, first, pairs[:, 0], pairs[:, 1], tuple(starts), tuple(labels), leaks)

    def edges(self, bundle: int) -> list[int]:
        """The edges of a bundle."""
        found: list[int] = self.order[self.first[bundle] : self.first[bundle + 1]].tolist()
        return found

    def mixtures(self, bundle: int) -> Iterable[Labels]:
        """All combinations of the robots' labels on a bundle's edges."""
        return product(
            *(
                labels[starts[bundle] : starts[bundle + 1]].tolist()
                for labels, starts in zip(self.labels, self.starts, strict=True)
            )
        )


@dataclass(frozen=True, slots=True)
class _Step:
    """One layer of the walk: how its rows ``(x, y)`` were reached, and where from.

    ``parent`` (-1: it begins here) is a row of the layer above, ``bundle`` what the plans took,
    ``edge`` what the mixture took.
    """

    rows: Ints
    parent: Ints
    bundle: Ints
    edge: Ints


def witness_in_same_states(space: PlanSpace) -> Trail | None:
    """Plans of some task that pass through the same states and yet introduce RC, or None.

    While all mixtures of the edges between two states are edges between them, the mixture is where
    the plans are.  So the walk begins only where some are not; O(nodes of a layer) for each node in
    the worst case.
    """
    bundles = _Bundles.of(space)
    if not bundles.leaks.any():
        return None
    history: list[_Step] = []

    def so_far() -> str:
        nodes = sum(len(step.rows) for step in history)
        return (
            f"{len(history)} of {len(space.layers) - 1} steps along equal states, {nodes:,} nodes"
        )

    with reaching(so_far, space.model.smaller("smaller tasks")):
        return _walk_in_same_states(space, bundles, history)


def _walk_in_same_states(space: PlanSpace, bundles: _Bundles, history: list[_Step]) -> Trail | None:
    index = EdgeIndex.of(space)
    leaking = np.unique(bundles.source[bundles.leaks])
    none = np.zeros(0, np.int64)
    arriving = _Step(np.zeros((0, 2), np.int64), none, none, none)
    for layer in range(len(space.layers) - 1, 0, -1):
        here = leaking[space.layer[leaking] == layer]
        new = np.full(len(here), -1)
        step = _Step(
            np.concatenate((arriving.rows, np.column_stack((here, here)))),
            np.concatenate((arriving.parent, new)),
            np.concatenate((arriving.bundle, new)),
            np.concatenate((arriving.edge, new)),
        )
        history.append(step)
        found = _moves_in_same_states(space, bundles, index, step.rows)
        if isinstance(found, tuple):
            return _trail_in_same_states(space, bundles, history, *found)
        away = found.rows[:, 0] != found.rows[:, 1]
        rows, one = np.unique(found.rows[away], axis=0, return_index=True)
        one = np.flatnonzero(away)[one]
        arriving = _Step(rows, found.parent[one], found.bundle[one], found.edge[one])
    return None


def _moves_in_same_states(
    space: PlanSpace, bundles: _Bundles, index: EdgeIndex, rows: Ints
) -> _Step | tuple[int, int]:
    """All moves out of rows ``(x, y)``; or the row and the bundle of the first mixture to break."""
    low = np.searchsorted(bundles.source, rows[:, 0])
    high = np.searchsorted(bundles.source, rows[:, 0], side="right")
    found: list[Ints] = [np.zeros((0, 3), np.int64)]
    sizes = ((high - low) * space.out_degrees[rows[:, 1]]).astype(np.float64)
    for span in spans(sizes, _PIECE):
        counts = (high - low)[span]
        row = np.repeat(np.arange(span.start, span.stop), counts)
        bundle = ranges(low[span], counts)
        # On the diagonal a bundle without leak leads back to the diagonal.
        walks = (rows[row, 0] != rows[row, 1]) | bundles.leaks[bundle]
        row, bundle = row[walks], bundle[walks]
        prefix = rows[row, 1]
        for robot, (starts, labels) in enumerate(zip(bundles.starts, bundles.labels, strict=True)):
            counts = starts[bundle + 1] - starts[bundle]
            label = labels[ranges(starts[bundle], counts)]
            row, bundle, prefix = (np.repeat(part, counts) for part in (row, bundle, prefix))
            prefix = index.follow(robot, prefix, label)
            broken = np.flatnonzero(prefix < 0)
            if len(broken):
                return int(row[broken[0]]), int(bundle[broken[0]])
        found.append(np.column_stack((row, bundle, prefix)))
    row, bundle, edge = np.concatenate(found).T
    below = np.column_stack((bundles.target[bundle], space.targets(edge)))
    return _Step(below, row, bundle, edge)


def _trail_in_same_states(
    space: PlanSpace, bundles: _Bundles, history: Sequence[_Step], row: int, bundle: int
) -> Trail:
    """The plans behind a break: from a start to where the mixture leaves them, and on."""
    y = int(history[-1].rows[row, 1])
    breaking = next(m for m in bundles.mixtures(bundle) if space.edge_with(y, m) is None)
    steps = [(bundles.edges(bundle), breaking)]
    for step in reversed(history):
        parent = int(step.parent[row])
        if parent < 0:
            start, before = _way_to(space, int(step.rows[row, 0]))
            break
        mixed = space.labels_of(int(step.edge[row]))
        steps.append((bundles.edges(int(step.bundle[row])), mixed))
        row = parent
    steps.reverse()

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
