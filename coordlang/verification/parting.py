# SPDX-License-Identifier: GPL-3.0-or-later
"""Where plans that are together may part before their sentences do: Proposition 9.

The steps out of a node that enter one word, or none, are a *class*.  Plans with one sentence take
steps of one class.  They stay together where the steps of a class are all combinations of what they
are for each robot, which counting shows, of many goals at once: a step towards a goal leaves one
step less to go, and all else that counts is the same for every goal.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from planners.joint.conditions import Labels
from planners.joint.tables import Bools, Ints, unique_rows
from planners.search.plan_space import PlanSpace


class _Groups:
    """Rows of a table by the group that each belongs to, which may be none."""

    def __init__(self, group: Ints, size: int) -> None:
        self._order = np.argsort(group, kind="stable")
        self._counts = np.bincount(group, minlength=size)

    def sums(self, table: Bools) -> NDArray[np.unsignedinteger[Any]]:
        """How many of the rows of each group are true, column by column: (groups, columns)."""
        first = np.cumsum(self._counts) - self._counts
        most = int(self._counts.max(initial=0))
        sums = np.zeros((len(self._counts), table.shape[1]), np.min_scalar_type(most))
        for position in range(most):
            larger = np.flatnonzero(self._counts > position)
            sums[larger] += table[self._order[first[larger] + position]]
        return sums


class Parting:
    """The steps of a graph in classes, and as they are for each robot.

    ``sources`` and ``targets`` (steps) are nodes, ``labels`` (steps, robots) what is done,
    ``word`` (nodes) the words; ``ends`` say where each step leads for each robot.
    """

    def __init__(
        self, sources: Ints, targets: Ints, labels: Labels, word: Ints, ends: Sequence[Ints]
    ) -> None:
        self._sources, self._targets = sources, targets
        said = np.where(word[targets] != word[sources], word[targets] + 1, 0)
        classes, group = _different(sources, said)
        #: The steps by class, the classes by node, and whether a word is entered in each class.
        self._classes, self._nodes = _Groups(group, len(classes)), _Groups(classes[:, 0], len(word))
        self._speaks = classes[:, 1:] > 0
        #: For each robot the steps by what they are for it, and these by class.
        self._own = []
        for robot, end in enumerate(ends):
            parts, part = _different(group, labels[:, robot].astype(np.int64), end)
            self._own.append((_Groups(part, len(parts)), _Groups(parts[:, 0], len(classes))))

    def at(self, left: Ints) -> Bools:
        """At which nodes plans may part, by goal: (nodes, goals).

        ``left`` (nodes, goals) are the steps to each goal, -1 where it cannot be reached.
        """
        taken = left[self._targets] + 1 == left[self._sources]
        steps = self._classes.sums(taken)
        combinations = np.ones(steps.shape)
        for parts, of_class in self._own:
            combinations *= of_class.sums(parts.sums(taken) > 0)
        speaks = self._speaks
        of_classes = combinations != steps, (steps > 0) & ~speaks, (steps > 0) & speaks
        larger, silent, speaking = (self._nodes.sums(some) > 0 for some in of_classes)
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
    return unique_rows(np.array(columns).T)
