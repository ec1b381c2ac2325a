# SPDX-License-Identifier: GPL-3.0-or-later
"""Tuples of plans that refute a candidate partition: many at a time, those that differ least first.

The same walk as verification makes, written for the builders: it keeps, for every node, the way to
a violation with the fewest steps at which the plans are in different states.  Such pairs give short
clauses.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from random import Random

import numpy as np

from coordlang.required.composition_walk import FAILED, moves
from coordlang.vocabulary.leads import NO_LEAD, NO_WORD, PARTED, Leads
from planners.search.edge_index import EdgeIndex
from planners.search.plan_space import PlanSpace
from planners.tables import Ints, unique_tuples

#: Where no way leads to a violation; some steps may be added to it.
_FAR = np.iinfo(np.int64).max // 4
#: Random ways to a violation that are taken from one start at most.
_RANDOM_WAYS = 40


@dataclass(frozen=True, slots=True)
class Counterexample:
    """A failing tuple of plans with one sentence, from a node that they share.

    Attributes
    ----------
    start
        The node of the plan space.
    edges
        Step by step, the edge of each plan.
    states
        The state numbers of each plan, that of ``start`` first.
    """

    start: int
    edges: tuple[tuple[int, ...], ...]
    states: tuple[tuple[int, ...], ...]


@dataclass(slots=True)
class _Layer:
    """Nodes of the walk with equally many steps to go.

    A node is ``(x_1 .. x_n, y or failed, leads)``, failed as the number of nodes of the plan space.
    Each move has the row of its node in ``source``, the plans' ``edges``, and in ``child`` the row
    of the node that it leads to, one layer below.  Each node has in ``best`` the fewest steps at
    which the plans are in different states on a way to a violation, in ``choice`` the move that
    begins it.
    """

    nodes: Ints
    source: Ints
    edges: Ints
    child: Ints
    best: Ints
    choice: Ints


def counterexamples(
    space: PlanSpace, index: EdgeIndex, word: Ints, most: int, starts: Ints | None = None
) -> Iterator[Counterexample]:
    """Failing tuples of plans with one sentence, those that differ least first.

    For each node that all plans and their mixture share, the rest of plans that begin alike: those
    that differ at the fewest steps, and then others.

    Parameters
    ----------
    space, index
        The plan space, and what finds its edges.
    word
        (nodes) the word of each node of the plan space.
    most
        About how many are wanted.  If there is none at all, ``word`` is a language for the tasks.
    starts
        The nodes where the tasks start, sorted; None: all of them.
    """
    layers = _forward(space, index, word, np.unique(space.starts) if starts is None else starts)
    _backward(space, layers)
    yield from _retrace(space, layers, most)


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
            layers.append(_Layer(nodes, none, np.zeros((0, robots), np.int64), none, none, none))
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
    layer = _Layer(
        nodes,
        np.concatenate(sources) if sources else none,
        np.concatenate(edges) if edges else np.zeros((0, robots), np.int64),
        none,
        none,
        none,
    )
    arriving = np.concatenate(children) if children else np.zeros((0, 2 * robots), np.int64)
    return layer, arriving


def _backward(space: PlanSpace, layers: list[_Layer]) -> None:
    """Set ``best`` and ``choice`` of each node, goals first."""
    robots = space.robots
    goal = layers[0]
    bad = (goal.nodes[:, robots] == len(space)) & (goal.nodes[:, robots + 1 :] == NO_LEAD).all(
        axis=1
    )
    goal.best = np.where(bad, 0, _FAR)
    for below, layer in pairwise(layers):
        x = layer.nodes[:, :robots]
        differs = (x[:, 1:] != x[:, :1]).sum(axis=1)
        value = below.best[layer.child] if len(layer.child) else np.zeros(0, np.int64)
        best = np.full(len(layer.nodes), _FAR)
        np.minimum.at(best, layer.source, value)
        choice = np.full(len(layer.nodes), -1)
        tight = np.flatnonzero((value == best[layer.source]) & (value < _FAR))
        choice[layer.source[tight][::-1]] = tight[::-1]
        layer.choice = choice
        layer.best = np.where(best < _FAR, best + differs, _FAR)


def _retrace(space: PlanSpace, layers: list[_Layer], most: int) -> Iterator[Counterexample]:
    """Ways from the nodes at which the plans and their mixture are one, and no sentence leads."""
    robots = space.robots
    starts: list[tuple[int, int, int]] = []
    for number, layer in enumerate(layers):
        x = layer.nodes[:, : robots + 1]
        diagonal = (x == x[:, :1]).all(axis=1) & (layer.nodes[:, robots + 1 :] == NO_LEAD).all(
            axis=1
        )
        hit = np.flatnonzero(diagonal & (layer.best < _FAR)) if number else np.zeros(0, np.int64)
        starts += [(int(layer.best[row]), number, int(row)) for row in hit]
    chosen = sorted(starts)[:most]
    for _, number, row in chosen:
        yield _follow(space, layers, number, row, None)
    if not chosen:
        return
    # Few starts: more ways to a violation from each, drawn at random (always the same ones).
    random = Random(0)
    for _ in range(min(_RANDOM_WAYS, most // len(chosen) - 1)):
        for _, number, row in chosen:
            yield _follow(space, layers, number, row, random)


def _follow(
    space: PlanSpace, layers: list[_Layer], number: int, row: int, random: Random | None
) -> Counterexample:
    """A way from a node to a violation: the best, or at each node any move that leads to one."""
    robots = space.robots
    start = int(layers[number].nodes[row, 0])
    edges = []
    for below, layer in zip(layers[number - 1 :: -1], layers[number:0:-1], strict=True):
        move = int(layer.choice[row])
        if random is not None:
            low, high = np.searchsorted(layer.source, (row, row + 1))
            open_moves = low + np.flatnonzero(below.best[layer.child[low:high]] < _FAR)
            move = int(open_moves[random.randrange(len(open_moves))])
        edges.append(tuple(layer.edges[move].tolist()))
        row = int(layer.child[move])
    states = tuple(
        tuple(space.state[space.nodes_on(start, [step[robot] for step in edges])].tolist())
        for robot in range(robots)
    )
    return Counterexample(start, tuple(edges), states)
