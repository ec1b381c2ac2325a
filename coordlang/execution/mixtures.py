# SPDX-License-Identifier: GPL-3.0-or-later
"""Every combination of the robots' choices, walked: whether all are optimal, and their states.

A direct proof, from the definition, for one task and one sentence: nodes are ``(a_1 .. a_n, y)``,
the state of each robot's automaton and the plan-space node that all of them together have reached.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from coordlang.execution.automaton import Automaton
from coordlang.execution.task_language import TaskLanguage
from coordlang.required.miscoordination import Miscoordination, Trail, describe_failure
from planners.joint.conditions import Labels
from planners.joint.tables import Ints, ranges, unique_rows
from planners.search.edge_index import EdgeIndex
from planners.search.plan_space import PlanSpace, UnfoldingStep


@dataclass(frozen=True, slots=True)
class Mixtures:
    """What the robots can do together when each takes its choices as it likes.

    ``space``: all of it, as a plan space of one task; None if some combination is no optimal plan,
    and then ``witness`` shows one.  ``nodes`` counts what was walked.
    """

    space: PlanSpace | None
    witness: Miscoordination | None
    nodes: int


def walk_mixtures(
    task_language: TaskLanguage,
    fits: PlanSpace,
    automata: Sequence[Automaton],
    words: Sequence[int],
    most: int,
) -> Mixtures | None:
    """Walk all combinations of the robots' subplans in the task's optimal plans, layer by layer.

    At most (product of the automata's layers) * (layer of the plan space) nodes.  ``automata`` are
    the robots' subplans in ``fits``, the plans with the sentence ``words``.  None, before they are
    made, where there are more than ``most`` joint moves.
    """
    space = task_language.space
    index = EdgeIndex.of(space)
    robots, moves = len(automata), [_Moves(own) for own in automata]
    table = np.array([[0] * robots + [task_language.start]])
    layers = [table[:, robots]]
    steps: list[UnfoldingStep] = []
    walked, made = 1, 0.0
    for _ in range(automata[0].steps):
        degrees = [own.degree[at] for own, at in zip(moves, table.T, strict=False)]
        made += np.prod(degrees, axis=0, dtype=float).sum()
        if made > most:
            return None
        source, labels, after = _together(moves, table)
        edge = table[source, robots]
        for robot in range(robots):
            edge = index.follow(robot, edge, labels[:, robot])
        broken = np.flatnonzero(edge < 0)
        if len(broken):
            last = int(source[broken[0]]), tuple(labels[broken[0]].tolist())
            return Mixtures(None, _witness(task_language, fits, words, steps, *last), walked)
        reached = np.column_stack((after, space.targets(edge)))
        table, number = unique_rows(reached)
        steps.append(UnfoldingStep(source, edge, number))
        layers.append(table[:, robots])
        walked += len(table)
    found = PlanSpace.from_layers(space, layers, steps, task_language.task)
    return Mixtures(found, None, walked)


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
    steps: Sequence[UnfoldingStep],
    node: int,
    labels: tuple[int, ...],
) -> Miscoordination:
    """Plans with the sentence whose mixture breaks at a node of the last layer, by these labels."""
    space, start, done, paths = task_language.space, task_language.start, [labels], []
    for step in reversed(steps):
        arrival = int(np.flatnonzero(step.target == node)[0])
        done.append(space.labels_of(int(step.edge[arrival])))
        node = int(step.source[arrival])
    for robot in range(len(labels)):
        own = [[step[robot]] for step in reversed(done)]
        path = fits.path_of_robots(int(fits.starts[0]), [robot], own)
        assert path is not None, "the robot's automaton accepts its subplans only"
        plan = space.path_with(start, [fits.labels_of(edge) for edge in path])
        assert plan is not None, "plans with the sentence are plans of the task"
        paths.append(plan)
    names = tuple(task_language.partition.words[w] for w in words)
    return describe_failure(space, Trail(start, tuple(zip(*paths, strict=True))), names)
