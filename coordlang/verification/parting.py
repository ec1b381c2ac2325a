# SPDX-License-Identifier: GPL-3.0-or-later
"""Where plans that are together may part before their sentences do: Proposition 9.

The steps out of a node that enter one word, or none, are a *class*.  Plans with one sentence take
steps of one class.  They stay together where the steps of a class are all combinations of what they
are for each robot, which counting shows, of many goals at once: a step towards a goal leaves one
step less to go, and all else that counts is the same for every goal.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from planners.joint.conditions import Labels
from planners.joint.tables import Bools, Ints, unique_rows
from planners.search.plan_space import PlanSpace


@dataclass(frozen=True, slots=True)
class _Groups:
    """Rows of a table by the group that each belongs to, which may be none."""

    order: Ints
    counts: Ints

    @classmethod
    def of(cls, group: Ints, size: int) -> _Groups:
        return cls(np.argsort(group, kind="stable"), np.bincount(group, minlength=size))

    def sums(self, table: Bools) -> NDArray[np.unsignedinteger[Any]]:
        """How many of the rows of each group are true, column by column: (groups, columns)."""
        first = np.cumsum(self.counts) - self.counts
        most = int(self.counts.max(initial=0))
        sums = np.zeros((len(self.counts), table.shape[1]), np.min_scalar_type(most))
        for position in range(most):
            larger = np.flatnonzero(self.counts > position)
            sums[larger] += table[self.order[first[larger] + position]]
        return sums


@dataclass(frozen=True, slots=True)
class Parting:
    """The steps of a graph in classes, and as they are for each robot.

    ``sources`` and ``targets`` (steps) are nodes.  ``classes`` are the steps by class, ``nodes``
    the classes by node; ``speaks`` (classes) says whether a word is entered.  For each robot
    ``own`` are the steps by what they are for it, and these by class.
    """

    sources: Ints
    targets: Ints
    classes: _Groups
    nodes: _Groups
    speaks: Bools
    own: tuple[tuple[_Groups, _Groups], ...]

    @classmethod
    def of(
        cls, sources: Ints, targets: Ints, labels: Labels, word: Ints, ends: Sequence[Ints]
    ) -> Parting:
        """``word`` (nodes) are the words, ``ends`` say where each step leads for each robot."""
        said = np.where(word[targets] != word[sources], word[targets] + 1, 0)
        classes, group = _different(sources, said)
        own = []
        for robot, end in enumerate(ends):
            parts, part = _different(group, labels[:, robot].astype(np.int64), end)
            own.append((_Groups.of(part, len(parts)), _Groups.of(parts[:, 0], len(classes))))
        by_class, by_node = _Groups.of(group, len(classes)), _Groups.of(classes[:, 0], len(word))
        return cls(sources, targets, by_class, by_node, classes[:, 1] > 0, tuple(own))

    def at(self, left: Ints) -> Bools:
        """At which nodes plans may part, by goal: (nodes, goals).

        ``left`` (nodes, goals) are the steps to each goal, -1 where it cannot be reached.
        """
        taken = left[self.targets] + 1 == left[self.sources]
        steps = self.classes.sums(taken)
        combinations = np.ones(steps.shape)
        for parts, of_class in self.own:
            combinations *= of_class.sums(parts.sums(taken) > 0)
        speaks = self.speaks[:, None]
        of_classes = combinations != steps, (steps > 0) & ~speaks, (steps > 0) & speaks
        larger, silent, speaking = (self.nodes.sums(some) > 0 for some in of_classes)
        return (larger | silent & speaking) & (left > 0)


def label_sequences(space: PlanSpace) -> tuple[Ints, Bools]:
    """What each robot can do from each node, and from which nodes some mixture of plans fails.

    First (nodes, robots) numbers of the sets of a robot's label sequences; nodes in one layer from
    which no mixture fails have equal numbers iff their sets are equal, and every other node has a
    number of its own.  No mixture fails from a node iff its edges are all combinations of what they
    are for each robot, a label and a set of what follows, and none fails from where they lead.
    O(edges log edges).
    """
    numbers = np.zeros((len(space), space.robots), np.int64)
    fails = np.zeros(len(space), np.bool_)
    for nodes, below in zip(space.layers[1:], space.edges_by_layer(), strict=True):
        source, size = below.source - nodes.start, nodes.stop - nodes.start
        combinations, moves = np.ones(size), []
        for robot, after in enumerate(numbers[below.target].T):
            own, _ = _different(source, space.robot_labels(robot, below.edges), after)
            combinations *= np.bincount(own[:, 0], minlength=size)
            moves.append(own)
        failing = combinations != np.bincount(source, minlength=size)
        failing[source[fails[below.target]]] = True
        for robot, own in enumerate(moves):
            alone = len(own) + np.arange(size)
            numbers[nodes, robot] = np.where(failing, alone, _numbered(own, size))
        fails[nodes] = failing
    return numbers, fails


def _numbered(rows: Ints, size: int) -> Ints:
    """Numbers below the number of rows for the sets of rows (owner, ..) of so many owners.

    Equal sets have one number; rows are sorted.
    """
    counts = np.bincount(rows[:, 0], minlength=size)
    first = np.cumsum(counts) - counts
    number, known = np.zeros(size, np.int64), 0
    for position in range(int(counts.max(initial=0))):
        larger = np.flatnonzero(counts > position)
        sets, found = _different(number[larger], *rows[first[larger] + position, 1:].T)
        number[larger] = known + found
        known += len(sets)
    return number


def _different(*columns: Ints) -> tuple[Ints, Ints]:
    """The different rows of a table, sorted, and the number of each row among them."""
    return unique_rows(np.column_stack(columns))
