# SPDX-License-Identifier: GPL-3.0-or-later
"""The layers that a forward search finds: states by their distance, and the steps between them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from planners.joint.model import JointModel
from planners.joint.tables import Bools, Ints, Numbers
from planners.search.state_table import StateTable


@dataclass(frozen=True, slots=True)
class Edges:
    """Joint steps between two layers, by source, states by their numbers in the table."""

    source: Numbers
    target: Numbers
    labels: Numbers
    cost: Numbers

    def only(self, kept: Bools) -> Edges:
        """Some of them."""
        if kept.all():
            return self
        some = np.flatnonzero(kept)
        return Edges(self.source[some], self.target[some], self.labels[some], self.cost[some])

    def compact(self) -> Edges:
        """The same in as few bytes as the largest numbers need: there are many more than states."""
        return Edges(*map(_narrow, (self.source, self.target, self.labels, self.cost)))


@dataclass(slots=True)
class Layers:
    """The states of each layer, the start first, and the joint steps between two layers.

    ``edges[k]`` lead from layer k to the next one; None where they were too many to keep.  Goal
    states are in the last layer only.
    """

    model: JointModel
    table: StateTable
    states: list[Ints] = field(default_factory=list)
    edges: list[Edges | None] = field(default_factory=list)
    makespan: int = 0
    #: Joint steps composed, in all rounds.
    composed: int = 0


def joined_edges(parts: Sequence[Edges], model: JointModel) -> Edges:
    """Parts of the steps between two layers together."""
    if not parts:
        none = np.zeros(0, np.int64)
        return Edges(none, none, np.zeros((0, len(model.robots)), np.int32), none)
    if len(parts) == 1:
        return parts[0]
    return Edges(
        *(
            np.concatenate([getattr(part, name) for part in parts])
            for name in ("source", "target", "labels", "cost")
        )
    )


def _narrow(numbers: Numbers) -> Numbers:
    """The same numbers, none of which is negative, in the smallest signed type.

    Unsigned 64-bit numbers and signed ones would add up to floats.
    """
    return numbers.astype(np.min_scalar_type(-1 - int(numbers.max(initial=0))))
