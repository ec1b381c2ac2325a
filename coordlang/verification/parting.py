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
from planners.joint.tables import Bools, Ints, unique_tuples
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
    """The steps of a graph in classes, as they are for each robot.

    ``sources``, ``targets`` (steps) are nodes.  ``several`` are the steps in classes of two or more
    steps, and ``classes`` these by class; for each robot ``own`` are they by what they are for the
    robot, and that by class.  ``nodes`` are the classes by node; ``silent`` and ``speaking`` steps
    that enter no word, and some word, out of nodes that have both, with their nodes.
    """

    sources: Ints
    targets: Ints
    several: Ints
    classes: _Groups
    own: tuple[tuple[_Groups, _Groups], ...]
    nodes: _Groups
    silent: tuple[Ints, _Groups]
    speaking: tuple[Ints, _Groups]

    @classmethod
    def of(
        cls, sources: Ints, targets: Ints, labels: Labels, word: Ints, ends: Sequence[Ints]
    ) -> Parting:
        """``word`` (nodes) are the words, ``ends`` say where each step leads for each robot."""
        size = len(word)
        said = np.where(word[targets] != word[sources], word[targets] + 1, 0)
        _, group = unique_tuples(np.column_stack((sources, said)), [size, _most(said)])
        several = np.flatnonzero(np.bincount(group)[group] > 1)
        classes, group = np.unique(group[several], return_inverse=True)
        node = np.zeros(len(classes), np.int64)
        node[group] = sources[several]
        own = []
        for robot, end in enumerate(ends):
            label = labels[several, robot].astype(np.int64)
            rows = np.column_stack((group, label, end[several]))
            parts, part = unique_tuples(rows, list(map(_most, rows.T)))
            own.append((_Groups.of(part, len(parts)), _Groups.of(parts[:, 0], len(classes))))
        silent, speaks = np.zeros(size, np.bool_), np.zeros(size, np.bool_)
        silent[sources[said == 0]] = speaks[sources[said > 0]] = True
        both = (silent & speaks)[sources]
        mixed = [np.flatnonzero(both & enters) for enters in (said == 0, said > 0)]
        return cls(
            sources,
            targets,
            several,
            _Groups.of(group, len(classes)),
            tuple(own),
            _Groups.of(node, size),
            *((steps, _Groups.of(sources[steps], size)) for steps in mixed),
        )

    def at(self, left: Ints) -> Bools:
        """At which nodes plans may part, by goal: (nodes, goals).

        ``left`` (nodes, goals) are the steps to each goal, -1 where it cannot be reached.
        """

        def taken(steps: Ints) -> Bools:
            onward: Bools = left[self.targets[steps]] + 1 == left[self.sources[steps]]
            return onward

        steps = taken(self.several)
        combinations = np.ones((len(self.classes.counts), left.shape[1]))
        for parts, of_class in self.own:
            combinations *= of_class.sums(parts.sums(steps) > 0)
        found: Bools = self.nodes.sums(combinations != self.classes.sums(steps)) > 0
        silent, speaking = (own.sums(taken(some)) > 0 for some, own in (self.silent, self.speaking))
        found |= silent & speaking
        return found & (left > 0)


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
        combinations = np.ones(size)
        moves = []
        for robot in range(space.robots):
            after = numbers[below.target, robot]
            rows = np.column_stack((source, space.robot_labels(robot, below.edges), after))
            moves.append(unique_tuples(rows, list(map(_most, rows.T)))[0])
            combinations *= np.bincount(moves[-1][:, 0], minlength=size)
        failing = combinations != np.bincount(source, minlength=size)
        failing[source[fails[below.target]]] = True
        for robot, own in enumerate(moves):
            numbers[nodes, robot] = np.where(
                failing, len(own) + np.arange(size), _numbered(own, size)
            )
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
        longer = np.column_stack((number[larger], rows[first[larger] + position, 1:]))
        sets, found = unique_tuples(longer, list(map(_most, longer.T)))
        number[larger] = known + found
        known += len(sets)
    return number


def _most(values: Ints) -> int:
    return int(values.max(initial=0)) + 1
