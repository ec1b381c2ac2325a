# SPDX-License-Identifier: GPL-3.0-or-later
"""A problem that words are learned from, or verified on."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

from coordlang.language.candidates import Candidates
from coordlang.language.partition import Partition
from coordlang.lifted.features import Feature
from coordlang.lifted.language import vectors
from coordlang.lifted.world import States, World
from coordlang.sites.coordinates import Point
from coordlang.verification.candidates import verify_candidates
from planners.joint.tables import Ints
from planners.parallel.workers import Workers

Progress = Callable[[str], None]


@dataclass(frozen=True, eq=False)
class Instance:
    """A problem with its candidate tasks, and coordinates of its places where a file has them."""

    candidates: Candidates
    points: Mapping[str, Point] = field(default_factory=dict)

    @property
    def name(self) -> str:
        """The problem's name."""
        return self.candidates.loaded.problems[0].name

    @cached_property
    def states(self) -> States:
        """The states on plans of the candidate tasks."""
        return States(World.loaded(self.candidates.loaded, self.points), self.candidates.rows)

    def vectors(self, chosen: Sequence[Feature]) -> Ints:
        """The values of features: (states, features)."""
        return vectors(chosen, self.states)

    def holds(
        self, words: Ints, workers: Workers | None = None, progress: Progress | None = None
    ) -> bool:
        """Whether words of the states are a language for the candidate tasks, by definition."""
        names = [f"w{k}" for k in range(int(words.max(initial=0)) + 1)]
        partition = Partition.of_table(names, self.candidates.rows, words)
        workers, progress = workers or Workers(), progress or (lambda _: None)
        return verify_candidates(partition, self.candidates, workers, progress).holds
