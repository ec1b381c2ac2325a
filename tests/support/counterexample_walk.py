# SPDX-License-Identifier: GPL-3.0-or-later
"""Counterexamples by a walk that nothing cuts off but words: the twin of `counterexamples`."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from coordlang.required.composition_walk import FAILED, moves
from coordlang.vocabulary.counterexamples import Counterexample, _backward, _Layer, _layer, _retrace
from coordlang.vocabulary.leads import NO_WORD, PARTED, Leads
from planners.joint.tables import Ints, unique_tuples
from planners.search.edge_index import EdgeIndex
from planners.search.plan_space import PlanSpace


def walked(space: PlanSpace, word: Ints, most: int) -> Iterator[Counterexample]:
    """What `counterexamples` gives, for a plan space and the word of each of its nodes."""
    layers = _forward(space, EdgeIndex.of(space), word, np.unique(space.starts))
    _backward(space, layers)
    for found in _retrace(space, layers, most):
        yield from map(found.one, range(len(found)))


def _forward(space: PlanSpace, index: EdgeIndex, word: Ints, starts: Ints) -> list[_Layer]:
    """The nodes of the walk: ``layers[k]`` has k joint steps to go."""
    robots = space.robots
    leads = Leads()
    layers: list[_Layer] = []
    arriving = np.zeros((0, 2 * robots), np.int64)
    for number in reversed(range(len(space.layers))):
        here = starts[space.layer[starts] == number]
        fresh = np.zeros((len(here), 2 * robots), np.int64)
        fresh[:, : robots + 1] = here[:, None]
        both = np.concatenate((fresh, arriving))
        bounds = (
            [len(space)] * robots
            + [len(space) + 1]
            + [int(both[:, k].max(initial=0)) + 1 for k in range(robots + 1, 2 * robots)]
        )
        nodes, place = unique_tuples(both, bounds)
        if layers:
            layers[-1].child = place[len(fresh) :]
        if number == 0:
            none = np.zeros(0, np.int64)
            layers.append(_layer(nodes, none, np.zeros((0, robots), np.int64)))
            break
        layer, arriving = _expand(space, index, word, leads, nodes)
        layers.append(layer)
    layers.reverse()
    return layers


def _expand(
    space: PlanSpace, index: EdgeIndex, word: Ints, leads: Leads, nodes: Ints
) -> tuple[_Layer, Ints]:
    """A layer with the moves out of its nodes, and the nodes that they lead to."""
    robots = space.robots
    failed = len(space)
    sources: list[Ints] = []
    edges: list[Ints] = []
    children: list[Ints] = []
    # A failed mixture has no edges: -1 as prefix finds none.
    y = nodes[:, robots]
    walking = np.column_stack((nodes[:, :robots], np.where(y == failed, FAILED, y)))
    for move in moves(space, index, walking):
        target = space.targets(move.edges)
        same_word = word[target] == word[nodes[move.source, :robots]]
        entered = np.where(same_word, NO_WORD, word[target])
        lead = nodes[move.source, robots + 1 :].copy()
        keep = np.ones(len(lead), np.bool_)
        for other in range(1, robots):
            lead[keep, other - 1] = leads.after(
                lead[keep, other - 1], entered[keep, 0], entered[keep, other]
            )
            keep &= lead[:, other - 1] != PARTED
        mixed = np.where(move.mixed == FAILED, failed, move.mixed)
        sources.append(move.source[keep])
        edges.append(move.edges[keep])
        children.append(np.column_stack((target[keep], mixed[keep], lead[keep])))
    none = np.zeros(0, np.int64)
    layer = _layer(
        nodes,
        np.concatenate(sources) if sources else none,
        np.concatenate(edges) if edges else np.zeros((0, robots), np.int64),
    )
    arriving = np.concatenate(children) if children else np.zeros((0, 2 * robots), np.int64)
    return layer, arriving
