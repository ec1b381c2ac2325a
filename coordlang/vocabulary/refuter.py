# SPDX-License-Identifier: GPL-3.0-or-later
"""Failing plans that a partition does not tell apart: those known, and by walks where none is.

Every search for partitions asks it, and each profits from what the others met.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from random import Random

import numpy as np

from coordlang.language.warping import Clause
from coordlang.symmetry.group import SymmetryGroup
from coordlang.vocabulary.failing_tuples import Agreeing, FailingTuples
from coordlang.vocabulary.job import Evidence
from coordlang.vocabulary.necessary_clauses import TaskPart
from planners.search.plan_space import PlanSpace
from planners.tables import Ints

#: Tasks are searched for counterexamples in parts, one after another: at least so many parts ..
_LEAST_PARTS = 8
#: .. of about so many tasks at most.
_TASKS_OF_A_PART = 1_500


class Refuter:
    """Decides whether partitions are languages, and keeps what refutes them.

    Attributes
    ----------
    pool
        The failing tuples met so far.
    walks
        How often a part of the tasks was walked.
    """

    def __init__(
        self,
        spaces: Sequence[PlanSpace],
        group: SymmetryGroup,
        states: int,
        seed: int,
        progress: Callable[[str], None] = lambda _: None,
    ) -> None:
        self.pool = FailingTuples(group, states)
        self.walks = 0
        self._random = np.random.default_rng(seed)
        self._parts = _parts(spaces, Random(seed))
        silence = np.zeros(states, np.int64)
        for part in self._parts:
            progress(f"collecting plans whose mixture fails: {len(self.pool):,}")
            self._walk(part, silence)

    def agreeing(
        self, word: Ints, images: Sequence[Ints] | None = None, enough: int = sys.maxsize
    ) -> list[Agreeing]:
        """Failing tuples of which some image has one sentence; none if ``word`` is a language.

        Tasks are walked only where the pool has none, those that were refuted last first.

        Parameters
        ----------
        word
            (states) the word of each state number.
        images
            The symmetries under which images of known tuples are looked at: by default all.
        enough
            Longer tuples are left out once there are so many.
        """
        known = self.pool.agreeing(word, images, enough)
        for number, part in enumerate(self._parts):
            if known:
                break
            if self._walk(part, word):
                known = self.pool.agreeing(word)
                assert known, "plans that a walk has found are known"
                self._parts.insert(0, self._parts.pop(number))
        return known

    def violated(self, word: Ints) -> Mapping[Clause, Evidence]:
        """Necessary clauses, some image of each of which a partition violates.

        None if it is a language.
        """
        return self.pool.clauses(word, self.agreeing(word), self._random)

    def _walk(self, part: TaskPart, word: Ints) -> bool:
        """Add failing plans with one sentence to the pool; whether there are any."""
        self.walks += 1
        found = part.failing(word)
        for table in found:
            self.pool.add(table, part.space)
        return bool(found)


def _parts(spaces: Sequence[PlanSpace], random: Random) -> list[TaskPart]:
    """The tasks in parts, each with a random choice of the goals."""
    parts = []
    for space in spaces:
        goals = list(range(len(space.goals)))
        random.shuffle(goals)
        goal_of_start = space.goal[space.starts]
        count = min(len(goals), max(_LEAST_PARTS, len(space.starts) // _TASKS_OF_A_PART))
        for number in range(count):
            mine = np.isin(goal_of_start, goals[number::count])
            parts.append(TaskPart.of(space, mine))
    return parts
