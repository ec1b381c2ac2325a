# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether a partition is a language, by counterexamples, which give clauses for the next one."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from coordlang.language.warping import Clause
from coordlang.required.divergences import required_nodes
from coordlang.symmetry.group import symmetry_group
from coordlang.vocabulary.job import Assignment, Job
from coordlang.vocabulary.necessary_clauses import NecessaryClauses, TaskPart, task_parts

#: Tasks that are searched for counterexamples together, about so many.
_TASKS_OF_A_PART = 1_500


@dataclass(slots=True)
class CandidateLanguages:
    """Partitions looked at one after another: each gives clauses, or is a language.

    Attributes
    ----------
    known
        Clauses that every language satisfies.
    parts
        The tasks, in parts that are searched for counterexamples one after another.
    rounds
        The partitions looked at.
    """

    known: NecessaryClauses
    parts: list[TaskPart]
    _states: int
    rounds: int = 0
    _current: int = 0

    @classmethod
    def of(cls, job: Job, clauses: Iterable[Clause] = ()) -> CandidateLanguages:
        """For the tasks of a job; ``clauses`` are known already."""
        spaces = job.candidates.spaces
        parts = task_parts(spaces, [required_nodes(space) for space in spaces], _TASKS_OF_A_PART)
        known = NecessaryClauses(symmetry_group(job.candidates))
        known.clauses.extend(clauses)
        return cls(known, parts, len(job.candidates.rows))

    @property
    def clauses(self) -> list[Clause]:
        """The clauses known so far, a list that only grows."""
        return self.known.clauses

    def holds(self, partition: Assignment) -> bool:
        """Whether there is no counterexample; those that are found are added to the clauses."""
        self.rounds += 1
        word = np.zeros(self._states, np.int64)
        word[list(partition)] = list(partition.values())
        for _ in self.parts:
            part = self.parts[self._current]
            if found := part.violated(word):
                self.known.add(found, part.space)
                return False
            self._current = (self._current + 1) % len(self.parts)
        return True
