"""A robot's subplans as the smallest deterministic automaton over its own subactions.

The robot's subplans are what the plans of a plan space are when only its own subactions are seen.
All of them have one length, so the automaton has no cycles and its states lie in layers, one a
step.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import reduce
from itertools import pairwise
from math import log10
from operator import and_, or_

import numpy as np

from planners.errors import OutOfMemory
from planners.limits import memory_left
from planners.search.plan_space import PlanSpace
from planners.tables import Ints, unique_tuples

#: What the robot knows in a state: (atoms certainly true, atoms possibly true), as sets of bits:
#: fact k is bit k.
Knowledge = tuple[int, int]

#: Bytes that one member of a subset takes, with its share of everything else.
_MEMBER_BYTES = 160
#: Bytes for which the system is not asked whether there is room.
_SMALL = 1 << 24


@dataclass(frozen=True, slots=True)
class Automaton:
    """A deterministic automaton over one robot's label numbers (0: idle).

    State 0 is where it starts.

    ``layers[k]`` are the states after k steps (joint steps done by all); those of the last layer
    are final.  The moves of state s are ``label[first[s]:first[s + 1]]`` to ``target[..]``, sorted
    by label.  ``left[s]`` is the exact number of subplans from s on; every state has some.
    ``known[s]`` is what the robot knows there; all empty where nothing was asked.
    """

    layers: tuple[range, ...]
    first: Ints
    label: Ints
    target: Ints
    left: tuple[int, ...]
    known: tuple[Knowledge, ...]

    def __len__(self) -> int:
        return len(self.left)

    @property
    def count(self) -> int:
        """How many subplans it accepts."""
        return self.left[0]

    def moves(self, state: int) -> list[tuple[int, int]]:
        """The pairs (label, next state) of a state, sorted."""
        span = slice(int(self.first[state]), int(self.first[state + 1]))
        return list(zip(self.label[span].tolist(), self.target[span].tolist(), strict=True))

    def step_of(self, state: int) -> int:
        """How many steps are done in a state."""
        return next(step for step, states in enumerate(self.layers) if state in states)


def determinise(
    space: PlanSpace, robot: int, truth: Mapping[int, int] | None = None, most: int | None = None
) -> Automaton:
    """The least automaton of robot number ``robot`` over the (one task's) plans of a plan space.

    Without ``truth`` it is the minimal deterministic automaton that accepts exactly the robot's
    subplans.  With ``truth`` (number of a state in ``space.rows`` -> its true facts as bits) it
    also says in each state what is known there: the facts that have one value in all joint states
    that plans with the same own beginning can be in.  Then it is the least automaton that accepts
    the subplans and says this (a Moore machine: states are merged that agree on the knowledge, now
    and after every continuation).

    Three passes over the layers: nodes that nothing tells apart are one (upwards), subset
    construction (downwards), equal futures are one (upwards).  Linear but for the subsets, of which
    there may be exponentially many: raises `OutOfMemory` with an estimate before they fill the
    memory, or when they have more than ``most`` members in all.
    """
    layers, start = _quotient(space, robot, truth)
    moves: list[list[dict[int, int]]] = []
    outputs: list[list[Knowledge]] = []
    subsets: list[tuple[int, ...]] = [(start,)]
    members = 0
    for depth, layer in enumerate(reversed(layers)):
        outputs.append([_knowledge(layer, subset) for subset in subsets])
        following: dict[tuple[int, ...], int] = {}
        here: list[dict[int, int]] = []
        for subset in subsets:
            here.append(
                {
                    own: following.setdefault(to, len(following))
                    for own, to in _after(layer, subset).items()
                }
            )
            members += len(subset)
            if len(here) % 1024 == 0:
                _check(space, robot, members, most, depth, len(layers) - 1)
        moves.append(here)
        subsets = list(following)
        _check(space, robot, members, most, depth, len(layers) - 1)
    return minimised(moves, outputs)


def minimised(
    moves: Sequence[Sequence[Mapping[int, int]]], known: Sequence[Sequence[Knowledge]]
) -> Automaton:
    """The least automaton of a deterministic one given in layers.

    States are merged that agree on everything to come.

    ``moves[k][s]`` leads from state s of layer k by a label to a state of layer k + 1; layer 0 has
    one state.
    """
    classes: list[list[int]] = []
    merged: list[list[tuple[Knowledge, tuple[tuple[int, int], ...]]]] = []
    for here, output in zip(reversed(moves), reversed(known), strict=True):
        below = classes[-1] if classes else []
        number: dict[tuple[Knowledge, tuple[tuple[int, int], ...]], int] = {}
        classes.append(
            [
                number.setdefault(
                    (said, tuple(sorted((own, below[to]) for own, to in move.items()))), len(number)
                )
                for said, move in zip(output, here, strict=True)
            ]
        )
        merged.append(list(number))
    merged.reverse()
    return _numbered(merged)


def _numbered(
    merged: Sequence[Sequence[tuple[Knowledge, tuple[tuple[int, int], ...]]]],
) -> Automaton:
    """States in the order in which a walk by layers and labels meets them.

    The same automaton has the same numbers.
    """
    order = [0]
    bounds, first, label, target, known = [0], [0], [], [], []
    for layer in merged:
        start = bounds[-1]
        bounds.append(start + len(order))
        found: dict[int, int] = {}
        for state in order:
            said, moves = layer[state]
            known.append(said)
            for own, to in moves:
                label.append(own)
                target.append(bounds[-1] + found.setdefault(to, len(found)))
            first.append(len(label))
        order = list(found)
    left = [1] * len(known)
    for state in range(bounds[-2] - 1, -1, -1):
        left[state] = sum(left[to] for to in target[first[state] : first[state + 1]])
    return Automaton(
        layers=tuple(range(a, b) for a, b in pairwise(bounds)),
        first=np.array(first, np.int64),
        label=np.array(label, np.int64),
        target=np.array(target, np.int64),
        left=tuple(left),
        known=tuple(known),
    )


@dataclass(frozen=True, slots=True)
class _Layer:
    """Classes of the nodes of one layer: their moves, label -> classes; their true facts."""

    moves: list[dict[int, tuple[int, ...]]]
    truth: list[int]


def _quotient(
    space: PlanSpace, robot: int, truth: Mapping[int, int] | None
) -> tuple[list[_Layer], int]:
    """The layers in classes, the goal's first, and the class of the start.

    Nodes are one class if they agree on ``truth`` and lead by the same own labels to the same
    classes.

    Merging them changes no set of own continuations (a bisimulation), and makes subsets small.
    """
    layers: list[_Layer] = []
    place = np.zeros(len(space), np.int64)  # node -> class in its layer
    for span in space.layers:
        low, high = int(space.first[span.start]), int(space.first[span.stop])
        degrees = np.diff(space.first[span.start : span.stop + 1])
        source = np.repeat(np.arange(span.stop - span.start), degrees)
        table = np.column_stack(
            (source, space.labels[low:high, robot], place[space.target[low:high]])
        )
        bounds = [int(column.max(initial=0)) + 1 for column in table.T]
        table, _ = unique_tuples(table.astype(np.int64), bounds)
        ends = np.searchsorted(table[:, 0], np.arange(span.stop - span.start + 1)).tolist()
        pairs = np.ascontiguousarray(table[:, 1:])
        classes: dict[tuple[int, bytes], int] = {}
        number, moves, facts = [], [], []
        states = space.state[span].tolist()
        for node, (a, b) in enumerate(pairwise(ends)):
            fact = truth[states[node]] if truth is not None else 0
            key = (fact, pairs[a:b].tobytes())
            if key not in classes:
                classes[key] = len(classes)
                moves.append(_grouped(pairs[a:b].tolist()))
                facts.append(fact)
            number.append(classes[key])
        place[span] = number
        layers.append(_Layer(moves, facts))
    return layers, int(place[space.starts[0]])


def _grouped(pairs: list[list[int]]) -> dict[int, tuple[int, ...]]:
    """Sorted pairs (label, class) as label -> sorted classes."""
    found: dict[int, list[int]] = {}
    for own, to in pairs:
        found.setdefault(own, []).append(to)
    return {own: tuple(classes) for own, classes in found.items()}


def _after(layer: _Layer, subset: tuple[int, ...]) -> dict[int, tuple[int, ...]]:
    """Where a subset of classes leads by each label."""
    if len(subset) == 1:
        return layer.moves[subset[0]]
    found: dict[int, set[int]] = {}
    for member in subset:
        for own, classes in layer.moves[member].items():
            found.setdefault(own, set()).update(classes)
    return {own: tuple(sorted(classes)) for own, classes in sorted(found.items())}


def _knowledge(layer: _Layer, subset: tuple[int, ...]) -> Knowledge:
    truth = {layer.truth[member] for member in subset}
    return reduce(and_, truth), reduce(or_, truth)


def _check(
    space: PlanSpace, robot: int, members: int, most: int | None, depth: int, steps: int
) -> None:
    size = members * _MEMBER_BYTES
    if (most is None or members <= most) and (size < _SMALL or size < memory_left()):
        return
    # The rest at the rate at which they grew so far.
    growth = log10(max(members, 1)) / max(depth, 1)
    estimate = 10 ** min(18.0, log10(size / 2**30) + growth * max(steps - depth, 0))
    raise OutOfMemory(
        f"the choices of {space.model.robots[robot]} have too many different histories: after {depth + 1} of {steps} "
        f"steps their subsets have {members:,} members, at this rate about {estimate:,.1f} GiB in the end",
        remedy="Use --cost makespan+actions, another sentence or a smaller task, or a larger --memory-limit.",
    )
