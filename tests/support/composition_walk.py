# SPDX-License-Identifier: GPL-3.0-or-later
"""Required coordination by walking n plans and their mixture in step: the twin of the choices.

Plans ``pi_1 .. pi_n`` introduce RC iff their mixture, in which robot i does its part of ``pi_i``, is
not an optimal plan.  The walk goes through nodes ``(x_1 .. x_n, y)``: where the plans are, and where
the mixture is.  Polynomial, but it grows with the power n + 1 of a layer.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from coordlang.required.composition_walk import FAILED, moves
from coordlang.required.divergences import Divergences
from planners.joint.tables import Bools, Ints, unique_tuples
from planners.search.edge_index import EdgeIndex
from planners.search.plan_space import PlanSpace


@dataclass(frozen=True, slots=True)
class Walk:
    """What a composition walk found.

    ``requires`` (plan-space nodes): do some plans from this node introduce RC?  ``divergences``:
    where such plans part first.  ``nodes`` and ``edges`` count the walk's work.
    """

    requires: Bools
    divergences: Divergences
    nodes: int
    edges: int


@dataclass(frozen=True, slots=True)
class _Layer:
    """One layer of the walk.

    Its nodes, which of them fail at once, and the pairs (node, node of the next layer).
    """

    nodes: Ints
    fails: Bools
    links: Ints
    # Moves out of diagonal nodes (p, .., p; p) to different next nodes: (p, next nodes .., child or
    # FAILED).
    parting: Ints

    def point_to(self, place: Ints) -> None:
        """Renumber the children: number k becomes ``place[k]``."""
        for numbers in (self.links[:, 1], self.parting[:, -1]):
            known = numbers != FAILED
            numbers[known] = place[numbers[known]]


def walk(space: PlanSpace) -> Walk:
    """Walk from every node ``p`` of the plan space with all plans and the mixture in ``p``.

    Where no plans are inseparable (`inseparable`), the divergences at ``p`` depend on ``p`` only,
    whatever was done before: the proof is in docs/concepts.md.

    Complexity: per goal at most (nodes of a layer)^(robots + 1) walk nodes, in grid-like domains
    about ^2; each has (optimal joint actions)^robots edges.  Raises `OutOfMemory` or `OutOfTime`
    with an estimate as soon as a part of a layer shows that the rest of it will not fit.
    """
    index = EdgeIndex.of(space)
    layers: list[_Layer] = []

    _forward(space, index, layers)
    return _backward(space, layers)


def _forward(space: PlanSpace, index: EdgeIndex, layers: list[_Layer]) -> None:
    """Walk down from the highest layer into ``layers``.

    Every plan-space node starts at its own layer.
    """
    columns = space.robots + 1
    spans = space.layers
    arriving = np.zeros((0, columns), np.int64)
    for number in range(len(spans) - 1, -1, -1):
        span = spans[number]
        starting = np.repeat(np.arange(span.start, span.stop)[:, None], columns, axis=1)
        table, place = unique_tuples(
            np.concatenate((starting, arriving)) - span.start, [span.stop - span.start] * columns
        )
        if layers:
            layers[-1].point_to(place[len(starting) :])
        table += span.start
        if number == 0:
            layers.append(_goal_layer(table))
            break
        layer, arriving = _expand(space, index, table, spans[number - 1])
        layers.append(layer)


def _expand(space: PlanSpace, index: EdgeIndex, table: Ints, below: slice) -> tuple[_Layer, Ints]:
    """One layer's moves.  A node that fails at once needs no children, unless it is diagonal."""
    columns = table.shape[1]
    bounds = [below.stop - below.start] * columns
    diagonal = (table[:, 1:] == table[:, :1]).all(axis=1)
    fails = np.zeros(len(table), np.bool_)
    children: list[Ints] = [np.zeros((0, columns), np.int64)]
    links: list[Ints] = [np.zeros((0, 2), np.int64)]
    parting: list[Ints] = [np.zeros((0, columns + 1), np.int64)]
    count = 0
    for move in moves(space, index, table):
        broken = move.mixed == FAILED
        fails[move.source[broken]] = True
        follow = ~broken & (~fails[move.source] | diagonal[move.source])
        target = space.targets(move.edges)
        fresh, number = unique_tuples(
            np.column_stack((target[follow], move.mixed[follow])) - below.start, bounds
        )
        child = np.full(len(move.source), FAILED, np.int64)
        child[follow] = number + count
        links.append(np.unique(np.column_stack((move.source[follow], child[follow])), axis=0))
        children.append(fresh)
        count += len(fresh)
        parts = diagonal[move.source] & (target != target[:, :1]).any(axis=1)
        parting.append(np.column_stack((table[move.source[parts], 0], target[parts], child[parts])))
    nodes, number = unique_tuples(np.concatenate(children), bounds)
    layer = _Layer(table, fails, np.concatenate(links), np.concatenate(parting))
    layer.point_to(number)
    return layer, nodes + below.start


