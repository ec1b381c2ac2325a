# SPDX-License-Identifier: GPL-3.0-or-later
"""Is a partition a language?  If not, plans that fail and are not told apart give clauses.

Every search for partitions asks it, and each profits from what the others met.  Plans are looked
for by walks where none that are known refute the partition.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from random import Random

import numpy as np

from coordlang.language.warping import Clause
from coordlang.required.choices import Choices
from coordlang.symmetry.group import SymmetryGroup, symmetry_group
from coordlang.vocabulary.counterexamples import CounterexampleWalk, Mixtures
from coordlang.vocabulary.failing_tuples import Agreeing, FailingTuples
from coordlang.vocabulary.job import Assignment, Evidence, Job, words_of_states
from coordlang.vocabulary.sat import without_implied
from planners.joint.model import FullState
from planners.joint.tables import Bools, Ints
from planners.search.plan_space import PlanSpace

#: Tasks are searched for counterexamples in parts, one after another: at least so many parts ..
_LEAST_PARTS = 8
#: .. of about so many tasks at most.
_TASKS_OF_A_PART = 1_500
#: Failing tuples of a part that are collected at the beginning, and later at a time: each walk
#: is short if it need not find many.
_AT_FIRST, _LATER = 1_000, 20
#: Longer tuples are left out of what is looked at once there are so many.
_ENOUGH = 2_000


@dataclass(frozen=True, slots=True)
class _Walked:
    """Tasks of a plan space that are walked together, for themselves and for their images.

    ``finder`` finds those of their plans that fail: for two robots a walk, else sets.  ``images``
    are symmetries: those by their positions in the pool's that take the tasks to all of their
    images, each once.
    """

    space: PlanSpace
    finder: CounterexampleWalk | Mixtures
    images: tuple[int, ...]

    @classmethod
    def of(cls, space: PlanSpace, tasks: Bools, images: tuple[int, ...]) -> _Walked:
        part = space.with_tasks(space.starts[tasks], space.second[tasks])
        kind = CounterexampleWalk if space.robots == 2 else Mixtures
        return cls(part, kind(Choices(part)), images)

    def failing(self, word: Ints, most: int, steps: int = sys.maxsize) -> list[Ints]:
        """Failing tuples of plans by the word of each state (states), see `Mixtures.failing`."""
        return self.finder.failing(word[self.space.state], most, len(self.images), steps)


class Languages:
    """Partitions looked at one after another: each is a language, or gives clauses.

    Of goals that are images of each other under a symmetry one is walked: a partition is refuted
    by plans of the tasks to an image iff its image under the symmetry is refuted by plans of the
    tasks to the goal itself.  At the beginning plans are collected that refute the partition
    ``first``, by default a single word, where walks are longest.

    ``clauses`` are those that every language satisfies, in the order in which they were met and
    with their images under the symmetries ``group``: a list that only grows.  ``evidence`` says why
    each is necessary.  ``rounds`` counts the partitions looked at.  ``pool``: the failing tuples
    met so far.  ``walks``: how often a part of the tasks was walked.
    """

    def __init__(
        self,
        spaces: Sequence[PlanSpace],
        group: SymmetryGroup,
        states: int,
        seed: int,
        progress: Callable[[str], None] = lambda _: None,
        first: Ints | None = None,
    ) -> None:
        self.group, self.pool = group, FailingTuples(group, states)
        self.clauses: list[Clause] = []
        self.evidence: dict[Clause, Evidence] = {}
        self.rounds = self.walks = 0
        self._random = np.random.default_rng(seed)
        self._parts = _parts(spaces, self.pool.images, Random(seed))
        word = np.zeros(states, np.int64) if first is None else first
        progress("collecting plans whose mixture fails")
        for walked in self._parts:
            self._keep(walked, walked.failing(word, _AT_FIRST))
            progress(f"collecting plans whose mixture fails: {len(self.pool):,}")

    @classmethod
    def of(cls, job: Job) -> Languages:
        """The languages for the candidate tasks of a job."""
        spaces, states = job.candidates.spaces, len(job.candidates.rows)
        return cls(spaces, symmetry_group(job.candidates), states, job.seed, job.progress)

    def holds(self, partition: Assignment) -> bool:
        """Whether it is a language; if not, the clauses that it violates are known afterwards."""
        self.rounds += 1
        violated = self.violated(words_of_states(partition, self.pool.states))
        for clause in without_implied(violated):
            for image, symmetry in ((clause, None), *self.group.images(clause)):
                if image not in self.evidence:
                    self.evidence[image] = replace(violated[clause], symmetry=symmetry)
                    self.clauses.append(image)
        return not violated

    def agreeing(
        self,
        word: Ints,
        images: Sequence[Ints] | None = None,
        enough: int = sys.maxsize,
        steps: int = sys.maxsize,
    ) -> list[Agreeing]:
        """Failing tuples of which some image has one sentence; none if ``word`` is a language.

        Tasks are walked only where the pool has none, those that were refuted last first.

        ``word``, ``images`` and ``enough``: see `FailingTuples.agreeing`.  Raises `Undecided` after
        so many ``steps`` of robots.
        """
        known = self.pool.agreeing(word, images, enough)
        for number, walked in enumerate(self._parts):
            if known:
                break
            words = [word[self.pool.images[image]] for image in walked.images]
            different = {own.tobytes(): own for own in words}.values()
            if any(self._keep(walked, walked.failing(w, _LATER, steps)) for w in different):
                known = self.pool.agreeing(word, images, enough)
                assert known, "plans that a walk has found are known"
                self._parts.insert(0, self._parts.pop(number))
        return known

    def violated(self, word: Ints) -> Mapping[Clause, Evidence]:
        """Necessary clauses of which a partition violates some image; none if it is a language."""
        return self.pool.clauses(word, self.agreeing(word, enough=_ENOUGH), self._random)

    def _keep(self, walked: _Walked, found: Sequence[Ints]) -> bool:
        """Keep what a walk has found; whether that is anything."""
        self.walks += 1
        for table in found:
            self.pool.add(table, walked.space)
        return bool(found)


def _parts(spaces: Sequence[PlanSpace], images: Sequence[Ints], random: Random) -> list[_Walked]:
    """The tasks in parts, each with a random choice of the goals; goals up to symmetry."""
    parts = []
    for space in spaces:
        for own, goals in sorted(_goals_by_images(space, images).items()):
            random.shuffle(goals)
            goal_of_start = space.goal[space.starts]
            tasks = int(np.isin(goal_of_start, goals).sum())
            least = -(-_LEAST_PARTS // len(own))
            count = min(len(goals), max(least, tasks // _TASKS_OF_A_PART))
            for number in range(count):
                mine = np.isin(goal_of_start, goals[number::count])
                if mine.any():
                    parts.append(_Walked.of(space, mine, own))
    return parts


def _goals_by_images(space: PlanSpace, images: Sequence[Ints]) -> dict[tuple[int, ...], list[int]]:
    """Goals by the symmetries that take them to their images, each image once; one of each orbit.

    A goal that is not a single state is one of its own, and only the identity is needed.
    """
    if not all(isinstance(goal, FullState) for goal in space.goals):
        return {(0,): list(range(len(space.goals)))}
    chosen: dict[tuple[int, ...], list[int]] = {}
    for goal, state in enumerate(ends(space).tolist()):
        reached = np.array([to[state] for to in images])
        if reached.min() == state:
            _, first = np.unique(reached, return_index=True)
            chosen.setdefault(tuple(sorted(first.tolist())), []).append(goal)
    return chosen


def ends(space: PlanSpace) -> Ints:
    """(goals) the state that each goal is, 0 for goals without tasks."""
    nodes = np.flatnonzero(space.layer == 0)
    end = np.zeros(len(space.goals), np.int64)
    end[space.goal[nodes]] = space.state[nodes]
    return end
