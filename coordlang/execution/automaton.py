# SPDX-License-Identifier: GPL-3.0-or-later
"""A robot's subplans as the smallest deterministic automaton over its own subactions.

The robot's subplans are what the plans of a plan space are when only its own subactions are seen.
All of them have one length, so the automaton has no cycles and its states lie in layers, one a
step.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import reduce
from math import log10
from operator import and_, or_
from typing import NamedTuple

from planners.search.plan_space import PlanSpace
from planners.system.errors import OutOfMemory
from planners.system.limits import memory_left, more_memory

#: Bytes that one member of a subset takes, with its share of everything else.
_MEMBER_BYTES = 160
#: Up to so many bytes the free memory is not looked up.
_SMALL = 1 << 24


class Knowledge(NamedTuple):
    """What a robot knows in a state, whatever the others do.

    ``true`` are the facts that are certainly true, ``possible`` those that are possibly true, as
    sets of bits: fact k is bit k.
    """

    true: int
    possible: int

    @property
    def unknown(self) -> int:
        """The facts that may be true or false."""
        return self.possible & ~self.true


@dataclass(frozen=True, slots=True)
class Automaton:
    """A deterministic automaton over one robot's label numbers (0: idle); state 0 is its start.

    ``layers[k]`` are the states after k joint steps, those of the last one are final.  For each
    state ``moves`` has label -> next state, sorted, ``left`` the exact number of subplans from it
    on, at least 1, and ``known`` what the robot knows there, all empty where no knowledge was
    computed.
    """

    layers: tuple[range, ...]
    moves: tuple[Mapping[int, int], ...]
    left: tuple[int, ...]
    known: tuple[Knowledge, ...]

    def __len__(self) -> int:
        """Count the states."""
        return len(self.left)

    @property
    def count(self) -> int:
        """The number of subplans that it accepts."""
        return self.left[0]

    @property
    def steps(self) -> int:
        """The length of its subplans in joint steps."""
        return len(self.layers) - 1

    @property
    def labels(self) -> set[int]:
        """The labels that its subplans have."""
        return set[int]().union(*self.moves)


def determinise(
    space: PlanSpace, robot: int, truth: Sequence[int] | None = None, most: int | None = None
) -> Automaton:
    """The least automaton of a robot's subplans over the plans of a plan space of one task.

    Without ``truth`` it is the minimal deterministic automaton that accepts exactly these.  With
    ``truth``, the true facts of each node as bits, it also gives for each state what is known
    there: the facts that have one value in all nodes that plans with the same own beginning can be
    in.  It is then the least automaton with this output (a Moore machine: states are merged that
    agree on the knowledge, now and after every continuation).

    Three passes over the layers: nodes that behave alike are one (upwards), subset construction
    (downwards), equal futures are one (upwards).  Linear but for the subsets, of which there may be
    exponentially many: raises `OutOfMemory`, with an estimate, before they fill the memory or have
    more than ``most`` members.
    """
    nodes = (_nodes(space, robot, truth, number) for number in range(len(space.layers)))
    layers, top = _merged(nodes)  # merging nodes changes no set of own continuations
    states: list[list[_State]] = []
    subsets: list[Classes] = [(top[int(space.starts[0]) - space.layers[-1].start],)]
    members = 0
    for depth, layer in enumerate(reversed(layers)):
        following: dict[Classes, int] = {}
        here: list[_State] = []
        for subset in subsets:
            known = [layer[member][0] for member in subset]
            knowledge = Knowledge(
                reduce(and_, (one.true for one in known)),
                reduce(or_, (one.possible for one in known)),
            )
            after = _after(layer, subset).items()
            moves = {own: (following.setdefault(to, len(following)),) for own, to in after}
            here.append((knowledge, moves))
            members += len(subset)
            if len(here) % 1024 == 0:
                _check(space, robot, members, most, depth, len(layers) - 1)
        states.append(here)
        subsets = list(following)
        _check(space, robot, members, most, depth, len(layers) - 1)
    return _numbered(_merged(reversed(states))[0][::-1])


#: Numbers of states of a layer, sorted.
Classes = tuple[int, ...]
#: What is known in a state, and the states of the next layer to which each label leads.
_State = tuple[Knowledge, Mapping[int, Sequence[int]]]
#: The same of states that are merged; labels are sorted.
_Class = tuple[Knowledge, dict[int, Classes]]


def _merged(layers: Iterable[Sequence[_State]]) -> tuple[list[list[_Class]], list[int]]:
    """Make one of the states that know the same and lead by the same labels to the same states.

    Layers come with the last one first.  Returns them in this order, and the number of the class of
    each state of the one that came last.
    """
    merged: list[list[_Class]] = []
    class_of: list[int] = []
    for layer in layers:
        number: dict[tuple[Knowledge, tuple[tuple[int, Classes], ...]], int] = {}
        here = []
        for known, moves in layer:
            after = [(own, {class_of[to] for to in targets}) for own, targets in moves.items()]
            key = known, tuple((own, tuple(sorted(to))) for own, to in sorted(after))
            here.append(number.setdefault(key, len(number)))
        class_of = here
        merged.append([(known, dict(moves)) for known, moves in number])
    return merged, class_of


def _nodes(space: PlanSpace, robot: int, truth: Sequence[int] | None, number: int) -> list[_State]:
    """The nodes of a layer of a plan space, with the robot's own labels."""
    span, edges = space.layers[number], space.layer_edges(number)
    below = space.layers[number - 1].start if number else 0
    moves: list[dict[int, list[int]]] = [{} for _ in range(span.stop - span.start)]
    source, target = (edges.source - span.start).tolist(), (edges.target - below).tolist()
    labels = space.robot_labels(robot, edges.edges).tolist()
    for node, label, to in zip(source, labels, target, strict=True):
        moves[node].setdefault(label, []).append(to)
    true = [0] * len(moves) if truth is None else truth[span.start : span.stop]
    return [(Knowledge(own, own), move) for own, move in zip(true, moves, strict=True)]