def _goal_layer(table: Ints) -> _Layer:
    """Plans that reached the goal with their mixture: nothing failed, and nothing follows."""
    none = np.zeros((0, table.shape[1] + 1), np.int64)
    return _Layer(table, np.zeros(len(table), np.bool_), np.zeros((0, 2), np.int64), none)


def _backward(space: PlanSpace, layers: Sequence[_Layer]) -> Walk:
    """From the goals up: a node fails if it fails at once or has a child that fails."""
    requires = np.zeros(len(space), np.bool_)
    below = layers[-1].fails
    found: list[Ints] = []
    for layer in reversed(layers):
        fails = layer.fails.copy()
        if len(layer.links):
            fails[layer.links[below[layer.links[:, 1]], 0]] = True
        diagonal = (layer.nodes[:, 1:] == layer.nodes[:, :1]).all(axis=1)
        requires[layer.nodes[diagonal, 0]] = fails[diagonal]
        if len(layer.parting):
            child = layer.parting[:, -1]
            bad = child == FAILED
            bad[~bad] = below[child[~bad]]
            states = space.state[layer.parting[bad, :-1]]
            found.append(np.column_stack((states[:, 0], _sorted_different(states[:, 1:]))))
        below = fails
    table = np.concatenate(found) if found else np.zeros((0, space.robots + 1), np.int64)
    return Walk(
        requires,
        unique_divergences(Divergences(table[:, 0], table[:, 1:])),
        nodes=sum(len(layer.nodes) for layer in layers),
        edges=sum(len(layer.links) + len(layer.parting) for layer in layers),
    )


def unique_divergences(found: Divergences) -> Divergences:
    """Each divergence once, sorted, and none that another one implies.

    One implies another with the same last state and more next states.
    """
    bound = int(max(found.last.max(initial=0), found.following.max(initial=0))) + 2
    table = np.column_stack((found.last, found.following)) + 1
    table, _ = unique_tuples(table, [bound] * table.shape[1])
    table -= 1
    if table.shape[1] > 3:
        table = table[~_implied(table)]
    return Divergences(table[:, 0], table[:, 1:])


def _implied(table: Ints) -> Bools:
    """Rows whose next states contain those of another row with the same last state."""
    sets = [(int(row[0]), frozenset(int(s) for s in row[1:] if s >= 0)) for row in table]
    known: dict[int, set[frozenset[int]]] = {}
    for last, states in sets:
        known.setdefault(last, set()).add(states)
    return np.array(
        [any(other < states for other in known[last]) for last, states in sets], np.bool_
    )


def _sorted_different(states: Ints) -> Ints:
    """Each row sorted, a repeated value replaced by -1 at the end."""
    states = np.sort(states, axis=1)
    repeated = np.zeros(states.shape, np.bool_)
    repeated[:, 1:] = states[:, 1:] == states[:, :-1]
    largest = np.iinfo(np.int64).max
    states = np.sort(np.where(repeated, largest, states), axis=1)
    return np.where(states == largest, -1, states)
