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
from planners.search.edge_index import EdgeIndex
from planners.search.plan_space import PlanSpace
from planners.tables import Ints, unique_tuples

_FAR = np.iinfo(np.int64).max // 4
#: Random ways to a violation that are taken from one start at most.
_AGAIN = 40


@dataclass(frozen=True, slots=True)
class Counterexample:
    """A failing tuple of plans with one sentence.

    Plan-space edges, step by step, and the states of each plan.
    """

    start: int
    edges: tuple[tuple[int, ...], ...]
    states: tuple[tuple[int, ...], ...]


class _Leads:
    """Words by which one plan's sentence is ahead of another's, as numbers; 0 is none."""

    def __init__(self) -> None:
        self._leads: list[tuple[int, tuple[int, ...]]] = [(0, ())]
        self._number = {self._leads[0]: 0}
        self._after: dict[tuple[int, int, int], int] = {}

    def after(self, lead: Ints, first: Ints, other: Ints) -> Ints:
        """The leads when plan 1 said ``first`` and the other one ``other`` (-1: nothing).

        -1 where they part.
        """
        if not len(lead):
            return lead
        table = np.column_stack((lead, first + 1, other + 1))
        bounds = [int(table[:, k].max()) + 1 for k in range(3)]
        different, inverse = unique_tuples(table, bounds)
        numbers = [self._one(a, b - 1, c - 1) for a, b, c in different.tolist()]
        return np.array(numbers, np.int64)[inverse]

    def _one(self, lead: int, first: int, other: int) -> int:
        key = (lead, first, other)
        if key not in self._after:
            side, words = self._leads[lead]
            mine = (words if side == 1 else ()) + ((first,) if first >= 0 else ())
            theirs = (words if side == 2 else ()) + ((other,) if other >= 0 else ())
            shared = min(len(mine), len(theirs))
            if mine[:shared] != theirs[:shared]:
                self._after[key] = -1
            else:
                rest = (1, mine[shared:]) if len(mine) > shared else (2, theirs[shared:])
                if not rest[1]:
                    rest = (0, ())
                if rest not in self._number:
                    self._number[rest] = len(self._leads)
                    self._leads.append(rest)
                self._after[key] = self._number[rest]
        return self._after[key]


@dataclass(slots=True)
class _Layer:
    nodes: Ints
    source: Ints
    edges: Ints
    child: Ints
    best: Ints
    choice: Ints


def counterexamples(
    space: PlanSpace, index: EdgeIndex, word: Ints, most: int, starts: Ints | None = None
) -> Iterator[Counterexample]:
    """About ``most`` failing tuples of plans with one sentence under ``word``.

    ``word`` has the word of each plan-space node.

    For each node that all plans and their mixture share, the rest of plans that begin alike: those
    that differ at the fewest steps, and then others.  None at all: ``word`` is a language for these
    tasks.
    """
    layers = _forward(space, index, word, np.unique(space.starts) if starts is None else starts)
    _backward(space, layers)
    yield from _retrace(space, layers, most)


def _forward(space: PlanSpace, index: EdgeIndex, word: Ints, starts: Ints) -> list[_Layer]:
    """``layers[k]`` has k joint steps to go.

    A node is (x_1 .. x_n, y or failed, leads), failed as ``len(space)``.
    """
    robots = space.robots
    leads = _Leads()
    spans = space.layers
    layers: list[_Layer] = []
    arriving = np.zeros((0, 2 * robots), np.int64)
    for number in range(len(spans) - 1, -1, -1):
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
    space: PlanSpace, index: EdgeIndex, word: Ints, leads: _Leads, nodes: Ints
) -> tuple[_Layer, Ints]:
    robots = space.robots
    failed = len(space)
    sources: list[Ints] = []
    edges: list[Ints] = []
    children: list[Ints] = []
    # A failed mixture has no edges: -1 as prefix finds none.
    y = nodes[:, robots]
    walking = np.column_stack((nodes[:, :robots], np.where(y == failed, FAILED, y)))
    for move in moves(space, index, walking):
        target = space.target[move.edges]
        said = np.where(word[target] != word[nodes[move.source, :robots]], word[target], -1)
        lead = nodes[move.source, robots + 1 :].copy()
        keep = np.ones(len(lead), np.bool_)
        for other in range(1, robots):
            lead[keep, other - 1] = leads.after(
                lead[keep, other - 1], said[keep, 0], said[keep, other]
            )
            keep &= lead[:, other - 1] >= 0
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
    """For each node the fewest differing steps on a way to a violation.

    With the move that begins it.
    """
    robots = space.robots
    goal = layers[0]
    bad = (goal.nodes[:, robots] == len(space)) & (goal.nodes[:, robots + 1 :] == 0).all(axis=1)
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
    robots = space.robots
    starts: list[tuple[int, int, int]] = []
    for number, layer in enumerate(layers):
        x = layer.nodes[:, : robots + 1]
        diagonal = (x == x[:, :1]).all(axis=1) & (layer.nodes[:, robots + 1 :] == 0).all(axis=1)
        hit = np.flatnonzero(diagonal & (layer.best < _FAR)) if number else np.zeros(0, np.int64)
        starts += [(int(layer.best[row]), number, int(row)) for row in hit]
    chosen = sorted(starts)[:most]
    for _, number, row in chosen:
        yield _follow(space, layers, number, row, None)
    if not chosen:
        return
    # Few starts: more ways to a violation from each, drawn at random (always the same ones).
    random = Random(0)
    for _ in range(min(_AGAIN, most // len(chosen) - 1)):
        for _, number, row in chosen:
            yield _follow(space, layers, number, row, random)


def _follow(
    space: PlanSpace, layers: list[_Layer], number: int, row: int, random: Random | None
) -> Counterexample:
    """One way from a node to a violation.

    The best one, or at each node any move that still leads to one.
    """
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
        (int(space.state[start]), *(int(space.state[space.target[step[i]]]) for step in edges))
        for i in range(robots)
    )
    return Counterexample(start, tuple(edges), states)
