# SPDX-License-Identifier: GPL-3.0-or-later
"""Miscoordination shown: plans whose mixture breaks, the step at which it does, and why.

The earliest break of a task's mixtures comes from the robots' choices: breadth first over nodes
``(D_1 .. D_n, y)``, what each robot may still do and where the mixture is.  Different edges of a
node have different labels, so no more mixed actions are looked at than it has edges, and one.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np

from coordlang.language.candidates import describe
from coordlang.required.choices import Choices
from planners.joint.model import PlanningTask
from planners.joint.tables import Bools, unique_tuples
from planners.search.optimal_plans import search
from planners.search.plan_space import PlanSpace
from planners.system.errors import ProvedImpossible
from planners.system.limits import reaching

#: The labels of all robots in one joint step.
Labels = tuple[int, ...]
#: A node of a walk: what the plans may still do, and where their mixture is.
_Node = tuple[Any, int]
#: How a walk came to a node: the way before, the mixed labels and what the plans may do after them;
#: at the beginning the number of a node of the plan space.
_Way = int | tuple["_Way", Labels, Any]


@dataclass(frozen=True, slots=True)
class Trail:
    """Plans to a breaking step: where they start, and the edges of each plan, step by step."""

    start: int
    edges: tuple[tuple[int, ...], ...]


def _first_break(
    space: PlanSpace,
    begin: Iterable[_Node],
    steps: Callable[[Any], Iterable[tuple[Labels, Any]]],
    can_fail: Callable[[Any, int], bool],
) -> tuple[int, list[tuple[Labels, Any]]] | None:
    """Where a walk begins that ends with a mixture that breaks, and its steps; None if none does.

    Breadth first; it begins at some nodes.  ``steps`` are for what plans may do the mixed labels,
    each with what they may do then; where no mixture ``can_fail`` it goes no further.
    """
    begins: dict[int, dict[_Node, _Way]] = defaultdict(dict)
    for node in begin:
        begins[int(space.layer[node[1]])][node] = node[1]
    below: dict[_Node, _Way] = {}
    layer = walked = 0

    def so_far() -> str:
        return f"{walked:,} nodes walked to the first break of a mixture, {layer} steps left"

    with reaching(so_far, space.model.smaller("smaller tasks")):
        for layer in range(len(space.layers) - 1, 0, -1):
            here, below = {**below, **begins[layer]}, {}
            walked += len(here)
            for (ahead, y), way in here.items():
                edges = space.out_edges(y)
                targets = {space.labels_of(edge): space.target_of(edge) for edge in edges}
                for mixed, after in steps(ahead):
                    target = targets.get(mixed)
                    if target is None:
                        return _steps_of((way, mixed, after))
                    if (after, target) not in below and can_fail(after, target):
                        below[after, target] = way, mixed, after
    return None


def _steps_of(way: _Way) -> tuple[int, list[tuple[Labels, Any]]]:
    found: list[tuple[Labels, Any]] = []
    while not isinstance(way, int):
        way, mixed, after = way
        found.append((mixed, after))
    return way, found[::-1]


def earliest_witness(choices: Choices, start: int) -> Trail:
    """Plans from a node that requires coordination whose mixture breaks in the fewest steps.

    As many robots as is easily possible follow the same plan.
    """
    space = choices.space

    def steps(chosen: tuple[int, ...]) -> Iterator[tuple[Labels, tuple[int, ...]]]:
        moves = [choices.sets.moves(number) for number in chosen]
        for labels in product(*moves):
            yield labels, tuple(own[label] for own, label in zip(moves, labels, strict=True))

    begin = tuple(choices.of_node[:, start].tolist()), start
    found = _first_break(space, [begin], steps, choices.fails)
    assert found is not None, "the node requires coordination"
    labels = [mixed for mixed, _ in found[1]]

    def plan_of(robots: Sequence[int]) -> list[int] | None:
        return space.path_of_robots(start, robots, [[step[r] for r in robots] for step in labels])

    plans = _shared_plans(space.robots, plan_of)
    return Trail(start, tuple(zip(*(plan[: len(labels)] for plan in plans), strict=True)))


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


def witness_in_same_states(space: PlanSpace) -> Trail | None:
    """Plans of some task that pass through the same states and yet introduce RC, or None.

    Plans through the same states choose freely among the edges between two of them.  While all
    mixtures of these are such edges, the mixture is where the plans are.  So the walk begins only
    where some are not; O(nodes of a layer) for each node in the worst case.
    """

    def steps(x: int) -> Iterator[tuple[Labels, int]]:
        joining: dict[int, list[Labels]] = {}
        for edge in space.out_edges(x):
            joining.setdefault(space.target_of(edge), []).append(space.labels_of(edge))
        for target in sorted(joining):
            own = (sorted(set(labels)) for labels in zip(*joining[target], strict=True))
            yield from ((mixed, target) for mixed in product(*own))

    leaking = np.flatnonzero(_leaks(space)).tolist()
    begin = ((node, node) for node in leaking)
    found = _first_break(space, begin, steps, lambda x, y: x != y)
    if found is None:
        return None
    node, mixture = found

    def plan_of(robots: Sequence[int]) -> list[int] | None:
        path, at = [], node
        for mixed, target in mixture:
            own = (
                edge
                for edge in space.out_edges(at)
                if space.target_of(edge) == target
                and all(space.labels_of(edge)[r] == mixed[r] for r in robots)
            )
            if (edge := next(own, None)) is None:
                return None
            path.append(edge)
            at = target
        return path

    plans = _shared_plans(space.robots, plan_of)
    start, before = way_to(space, node)
    shared = [(edge,) * space.robots for edge in before]
    return Trail(start, (*shared, *zip(*plans, strict=True)))


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


def way_to(space: PlanSpace, node: int) -> tuple[int, list[int]]:
    """The nearest start of a task on whose plans a node lies, and the edges from it to the node."""
    leads = space.ancestors(np.array([node]))
    starts = space.starts[leads[space.starts]]
    start = at = int(starts[np.argmin(space.layer[starts])])
    path = []
    while at != node:
        path.append(next(e for e in space.out_edges(at) if leads[space.target_of(e)]))
        at = space.target_of(path[-1])
    return start, path


#: Characters of a state or goal that a message shows in full.
_LONGEST = 100
#: One joint step as text: each robot's subaction, None for idling.
Step = tuple[str | None, ...]


@dataclass(frozen=True, slots=True)
class Miscoordination:
    """Plans of one task that introduce RC: ``plans[i]`` is what robot i follows.

    ``states[i]`` are the states that plan i passes through (keys); ``mixture`` the joint steps of
    the mixture up to and with the one that breaks, ``mixed_states`` the states before each of them;
    ``step`` the number of the breaking step (from 0) and ``reason`` why it breaks.  ``sentence`` is
    the plans' common sentence where a language was checked.  ``kind`` is what the plans are: an
    "optimal plan" each, or one within the slack.
    """

    task: str
    robots: tuple[str, ...]
    plans: tuple[tuple[Step, ...], ...]
    states: tuple[tuple[str, ...], ...]
    mixture: tuple[Step, ...]
    mixed_states: tuple[str, ...]
    step: int
    reason: str
    sentence: tuple[str, ...] | None = None
    kind: str = "optimal plan"


def miscoordination(space: PlanSpace, task: int) -> Miscoordination | None:
    """Plans of a task whose mixture breaks earliest; None if none does."""
    choices = Choices(space)
    start = int(space.starts[task])
    if not choices.requires[start]:
        return None
    return describe_failure(space, earliest_witness(choices, start))


class Inseparable(ProvedImpossible):
    """Two plans introduce RC but pass through the same states.

    No state-based language can tell them apart.  ``hides_slack``: they differ in where they wait.
    """

    def __init__(self, witness: Miscoordination, *, hides_slack: bool = False) -> None:
        if hides_slack:
            what = "plans within slack", ", though they may wait in different ones"
            remedy = (
                "Build with --words-see-slack: states then also say how much of the slack is left; "
                "or with --remember-actions."
            )
        else:
            what = "optimal plans", ""
            remedy = (
                "Build with --remember-actions: the state then also holds each robot's last "
                "subaction."
            )
        super().__init__(
            f"two {what[0]} of task {_short(witness.task)} introduce required coordination "
            f"but pass through the same states{what[1]}: no language over states can tell them "
            "apart",
            remedy=remedy,
        )
        self.witness = witness


def _short(task: str) -> str:
    """A long task's beginnings; the witness has all of it."""
    parts = task.split(" -> ")
    return " -> ".join(
        part if len(part) <= _LONGEST else f"{part[: part.index(')') + 1]} .." for part in parts
    )


