# SPDX-License-Identifier: GPL-3.0-or-later
"""The reachable joint states as numpy arrays."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from planners.joint.conditions import Labels
from planners.joint.model import JointModel, Options, Steps
from planners.joint.tables import Ints, Rows, find_rows, ranges, unique_rows
from planners.system.limits import reaching

#: What to try besides a larger limit.
FEWER = "fewer objects or robots"


@dataclass(frozen=True, slots=True)
class PieceSizes:
    """How much is handled at a time: bounds of memory and work, which change no result."""

    #: States expanded at a time, and the joint steps that this should give.
    states: int = 20_000
    steps: int = 4_000_000
    #: (goal, state) pairs handled in one plan space when many tasks are asked for.
    pairs: int = 2_000_000
    #: Joint steps of a forward search that may be bounded exactly, before it is.
    probe: int = 100_000
    #: Conflicts that a SAT solver may spend on these bounds, and on one question about what optimal
    #: plans do.
    effort: int = 5_000_000
    question: int = 20_000


PIECES = PieceSizes()


@dataclass(frozen=True, slots=True)
class Space:
    """All states reachable from some initial states, with every joint step between them.

    ``rows`` (states, words) are sorted; a state's *number* is its position there.  ``first``
    (states + 1) delimits the steps out of a state in ``target``, ``labels`` (steps, robots) and
    ``cost``, sorted by labels (CSR).
    """

    model: JointModel
    rows: Rows
    first: Ints
    target: Ints
    labels: Labels
    cost: Ints

    @classmethod
    def of(
        cls, model: JointModel, rows: Rows, source: Ints, target: Ints, labels: Labels, cost: Ints
    ) -> Space:
        """A space of joint steps that need not be sorted by the state that they lead out of."""
        order = np.argsort(source, kind="stable")
        first = np.searchsorted(source[order], np.arange(len(rows) + 1))
        return cls(model, rows, first, target[order], labels[order], cost[order])

    def __len__(self) -> int:
        return len(self.rows)

    @property
    def sources(self) -> Ints:
        """The state that each step leads out of."""
        return np.repeat(np.arange(len(self)), np.diff(self.first))

    def steps_from(self, states: Ints) -> tuple[Ints, Ints]:
        """All steps out of many states: for each its position in ``states``, and its number."""
        counts = self.first[states + 1] - self.first[states]
        return np.repeat(np.arange(len(states)), counts), ranges(self.first[states], counts)

    def numbers(self, rows: Rows) -> Ints:
        """The numbers of states given as rows, -1 for those that are not reachable."""
        return find_rows(self.rows, rows)


class Exploration:
    """A breadth-first search from some initial states (a table of rows), layer by layer.

    ``layer`` are the states that were new in the last step, ``depth`` joint steps from the initial
    ones; ``seen`` are all so far, sorted; ``composed`` joint steps were composed.
    """

    def __init__(self, model: JointModel, inits: Rows, pieces: PieceSizes = PIECES) -> None:
        self._model, self._pieces = model, pieces
        self.layer, _ = unique_rows(inits)
        self.seen = self.layer
        self.depth = self.composed = 0
        self._sources: list[Rows] = []
        self._steps: list[Steps] = []

    def expand(
        self, only: Callable[[Rows, Options], Options] | None = None, *, keep: bool = True
    ) -> Rows:
        """The states after the layer's joint steps that were not seen before, sorted.

        With ``keep`` the steps are kept for `space`.  The first piece of the layer is short; how
        many steps its states have says how long the next ones may be.
        """
        fresh = self.seen[:0]
        start, size = 0, min(self._pieces.states, 500)
        while start < len(self.layer):
            rows = self.layer[start : start + size]
            steps = self._model.successors(rows, only)
            self.composed += len(steps)
            if keep:
                self._sources.append(rows)
                self._steps.append(steps)
            new, _ = unique_rows(steps.result)
            fresh, _ = unique_rows(np.concatenate((fresh, new[find_rows(self.seen, new) < 0])))
            start += size
            size = max(1, min(self._pieces.states, self._pieces.steps * size // (len(steps) or 1)))
        return fresh

    def enter(self, new: Rows) -> None:
        """Let these states be the next layer."""
        self.layer = new
        self.seen, _ = unique_rows(np.concatenate((self.seen, new)))
        self.depth += 1

    def so_far(self) -> str:
        """How far it got, for messages."""
        return (
            f"{len(self.seen):,} states within {self.depth} steps of the initial states, "
            f"{self.composed:,} joint steps; {len(self.layer):,} states are new in the last step"
        )

    def space(self) -> Space:
        """The states seen with the steps that were kept; those to other states are left out."""
        seen = self.seen
        source = np.concatenate(
            [
                find_rows(seen, rows)[steps.source]
                for rows, steps in zip(self._sources, self._steps, strict=True)
            ]
        )
        target = np.concatenate([find_rows(seen, s.result) for s in self._steps])
        kept = target >= 0
        labels, cost = (
            np.concatenate([getattr(s, field) for s in self._steps])[kept]
            for field in ("labels", "cost")
        )
        return Space.of(self._model, seen, source[kept], target[kept], labels, cost)


def explore(model: JointModel, inits: Rows, pieces: PieceSizes = PIECES) -> Space:
    """Breadth-first search from all ``inits`` (a table of rows) to the end.

    Time and memory are linear in the number of joint steps.
    """
    found = Exploration(model, inits, pieces)
    with reaching(found.so_far, FEWER):
        while len(found.layer):
            found.enter(found.expand())
        return found.space()


def count(model: JointModel, inits: Rows, pieces: PieceSizes = PIECES) -> tuple[int, int]:
    """How many states `explore` finds, and how many joint steps between them.

    Needs only the memory that the states take.
    """
    found = Exploration(model, inits, pieces)
    with reaching(found.so_far, FEWER):
        while len(found.layer):
            found.enter(found.expand(keep=False))
    return len(found.seen), found.composed
