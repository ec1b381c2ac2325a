# SPDX-License-Identifier: GPL-3.0-or-later
"""Miscoordination shown: plans whose mixture breaks, the step at which it does, and why."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from coordlang.required.choices import Choices
from coordlang.required.composition_walk import FAILED, INSTEAD, moves
from coordlang.tasks.candidates import describe
from planners.errors import ProvedImpossible
from planners.joint.model import PlanningTask
from planners.limits import reaching
from planners.search.edge_index import EdgeIndex
from planners.search.optimal_plans import search
from planners.search.plan_space import PlanSpace
from planners.tables import Ints, unique_tuples

#: Moves of the walk along all plans up to which the earliest break is looked for.
_WIDEST = 20_000_000
#: One joint step as text: each robot's subaction, None for idling.
Step = tuple[str | None, ...]


@dataclass(frozen=True, slots=True)
class Miscoordination:
    """Plans of one task that introduce RC: ``plans[i]`` is what robot i follows.

    ``states[i]`` are the states that plan i passes through (keys); ``mixture`` the joint steps of
    the mixture up to and with the one that breaks, ``mixed_states`` the states before each of them;
    ``step`` the number of the breaking step (from 0) and ``reason`` why it breaks.  ``sentence`` is
    the plans' common sentence where a language was checked.
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


def miscoordination(space: PlanSpace, task: int) -> Miscoordination | None:
    """The plans of a task whose mixture breaks earliest; None if none does.

    Where the walk along all plans could be wide, some plans whose mixture breaks.
    """
    choices = Choices(space)
    start = int(space.starts[task])
    if not choices.requires[start]:
        return None
    if _width(space, start) <= _WIDEST:
        trail = _trail(space, np.array([start]), together=False)
    else:
        trail = _trail_of_choices(choices, start)
    return describe_failure(space, trail) if trail is not None else None


def _width(space: PlanSpace, start: int) -> float:
    """At most so many moves does the walk along all plans from a node make."""
    reached = space.descendants(np.array([start]))
    edges = (np.count_nonzero(reached[layer.source]) for layer in space.edges_by_layer())
    return sum(float(number) ** space.robots for number in edges)


def _trail_of_choices(choices: Choices, start: int) -> Trail:
    """Plans from a node that requires coordination, one for each robot, up to where they break."""
    space = choices.space
    labels = choices.breaking(start)
    paths = [
        space.path_of_robot(start, robot, [step[robot] for step in labels])
        for robot in range(space.robots)
    ]
    steps = zip(*(path[: len(labels)] for path in paths if path is not None), strict=True)
    return Trail(start, tuple(steps))


class Inseparable(ProvedImpossible):
    """Two plans introduce RC but pass through the same states.

    No state-based language can tell them apart.
    """

    def __init__(self, witness: Miscoordination) -> None:
        super().__init__(
            f"two optimal plans of task {witness.task} introduce required coordination but pass "
            "through the "
            "same states: no language over states can tell them apart",
            remedy="Build with --remember-actions: the state then also holds each robot's last "
            "subaction.",
        )
        self.witness = witness


def inseparable(space: PlanSpace) -> Miscoordination | None:
    """Plans of some task that pass through the same states and yet introduce RC, or None."""
    trail = _inseparable(space)
    return describe_failure(space, trail) if trail is not None else None


def require_separable(spaces: Sequence[PlanSpace]) -> None:
    """Raise `Inseparable` if plans of some task introduce RC but pass through the same states."""
    for space in spaces:
        witness = inseparable(space)
        if witness is not None:
            raise Inseparable(witness)


def separable(space: PlanSpace) -> bool:
    """Whether plans that introduce RC always pass through different states."""
    return _inseparable(space) is None


def _inseparable(space: PlanSpace) -> Trail | None:
    ends = np.column_stack((space.sources, space.targets()))
    if len(ends) == len(unique_tuples(ends, [len(space)] * 2)[0]):
        return None  # no two edges join the same two nodes
    return _trail(space, np.unique(space.starts), together=True)


@dataclass(frozen=True, slots=True)
class Trail:
    """A walk to a breaking step: where it started and the edges of each plan, step by step."""

    start: int
    edges: tuple[tuple[int, ...], ...]


def _trail(space: PlanSpace, starts: Ints, *, together: bool) -> Trail | None:
    """Breadth first through the layers, until a mixture breaks.

    Of several breaks the first in order.
    """
    walked = [0, 0]

    def so_far() -> str:
        return (
            f"{walked[0]} of {len(space.layers) - 1} steps of the composition "
            f"walk, {walked[1]:,} nodes"
        )

    with reaching(so_far, INSTEAD):
        return _walk_to_a_break(space, starts, walked, together=together)


