# SPDX-License-Identifier: GPL-3.0-or-later
"""The best partitions met by a search for few words: measured in floats, counted exactly."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from math import inf

import numpy as np

from coordlang.language.flexibility import Floats
from coordlang.required.failure import FailureProbability, failure_probability
from coordlang.vocabulary.job import Assignment
from planners.joint.tables import Ints
from planners.search.plan_space import PlanSpace

#: The worst task is searched for by a norm with this exponent, which has slopes everywhere.
_NORM = 8
#: Values that are equal but for rounding.
EQUAL = 1e-9
#: Partitions that are counted exactly at a time.
RECOUNTED = 3


@dataclass(frozen=True, slots=True)
class FewWords:
    """The best partition that was found.

    Attributes
    ----------
    partition
        State number -> word number.
    failures, silence
        How often robots fail under it, and without a word, exactly.
    is_best
        Whether all partitions into so many words were tried: none is better.
    measured, recounted
        Partitions whose failures were measured, and those whose failures were counted exactly.
    stopped
        The error that ended the search early, or None.
    """

    partition: Assignment
    failures: FailureProbability
    silence: FailureProbability
    is_best: bool
    measured: int
    recounted: int
    stopped: BaseException | None = None

    def value(self, worst: bool) -> tuple[Fraction, Fraction]:
        """What is minimised: the mean, then the worst task; or the other way round."""
        pair = self.failures.mean, self.failures.worst
        return pair[::-1] if worst else pair


@dataclass(slots=True)
class Search:
    """What every way to search shares: the measure, the best partitions, exact counts."""

    spaces: Sequence[PlanSpace]
    states: tuple[int, ...]
    rows: int
    words: int
    worst: bool
    symmetries: Sequence[Sequence[int]] = ()
    best: FewWords | None = None
    silence: FailureProbability | None = None
    measured: int = 0
    recounted: int = 0
    candidates: list[tuple[float, tuple[int, ...]]] = field(default_factory=list)

    def word_of(self, chosen: Sequence[int]) -> Ints:
        """The word number of every state, on plans or not."""
        word = np.zeros(self.rows, np.int64)
        word[list(self.states)] = chosen
        return word

    def energy(self, values: Floats, tasks: int) -> float:
        """What the search minimises: the mean, or a smooth stand-in for the worst task."""
        if not len(values):
            return 0.0
        if not self.worst:
            return float(values.sum()) / tasks
        norm = float(np.linalg.norm(values, _NORM)) / float(len(values) ** (1 / _NORM))
        return norm + float(values.sum()) / tasks / 100

    def rank(self, values: Floats, tasks: int) -> float:
        """By what partitions are compared in the end; near the energy."""
        if not len(values):
            return 0.0
        mean = float(values.sum()) / tasks
        return float(values.max()) + mean / 1_000 if self.worst else mean

    def offer(self, rank: float, chosen: Sequence[int]) -> None:
        """Keep a partition for an exact count if it is among the best."""
        self.measured += 1
        limit = self.candidates[-1][0] if len(self.candidates) >= RECOUNTED else inf
        if rank < limit - EQUAL:
            known = canonical(chosen)
            if all(known != other for _, other in self.candidates):
                self.candidates = sorted([*self.candidates, (rank, known)])[:RECOUNTED]

    def recount(self) -> None:
        """Count the best partitions exactly, and keep the best one."""
        for _, chosen in self.candidates:
            self.count(chosen)
        self.candidates.clear()

    def count(self, chosen: Sequence[int]) -> None:
        """Count one partition exactly; keep it if it is the best one."""
        word = self.word_of(chosen)
        found = failure_probability(self.spaces, [word[space.state] for space in self.spaces])
        self.recounted += 1
        partition = dict(zip(self.states, (int(w) for w in chosen), strict=True))
        if self.silence is None:
            self.silence = found
        new = FewWords(partition, found, self.silence, False, self.measured, self.recounted)
        if self.best is None or new.value(self.worst) < self.best.value(self.worst):
            self.best = new

    @property
    def is_language(self) -> bool:
        """Whether the best partition makes no robot fail."""
        return self.best is not None and not self.best.failures.worst


def canonical(chosen: Sequence[int]) -> tuple[int, ...]:
    """The same partition with its words numbered in the order of their first states."""
    number: dict[int, int] = {}
    return tuple(number.setdefault(int(word), len(number)) for word in chosen)
