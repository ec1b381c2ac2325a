# SPDX-License-Identifier: GPL-3.0-or-later
"""All optimal plans by blind breadth-first search: what the bounded search replaced."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from planners.joint.conditions import Labels
from planners.joint.model import JointModel, PlanningTask, Steps
from planners.joint.tables import Ints, Rows, find_rows, unique_rows
from planners.search.plan_space import PlanSpace
from planners.search.reachable import PIECES, PieceSizes, blocks
from planners.search.unreachable import searched
from planners.system.errors import ProvedImpossible
from planners.system.limits import reaching

_FAR = np.iinfo(np.int64).max // 4
#: The steps of a layer in pieces: (number of the first state, steps).
Stored = list[tuple[int, Steps]]


def _none() -> Ints:
    return np.zeros(0, np.int64)


def search(model: JointModel, task: PlanningTask, pieces: PieceSizes = PIECES) -> PlanSpace:
    """All optimal plans of one task, expanding only states nearer than the goal.

    Forward search to the first layer that holds a goal state, then back along optimal edges.
    Raises `ProvedImpossible` if the goal cannot be reached.
    """
    layers: list[Rows] = []
    kept: list[Stored | None] = []

    def so_far() -> str:
        return (
            f"{sum(map(len, layers)):,} states within {len(layers) - 1} steps of the initial "
            f"state of {task.name}, "
            f"{len(layers[-1]) if layers else 0:,} of them new in the last step"
        )

    with reaching(so_far, "a task with a shorter plan, fewer objects or fewer robots"):
        _forward(model, task, layers, kept, pieces)
        return _backward(model, task, layers, kept, pieces)


def _forward(
    model: JointModel,
    task: PlanningTask,
    layers: list[Rows],
    kept: list[Stored | None],
    pieces: PieceSizes,
) -> None:
    """Fill ``layers`` with the states by their distance from the start.

    ``kept`` gets the joint steps out of them.
    """
    layer = task.init[None, :]
    seen = layer
    total = 0
    layers.append(layer)
    while not model.holds(task.goal, layer).any():
        fresh: list[Rows] = []
        steps_here: Stored | None = []
        for start, steps in blocks(model, layer, pieces):
            total += len(steps)
            if total > pieces.kept:
                steps_here = None
            if steps_here is not None:
                steps_here.append((start, steps))
            fresh.append(unique_rows(steps.result)[0])
        new, _ = unique_rows(np.concatenate(fresh))
        layer = new[find_rows(seen, new) < 0]
        if not len(layer):
            raise ProvedImpossible(
                f"task {task.name}: the goal cannot be reached",
                position=task.position,
                remedy=searched(model, task.goal, seen),
            )
        seen, _ = unique_rows(np.concatenate((seen, layer)))
        layers.append(layer)
        kept.append(steps_here)


def _backward(
    model: JointModel,
    task: PlanningTask,
    layers: list[Rows],
    kept: list[Stored | None],
    pieces: PieceSizes,
) -> PlanSpace:
    """Keep the edges that lead to the goal in time and at least cost, from the last layer back."""
    goal_rows = layers[-1][model.holds(task.goal, layers[-1])]
    tables = [goal_rows]
    best = [np.zeros(len(goal_rows), np.int64)]
    edges: list[tuple[Ints, Ints, Labels, Ints]] = []
    for rows, stored in zip(reversed(layers[:-1]), reversed(kept), strict=True):
        source, target, labels, cost = _edges_into(model, rows, stored, tables[-1], pieces)
        value = np.full(len(rows), _FAR)
        np.minimum.at(value, source, cost + best[-1][target])
        tight = cost + best[-1][target] == value[source]
        alive = np.flatnonzero(value < _FAR)
        number = np.cumsum(value < _FAR) - 1
        edges.append((number[source[tight]], target[tight], labels[tight], cost[tight]))
        tables.append(rows[alive])
        best.append(value[alive])
    offsets = np.cumsum([0, *(len(t) for t in tables)])
    source = np.concatenate([e[0] + offsets[k + 1] for k, e in enumerate(edges)] or [_none()])
    graph = PlanSpace(
        model=model,
        rows=np.concatenate(tables),
        state=np.arange(offsets[-1]),
        goal=np.zeros(offsets[-1], np.int64),
        layer=np.repeat(np.arange(len(tables)), np.diff(offsets)),
        first=np.searchsorted(source, np.arange(offsets[-1] + 1)),
        target=np.concatenate([e[1] + offsets[k] for k, e in enumerate(edges)] or [_none()]),
        labels=np.concatenate(
            [e[2] for e in edges] or [np.zeros((0, len(model.robots)), np.int32)]
        ),
        cost=np.concatenate([e[3] for e in edges] or [_none()]),
        goals=(task.goal,),
        starts=np.array([offsets[-2]]),
        second=best[-1][:1],
    )
    return _sort_states(graph).reduced()


def _edges_into(
    model: JointModel, rows: Rows, stored: Stored | None, table: Rows, pieces: PieceSizes
) -> tuple[Ints, Ints, Labels, Ints]:
    """The steps from ``rows`` into the sorted ``table``."""
    parts: list[tuple[Ints, Ints, Labels, Ints]] = []
    for start, block in stored if stored is not None else blocks(model, rows, pieces):
        target = find_rows(table, block.result)
        hit = target >= 0
        parts.append((block.source[hit] + start, target[hit], block.labels[hit], block.cost[hit]))
    source, target, labels, cost = (np.concatenate(column) for column in zip(*parts, strict=True))
    return source, target, labels, cost


def _sort_states(graph: PlanSpace) -> PlanSpace:
    """The same graph with a sorted table of states."""
    rows, number = unique_rows(graph.rows)
    return replace(graph, rows=rows, state=number[graph.state])