def _numbered(merged: Sequence[Sequence[_Class]]) -> Automaton:
    """Number the states in the order in which a walk by layers and labels meets them."""
    layers: list[range] = []
    found, end = {0: 0}, 1
    numbered: list[Mapping[int, int]] = []
    known: list[Knowledge] = []
    for layer in merged:
        layers.append(range(len(numbered), end))
        here, found = found, {}
        for state in here:
            knowledge, moves = layer[state]
            known.append(knowledge)
            to = (found.setdefault(after, end + len(found)) for (after,) in moves.values())
            numbered.append(dict(zip(moves, to, strict=True)))
        end += len(found)
    left = [1] * len(known)
    for state in reversed(range(layers[-1].start)):
        left[state] = sum(left[to] for to in numbered[state].values())
    return Automaton(tuple(layers), tuple(numbered), tuple(left), tuple(known))


def _after(layer: Sequence[_Class], subset: Classes) -> dict[int, Classes]:
    """Where a subset of classes leads by each label."""
    if len(subset) == 1:
        return layer[subset[0]][1]
    found: dict[int, set[int]] = {}
    for member in subset:
        for own, classes in layer[member][1].items():
            found.setdefault(own, set()).update(classes)
    return {own: tuple(sorted(classes)) for own, classes in sorted(found.items())}


def _check(
    space: PlanSpace, robot: int, members: int, most: int | None, depth: int, steps: int
) -> None:
    size = members * _MEMBER_BYTES
    if (most is None or members <= most) and (size < _SMALL or size < memory_left()):
        return
    # The rest at the rate at which they grew so far.
    growth = log10(max(members, 1)) / max(depth, 1)
    estimate = 10 ** min(18.0, log10(size / 2**30) + growth * max(steps - depth, 0))
    smaller = space.model.smaller("another sentence", "a smaller task")
    raise OutOfMemory(
        f"the choices of {space.model.robots[robot]} have too many different histories: "
        f"after {depth + 1} of {steps} "
        f"steps their subsets have {members:,} members, at this rate about {estimate:,.1f} GiB in "
        "the end",
        remedy=f"Use {smaller}, or {more_memory()}.",
    )
