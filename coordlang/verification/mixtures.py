# SPDX-License-Identifier: GPL-3.0-or-later
"""Where a mixture of plans goes, looked up by the robots' labels; the verifier's own."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from planners.joint.tables import Ints
from planners.search.plan_space import PlanSpace

#: In place of the node that a mixture reaches: it is no optimal plan any more.
FAILED = -1


@dataclass(frozen=True, slots=True)
class Mixtures:
    """The edges of a plan space by their source and the robots' labels.

    Labels are looked up robot by robot: (number of the labels so far, label) has a number of its
    own, a position in ``names``.  ``keys`` are sorted (source, number of all labels), and
    ``targets`` what the edges lead to.
    """

    radix: tuple[int, ...]
    names: tuple[Ints, ...]
    keys: Ints
    targets: Ints

    @classmethod
    def of(cls, space: PlanSpace) -> Mixtures:
        """The edges of a plan space."""
        name = np.zeros(len(space.targets()), np.int64)
        radix, names = [], []
        for robot in range(space.robots):
            labels = space.robot_labels(robot)
            radix.append(int(labels.max(initial=0)) + 1)
            different, name = np.unique(name * radix[-1] + labels, return_inverse=True)
            names.append(different)
        key = space.sources * (len(names[-1]) + 1) + name
        order = np.argsort(key)
        return cls(tuple(radix), tuple(names), key[order], space.targets(order))

    def of_labels(self, y: Ints, labels: Sequence[Ints]) -> Ints:
        """The node after ``y`` when each robot has its label, `FAILED` where there is none."""
        if not len(self.keys):
            return np.full(len(y), FAILED)
        name = np.zeros(len(y), np.int64)
        for radix, known, label in zip(self.radix, self.names, labels, strict=True):
            code = np.where(name >= 0, name * radix + label, -1)
            place = np.minimum(np.searchsorted(known, code), len(known) - 1)
            name = np.where(known[place] == code, place, -1)
        key = np.where((y == FAILED) | (name < 0), -1, y * (len(self.names[-1]) + 1) + name)
        found = np.minimum(np.searchsorted(self.keys, key), len(self.keys) - 1)
        return np.where(self.keys[found] == key, self.targets[found], FAILED)
