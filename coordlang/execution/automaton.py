# SPDX-License-Identifier: GPL-3.0-or-later
"""A robot's subplans as an automaton over its own subactions, and all combinations of robots'.

The robot's subplans are what the plans of a plan space are when only its own subactions are seen.
All of them have one length, so the automaton has no cycles and its states lie in layers, one a
step.  Where robots keep no common step it is one an event of the robot, and who has no more idles.

That all combinations are optimal plans is proved directly, from the definition, for one task and
one sentence: `walk_mixtures` walks nodes ``(a_1 .. a_n, y)``, the state of each robot's automaton
and the plan-space node that all of them together have reached.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import reduce
from itertools import accumulate, chain
from operator import and_, or_
from typing import Literal, NamedTuple

import numpy as np

from coordlang.execution.task_language import TaskLanguage
from coordlang.required.miscoordination import Miscoordination, Trail, describe_failure
from planners.joint.conditions import Labels
from planners.joint.tables import Ints, ranges, unique_rows
from planners.search.edge_index import EdgeIndex
from planners.search.plan_space import PlanSpace
from planners.system.errors import OutOfMemory
from planners.system.limits import reaching


class Knowledge(NamedTuple):
    """What a robot knows in a state, whatever the others do.

    ``true`` are the facts that are certainly true, ``unknown`` those that may be true or false, as
    sets of bits: fact k is bit k.
    """

    true: int
    unknown: int


#: How what is known in an automaton's states was found: over every combination of all robots'
#: choices, or from the robot's own subactions alone.
Atoms = Literal["exact", "own"]


@dataclass(frozen=True, slots=True)
class Automaton:
    """A deterministic automaton over one robot's label numbers (0: idle); state 0 is its start.

    ``layers[k]`` are the states after k steps or events, those of the last one are final.  For each
    state ``moves`` has label -> next state, sorted, ``left`` the exact number of subplans from it
    on, at least 1, and ``known`` what the robot knows there, all empty where no knowledge was
    computed; ``atoms`` says how it was.
    """

    robot: int
    layers: tuple[range, ...]
    moves: tuple[Mapping[int, int], ...]
    left: tuple[int, ...]
    known: tuple[Knowledge, ...]
    atoms: Atoms = "exact"

    def __len__(self) -> int:
        """Count the states."""
        return len(self.left)

    @property
    def count(self) -> int:
        """The number of subplans that it accepts."""
        return self.left[0]

    @property
    def steps(self) -> int:
        """The length of its subplans in joint steps, or events."""
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
    exponentially many: raises `OutOfMemory` where they fill the memory or have more than ``most``
    members.
    """
    layers: list[_Layer] = []

    def so_far() -> str:
        sets = f"{sum(map(len, layers)):,} different histories of {space.model.robots[robot]}"
        return f"{sets}, in {len(layers)} of {space.cost_of(0)[0] + 1} layers"

    number_of: dict[_Nodes, int] = {}
    merged: list[list[_State]] = []
    with reaching(so_far, space.model.smaller("another sentence", "a smaller task")):
        layers.extend(_subsets(space, robot, truth, most))
        for layer in reversed(layers):
            numbers: dict[_State, int] = {}
            for subset, (known, moves) in layer.items():
                state = known, tuple((own, number_of[nodes]) for own, nodes in moves.items())
                number_of[subset] = numbers.setdefault(state, len(numbers))
            merged.append(list(numbers))
    return _numbered(robot, merged[::-1])


#: Numbers of nodes of a layer of the plan space, sorted.
_Nodes = tuple[int, ...]
#: What is known in a state, and the number in the next layer of the state to which a label leads.
_State = tuple[Knowledge, tuple[tuple[int, int], ...]]
#: Where own beginnings of one length lead, with what is known there, and where labels lead.
_Layer = dict[_Nodes, tuple[Knowledge, dict[int, _Nodes]]]


def _subsets(
    space: PlanSpace, robot: int, truth: Sequence[int] | None, most: int | None
) -> Iterator[_Layer]:
    """The layers, the start first."""
    true = [0] * len(space) if truth is None else truth
    labels, targets = space.robot_labels(robot).tolist(), space.targets().tolist()
    alike = _alike(space, true, labels, targets)  # no set of own continuations is another one then
    subsets: dict[_Nodes, None] = {(alike[int(space.starts[0])],): None}
    members = 0
    while subsets:
        layer: _Layer = {}
        for subset in subsets:
            after: dict[int, set[int]] = defaultdict(set)
            for edge in chain.from_iterable(map(space.out_edges, subset)):
                after[labels[edge]].add(alike[targets[edge]])
            facts = [true[node] for node in subset]
            certain = reduce(and_, facts)
            moves = {own: tuple(sorted(nodes)) for own, nodes in sorted(after.items())}
            layer[subset] = Knowledge(certain, reduce(or_, facts) & ~certain), moves
            members += len(subset)
            if most is not None and members > most:
                what = f"a robot's histories have more than {most:,} members"
                raise OutOfMemory(what, remedy="Use another sentence, or a smaller task.")
        yield layer
        every = (moves.values() for _, moves in layer.values())
        subsets = dict.fromkeys(chain.from_iterable(every))