def inseparable(space: PlanSpace) -> Miscoordination | None:
    """Plans of some task that pass through the same states and yet introduce RC, or None."""
    trail = witness_in_same_states(space)
    return describe_failure(space, trail) if trail is not None else None


def separable(space: PlanSpace) -> bool:
    """Whether plans that introduce RC always pass through different states."""
    return witness_in_same_states(space) is None


def describe_failure(
    space: PlanSpace, trail: Trail, sentence: tuple[str, ...] | None = None
) -> Miscoordination:
    """A trail as text, with the plans completed to the goal.

    The mixture goes up to its breaking step, with the reason why it breaks.
    """
    model = space.model
    paths = [
        [*edges, *space.first_path(space.target_of(edges[-1]))]
        for edges in zip(*trail.edges, strict=True)
    ]
    nodes, mixture = [trail.start], list[tuple[int, ...]]()
    for edges in trail.edges:
        mixture.append(tuple(space.labels_of(edge)[robot] for robot, edge in enumerate(edges)))
        mixed = space.edge_with(nodes[-1], mixture[-1])
        if mixed is None:
            break
        nodes.append(space.target_of(mixed))

    def keys(passed: Sequence[int]) -> tuple[str, ...]:
        return tuple(model.codec.key(space.rows[space.state[node]]) for node in passed)

    return Miscoordination(
        task=describe(space, int(np.flatnonzero(space.starts == trail.start)[0])),
        robots=model.robots,
        plans=tuple(tuple(model.texts(space.labels_of(e)) for e in path) for path in paths),
        states=tuple(keys(space.nodes_on(trail.start, path)) for path in paths),
        mixture=tuple(model.texts(labels) for labels in mixture),
        mixed_states=keys(nodes),
        step=len(mixture) - 1,
        reason=_reason(space, nodes[len(mixture) - 1], mixture[-1]),
        sentence=sentence,
        kind=model.kept_plan,
    )


def _reason(space: PlanSpace, node: int, labels: tuple[int, ...]) -> str:
    """Why the mixed joint action is no optimal step in a state.

    Not applicable, or it wastes something.
    """
    model = space.model
    row = space.rows[space.state[node]]
    steps = model.successors(row[None, :])
    same = np.flatnonzero((steps.labels == np.array(labels)).all(axis=1))
    if not len(same):
        return model.why_not(row, labels)
    goal = space.goals[space.goal[node]]
    left = int(space.layer[node]) - 1
    try:
        rest = PlanningTask("the rest", steps.result[same[0]], goal)
        onward = search(model.without_slack, rest)
    except ProvedImpossible:
        return "it is possible, but then the goal can no longer be reached"
    makespan, _ = onward.cost_of(0)
    if makespan > left:
        return (
            f"it is possible, but too late: the goal is then {makespan} steps away and {left} "
            "are left"
        )
    return f"it is possible and in time, but costs more than any {model.kept_plan}"
