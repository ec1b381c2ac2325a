# SPDX-License-Identifier: GPL-3.0-or-later
"""Required coordination (RC) by composition walk: polynomial, never by listing plans.

Plans ``pi_1 .. pi_n``, one for each robot, introduce RC iff their *mixture* - robot i does its part
of ``pi_i``, step by step - is not an optimal plan (the paper, section 3; for two robots, iff one of
the two recombinations is not).  The walk goes through n plans in step and carries the state that
the mixture has reached: nodes ``(x_1 .. x_n, y)``.  An edge of it *fails* when the mixed joint
action is not an edge of the plan space in ``y``.  All starts and goals walk at once, layer by
layer, in numpy.  Proposition 2 of docs/concepts.md says why this decides RC.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from planners.errors import OutOfMemory, OutOfTime
from planners.limits import memory_left, reaching, time_left
from planners.search.edge_index import EdgeIndex
from planners.search.plan_space import PlanSpace
from planners.tables import Bools, Ints, spans, unique_tuples

#: What else may help.
INSTEAD = "fewer robots, smaller tasks or --cost makespan+actions"
#: Mixtures that failed have no state: this in place of ``y``.
FAILED = -1


@dataclass(frozen=True, slots=True)
class Moves:
    """Edges of a walk out of a table of nodes.

    ``source`` (k) numbers in the table, ``edges`` (k, robots) the plan-space edge that each plan
    takes, ``mixed`` (k) the plan-space node that the mixture reaches, `FAILED` where it breaks.
    """

    source: Ints
    edges: Ints
    mixed: Ints


@dataclass(frozen=True, slots=True)
class Divergences:
    """First differences of sets of plans that introduce RC.

    ``last`` (k): the last shared state; ``following`` (k, robots): the different next states,
    sorted, filled up with -1. States are numbers in the plan space's table.  With two robots a row
    is ``alpha* = {last, s1, s2}``.
    """

    last: Ints
    following: Ints

    def __len__(self) -> int:
        return len(self.last)


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


@dataclass(frozen=True, slots=True)
class WalkLimits:
    """How much of a walk is handled at a time, and how much is tried at all.

    Parameters
    ----------
    piece
        Walk edges handled at a time; it changes no result.
    most
        Walk edges out of one layer; more are hours of work.
    memory_left, time_left
        Bytes and seconds that are left, asked anew for every estimate.
    """

    piece: int = 1_000_000
    most: float = 1e10
    memory_left: Callable[[], float] = memory_left
    time_left: Callable[[], float] = time_left


_LIMITS = WalkLimits()


def walk(space: PlanSpace, limits: WalkLimits = _LIMITS) -> Walk:
    """Walk from every node ``p`` of the plan space with all plans and the mixture in ``p``.

    Where no plans are inseparable (`inseparable`), the divergences at ``p`` depend on ``p`` only,
    whatever was done before: the proof is in docs/concepts.md.

    Complexity: per goal at most (nodes of a layer)^(robots + 1) walk nodes, in grid-like domains
    about ^2; each has (optimal joint actions)^robots edges.  Raises `OutOfMemory` or `OutOfTime`
    with an estimate as soon as a part of a layer shows that the rest of it will not fit.
    """
    index = EdgeIndex.of(space)
    layers: list[_Layer] = []

    def so_far() -> str:
        return (
            f"{len(layers)} of {len(space.layers)} layers of the composition walk "
            f"over {len(space):,} states on optimal "
            f"plans, {sum(len(layer.nodes) for layer in layers):,} nodes"
        )

    with reaching(so_far, INSTEAD):
        _forward(space, index, layers, limits)
        return _backward(space, layers)


def moves(
    space: PlanSpace,
    index: EdgeIndex,
    nodes: Ints,
    *,
    together: bool = False,
    limits: WalkLimits = _LIMITS,
) -> Iterator[Moves]:
    """All moves of n plans and their mixture out of walk nodes ``(x_1 .. x_n, y)``, in chunks.

    With ``together`` only those in which all plans reach the same node.
    """
    robots = nodes.shape[1] - 1
    sizes = edges_out_of(space, nodes)
    if not together:
        _check_size(sizes, robots, limits)
    for span in spans(sizes, limits.piece):
        source = np.arange(span.start, span.stop)
        prefix = nodes[span, robots]
        edges: list[Ints] = []
        for robot in range(robots):
            which, edge = space.edges_from(nodes[source, robot])
            source, prefix = source[which], prefix[which]
            edges = [old[which] for old in edges]
            if together and robot:
                same = space.targets(edge) == space.targets(edges[0])
                source, prefix, edge = source[same], prefix[same], edge[same]
                edges = [old[same] for old in edges]
            edges.append(edge)
            prefix = index.follow(robot, prefix, space.robot_labels(robot, edge))
        mixed = (
            np.where(prefix >= 0, space.targets(np.maximum(prefix, 0)), FAILED)
            if len(prefix)
            else prefix
        )
        yield Moves(source, np.stack(edges, axis=1), mixed)


def edges_out_of(space: PlanSpace, nodes: Ints) -> NDArray[np.float64]:
    """How many edges of the walk leave each of its nodes.

    One for every choice of the plans' next steps.
    """
    degree = space.out_degrees.astype(np.float64)
    product: NDArray[np.float64] = np.prod(degree[nodes[:, :-1]], axis=1)
    return product


def _check_size(sizes: NDArray[np.float64], robots: int, limits: WalkLimits) -> None:
    """Stop before one node needs too much at once, or a layer too much work."""
    largest, total = sizes.max(initial=0), sizes.sum()
    # One row of a chunk holds its source, a prefix and an edge for each robot, and copies of them.
    if 100 * largest > limits.memory_left():
        raise OutOfMemory(
            f"a state has {largest:,.0f} combinations of {robots} plans' next steps: about "
            f"{100 * largest / 2**30:,.1f} GiB at once",
            remedy=f"Use {INSTEAD}, or a larger --memory-limit.",
        )
    if total > limits.most:
        raise OutOfMemory(
            f"the {len(sizes):,} nodes of one layer of the walk have {total:.1e} combinations "
            f"of {robots} plans' next steps",
            remedy=f"Use {INSTEAD}.",
        )


def _forward(space: PlanSpace, index: EdgeIndex, layers: list[_Layer], limits: WalkLimits) -> None:
    """Walk down from the highest layer into ``layers``.

    Every plan-space node starts at its own layer.
    """
    columns = space.robots + 1
    spans = space.layers
    arriving = np.zeros((0, columns), np.int64)
    held = 0
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
        layer, arriving = _expand(space, index, table, spans[number - 1], held, limits)
        held += layer.nodes.nbytes + layer.links.nbytes + layer.parting.nbytes
        layers.append(layer)


def _expand(
    space: PlanSpace,
    index: EdgeIndex,
    table: Ints,
    below: slice,
    held: int,
    limits: WalkLimits,
) -> tuple[_Layer, Ints]:
    """One layer's moves.  A node that fails at once needs no children, unless it is diagonal."""
    columns = table.shape[1]
    bounds = [below.stop - below.start] * columns
    diagonal = (table[:, 1:] == table[:, :1]).all(axis=1)
    fails = np.zeros(len(table), np.bool_)
    children: list[Ints] = [np.zeros((0, columns), np.int64)]
    links: list[Ints] = [np.zeros((0, 2), np.int64)]
    parting: list[Ints] = [np.zeros((0, columns + 1), np.int64)]
    count = 0
    ends = np.cumsum(edges_out_of(space, table))
    begin = perf_counter()
    for move in moves(space, index, table, limits=limits):
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
        if len(move.source):
            done = int(move.source[-1])
            _check_rest(
                held,
                (*links, *children, *parting),
                ends[done] / ends[-1],
                ends,
                perf_counter() - begin,
                limits,
            )
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