def _alike(
    space: PlanSpace, true: Sequence[int], labels: Sequence[int], targets: Sequence[int]
) -> list[int]:
    """For each node the first that knows the same, with the same labels to such nodes."""
    first: dict[object, int] = {}
    alike: list[int] = []
    for node, layer in enumerate(space.layer.tolist()):
        moves = frozenset((labels[edge], alike[targets[edge]]) for edge in space.out_edges(node))
        alike.append(first.setdefault((layer, true[node], moves), node))
    return alike


def _numbered(robot: int, merged: Sequence[Sequence[_State]]) -> Automaton:
    """Number the states layer by layer, where a walk by labels has met them in their order."""
    ends = [*accumulate(map(len, merged))]
    layers = tuple(range(end - len(own), end) for own, end in zip(merged, ends, strict=True))
    states = [(end, *state) for own, end in zip(merged, ends, strict=True) for state in own]
    moves = tuple({label: end + to for label, to in after} for end, _, after in states)
    left = [1] * len(states)
    for state in reversed(range(layers[-1].start)):
        left[state] = sum(left[to] for to in moves[state].values())
    return Automaton(robot, layers, moves, tuple(left), tuple(known for _, known, _ in states))


# ---- every combination of the robots' choices


def walk_mixtures(
    task_language: TaskLanguage,
    fits: PlanSpace,
    automata: Sequence[Automaton],
    words: Sequence[int],
    most: int,
) -> tuple[PlanSpace | None, Miscoordination | None, int | None]:
    """Walk all combinations of the robots' subplans in the task's optimal plans, layer by layer.

    Returns all of them as a plan space of one task, or else one that is no optimal plan; and how
    many nodes were walked, None, before they are made, where there are more than ``most`` joint
    moves.  At most (product of the automata's layers) * (layer of the plan space) nodes.
    ``automata`` are the robots' subplans in ``fits``, the plans with the sentence ``words``.
    """
    space = task_language.space
    index = EdgeIndex.of(space)
    robots, moves = len(automata), [_Moves(own) for own in automata]
    table = np.array([[0] * robots + [task_language.start]])
    layers = [table[:, robots]]
    steps: list[tuple[Ints, Ints, Ints]] = []
    walked, made = 1, 0.0
    for _ in range(automata[0].steps):
        degrees = [own.degree[at] for own, at in zip(moves, table.T, strict=False)]
        made += np.prod(degrees, axis=0, dtype=float).sum()
        if made > most:
            return None, None, None
        source, labels, after = _together(moves, table)
        edge = table[source, robots]
        for robot in range(robots):
            edge = index.follow(robot, edge, labels[:, robot])
        broken = np.flatnonzero(edge < 0)
        if len(broken):
            last = int(source[broken[0]]), tuple(labels[broken[0]].tolist())
            return None, _witness(task_language, fits, words, steps, *last), walked
        table, number = unique_rows(np.column_stack((after, space.targets(edge))))
        steps.append((source, edge, number))
        layers.append(table[:, robots])
        walked += len(table)
    return space.unfolded(layers, steps, task_language.task), None, walked


class _Moves:
    """An automaton's moves, (label, next state): for each state their number and the first one."""

    def __init__(self, automaton: Automaton) -> None:
        self.degree = np.array([len(own) for own in automaton.moves], np.int64)
        self.first = np.cumsum(self.degree) - self.degree
        pairs = [pair for own in automaton.moves for pair in own.items()]
        self.pairs = np.array(pairs, np.int64).reshape(-1, 2)


def _together(moves: Sequence[_Moves], table: Ints) -> tuple[Ints, Labels, Ints]:
    """All joint moves, sorted by source and labels: (source, labels, next automaton states)."""
    found = np.arange(len(table))[:, None]  # the source, then for each robot label and next state
    for robot, own in enumerate(moves):
        state = table[found[:, 0], robot]
        edges = ranges(own.first[state], own.degree[state])
        found = np.hstack((np.repeat(found, own.degree[state], axis=0), own.pairs[edges]))
    return found[:, 0], found[:, 1::2].astype(np.int32), found[:, 2::2]


def _witness(
    task_language: TaskLanguage,
    fits: PlanSpace,
    words: Sequence[int],
    steps: Sequence[tuple[Ints, Ints, Ints]],
    node: int,
    labels: tuple[int, ...],
) -> Miscoordination:
    """Plans with the sentence whose mixture breaks at a node of the last layer, by these labels."""
    space, start, done, paths = task_language.space, task_language.start, [labels], []
    for source, edge, target in reversed(steps):
        arrival = int(np.flatnonzero(target == node)[0])
        done.append(space.labels_of(int(edge[arrival])))
        node = int(source[arrival])
    for robot in range(len(labels)):
        own = [[step[robot]] for step in reversed(done)]
        path = fits.path_of_robots(int(fits.starts[0]), [robot], own)
        assert path is not None, "the robot's automaton accepts its subplans only"
        plan = space.path_with(start, [fits.labels_of(edge) for edge in path])
        assert plan is not None, "plans with the sentence are plans of the task"
        paths.append(plan)
    names = tuple(task_language.partition.words[w] for w in words)
    return describe_failure(space, Trail(start, paths), names)