def _walk_to_a_break(
    space: PlanSpace, starts: Ints, walked: list[int], *, together: bool
) -> Trail | None:
    """See `_trail`; ``walked`` counts layers and nodes."""
    robots = space.robots
    index = EdgeIndex.of(space)
    table = np.zeros((0, robots + 1), np.int64)
    history: list[
        tuple[Ints, Ints, Ints]
    ] = []  # per layer: nodes, parents, the edges that led there
    parents, came = np.zeros(0, np.int64), np.zeros((0, robots), np.int64)
    for number in range(len(space.layers) - 1, 0, -1):
        fresh = starts[space.layer[starts] == number]
        table = np.concatenate((table, np.repeat(fresh[:, None], robots + 1, axis=1)))
        parents = np.concatenate((parents, np.full(len(fresh), -1)))
        came = np.concatenate((came, np.full((len(fresh), robots), -1)))
        history.append((table, parents, came))
        walked[1] += len(table)
        found: list[Ints] = []
        for move in moves(space, index, table, together=together):
            broken = np.flatnonzero(move.mixed == FAILED)
            if len(broken):
                first = broken[0]
                return _retrace(history, int(move.source[first]), tuple(move.edges[first].tolist()))
            target = space.targets(move.edges)
            found.append(np.column_stack((target, move.mixed, move.source, move.edges)))
        step = np.concatenate(found) if found else np.zeros((0, 2 * robots + 2), np.int64)
        table, number_of = unique_tuples(step[:, : robots + 1], [len(space)] * (robots + 1))
        one = np.zeros(len(table), np.int64)
        one[number_of[::-1]] = np.arange(len(step))[::-1]
        parents, came = step[one, robots + 1], step[one, robots + 2 :]
        walked[0] += 1
    return None


def _retrace(history: list[tuple[Ints, Ints, Ints]], row: int, last: tuple[int, ...]) -> Trail:
    edges = [last]
    for table, parents, came in reversed(history):
        if parents[row] < 0:
            return Trail(int(table[row, 0]), tuple(reversed(edges)))
        edges.append(tuple(came[row].tolist()))
        row = int(parents[row])
    raise AssertionError("a walk starts somewhere")


def describe_failure(
    space: PlanSpace, trail: Trail, sentence: tuple[str, ...] | None = None
) -> Miscoordination:
    """A trail as text, with the plans completed to the goal.

    The mixture goes up to its breaking step, with the reason why it breaks.
    """
    model = space.model
    paths = [_complete(space, plan) for plan in zip(*trail.edges, strict=True)]
    mixed_nodes, mixture = _mixture(space, trail)
    return Miscoordination(
        task=describe(space, int(np.flatnonzero(space.starts == trail.start)[0])),
        robots=model.robots,
        plans=tuple(tuple(model.texts(space.labels_of(e)) for e in path) for path in paths),
        states=tuple(
            tuple(_key(space, node) for node in space.nodes_on(trail.start, path)) for path in paths
        ),
        mixture=tuple(model.texts(labels) for labels in mixture),
        mixed_states=tuple(_key(space, node) for node in mixed_nodes),
        step=len(mixture) - 1,
        reason=_reason(space, mixed_nodes[len(mixture) - 1], mixture[-1]),
        sentence=sentence,
    )


def _complete(space: PlanSpace, edges: Sequence[int]) -> list[int]:
    """A path continued to the goal by first edges."""
    return [*edges, *space.first_path(space.target_of(edges[-1]))]


def _mixture(space: PlanSpace, trail: Trail) -> tuple[list[int], list[tuple[int, ...]]]:
    """The mixture of a trail up to its breaking step: nodes before each step, and its labels."""
    nodes, mixture = [trail.start], []
    for edges in trail.edges:
        mixture.append(tuple(space.labels_of(edge)[robot] for robot, edge in enumerate(edges)))
        edge = space.edge_with(nodes[-1], mixture[-1])
        if edge is None:
            break
        nodes.append(space.target_of(edge))
    return nodes, mixture


def _key(space: PlanSpace, node: int) -> str:
    return space.model.codec.key(space.rows[space.state[node]])


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
        onward = search(model, PlanningTask("the rest", steps.result[same[0]], goal))
    except ProvedImpossible:
        return "it is possible, but then the goal can no longer be reached"
    makespan, _ = onward.cost_of(0)
    if makespan > left:
        return (
            f"it is possible, but too late: the goal is then {makespan} steps away and {left} "
            "are left"
        )
    return "it is possible and in time, but costs more than an optimal plan"