def _check_rest(
    held: int,
    parts: Sequence[Ints],
    progress: float,
    ends: NDArray[np.float64],
    seconds: float,
    limits: WalkLimits,
) -> None:
    """Stop when the part of a layer that is done shows that the rest of it does not fit.

    Memory and time are linear in it.

    ``ends``: walk edges out of the layer's first nodes, summed up; ``seconds`` were spent on the
    part that is done.
    """
    used = sum(part.nbytes for part in parts)
    size = f"{len(ends):,} nodes and {ends[-1]:,.0f} edges ({100 * progress:.2g} % of it done)"
    # What the sorting at the end needs for a moment is about twice what is kept.
    more = 3 * used / progress - used
    if more > limits.memory_left():
        raise OutOfMemory(
            f"the composition walk needs about {more / 2**30:.1f} GiB more to pass one layer "
            f"of {size}; it holds "
            f"{(held + used) / 2**30:.1f} GiB, and {limits.memory_left() / 2**30:.1f} GiB are left",
            remedy=f"Use {INSTEAD}, or a larger --memory-limit.",
        )
    left = seconds / progress - seconds
    if left > 2 * limits.time_left():
        raise OutOfTime(
            f"the composition walk needs about {left:.0f} s more to pass one layer "
            f"of {size}; {limits.time_left():.0f} s are left",
            remedy=f"Use {INSTEAD}, or a larger --time-limit.",
        )
