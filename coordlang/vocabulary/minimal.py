"""The least number of words, with proof: counterexamples in, SAT out.

Loop for K words: find a partition that satisfies all clauses so far; look for plans of one sentence whose mixture fails;
each such tuple gives a clause that every language must satisfy (`coordlang.warping`).  No partition left: K words do not
suffice, and K + 1 are tried with the same clauses.  No counterexample left: a language, and the least.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from random import Random

import numpy as np

from coordlang.counterexamples import counterexamples
from coordlang.symmetry import state_symmetries
from coordlang.tuples import EdgeIndex
from coordlang.vocabulary.job import Job, Outcome, Partition
from coordlang.vocabulary.sat import Colouring, reduce
from coordlang.warping import Clause, pair, separation_clause
from planners.errors import OutOfMemory, OutOfTime
from planners.limits import stop_clock
from planners.matching import Ints
from planners.optimal import PlanSpace

#: Tasks are searched for counterexamples in this many parts, one after another.
_PARTS = 8
#: Counterexamples taken from one part.
_MOST = 200


def minimal(job: Job) -> Outcome:
    """A language with the fewest words among all partitions.

    Anytime: out of time or memory, or interrupted, it returns the incumbent with the lower bound proved so far and
    says so in ``stopped``.
    """
    search = _Search(job)
    try:
        partition = search.run()
    except (OutOfTime, OutOfMemory, MemoryError, KeyboardInterrupt) as error:
        stop_clock()
        if job.incumbent is None:
            raise
        return Outcome(job.incumbent, search.size, search.figures(), error)
    return Outcome(partition, search.size, search.figures())


class _Search:
    def __init__(self, job: Job) -> None:
        self._job = job
        self.size = job.lower_bound
        self._rounds = 0
        self._found = 0
        self._clauses: list[Clause] = []
        self._known: set[Clause] = set()
        self._symmetries: list[list[int]] = []

    def run(self) -> Partition:
        job = self._job
        if not job.alphas.requiring:
            return dict.fromkeys(job.states, 0)
        self._symmetries = [p.tolist() for p in state_symmetries(job.candidates)]
        parts = _parts(job.candidates.spaces, Random(job.seed))
        while True:
            self._clauses = reduce(self._clauses)
            colouring = Colouring(_by_demand(job.states, self._clauses), self.size)
            try:
                partition = self._with_size(colouring, parts)
            finally:
                colouring.delete()
            if partition is not None:
                return partition
            if job.incumbent is not None and self.size + 1 == len(set(job.incumbent.values())):
                self.size += 1
                return job.incumbent
            self.size += 1

    def figures(self) -> dict[str, float]:
        return {
            "rounds": self._rounds,
            "counterexamples": self._found,
            "clauses": len(self._clauses),
            "symmetries": len(self._symmetries),
        }

    def _with_size(self, colouring: Colouring, parts: Sequence[_Part]) -> Partition | None:
        """A language with this many words, or None if there is none."""
        for clause in self._clauses:
            colouring.add(clause)
        partition = colouring.solve()
        clean = position = 0
        word = np.zeros(len(self._job.candidates.rows), np.int64)
        while partition is not None and clean < len(parts):
            self._rounds += 1
            word[list(partition)] = list(partition.values())
            fresh = parts[position].clauses(word)
            position = (position + 1) % len(parts)
            self._job.progress(
                f"{self.size} words: round {self._rounds}, {len(self._clauses):,} clauses"
                + (f", at most {len(set(self._job.incumbent.values()))} needed" if self._job.incumbent else "")
            )
            if not fresh:
                clean += 1
                continue
            clean = 0
            self._found += len(fresh)
            for clause in self._images(reduce(fresh)):
                self._clauses.append(clause)
                colouring.add(clause)
            partition = colouring.solve()
        return partition

    def _images(self, clauses: Iterable[Clause]) -> Iterable[Clause]:
        """New clauses with their images under the symmetries."""
        for clause in clauses:
            images = [clause, *(frozenset(pair(s[a], s[b]) for a, b in clause) for s in self._symmetries)]
            for image in images:
                if image not in self._known:
                    self._known.add(image)
                    yield image


class _Part:
    """Some of the tasks, searched for counterexamples together."""

    def __init__(self, space: PlanSpace, index: EdgeIndex, starts: Ints) -> None:
        self._space, self._index, self._starts = space, index, starts

    def clauses(self, word: Ints) -> list[Clause]:
        """Clauses that the words (one per state) violate."""
        found = set()
        nodes = word[self._space.state]
        for example in counterexamples(self._space, self._index, nodes, _MOST, self._starts):
            clause = separation_clause(example.states, word)  # type: ignore[arg-type]
            assert clause, "the plans have one sentence, and none of them is the other"
            found.add(clause)
        return sorted(found, key=sorted)


def _parts(spaces: Sequence[PlanSpace], random: Random) -> list[_Part]:
    parts = []
    for space in spaces:
        index = EdgeIndex.of(space)
        goals = list(range(len(space.goals)))
        random.shuffle(goals)
        goal_of_start = space.goal[space.starts]
        for number in range(min(_PARTS, len(goals))):
            mine = np.isin(goal_of_start, goals[number::_PARTS])
            parts.append(_Part(space, index, np.unique(space.starts[mine])))
    return parts


def _by_demand(states: Iterable[int], clauses: Iterable[Clause]) -> list[int]:
    """States in the order of how much the clauses ask of them: a good order to break the symmetry of words."""
    demand: dict[int, float] = {}
    for clause in clauses:
        for states_of_pair in clause:
            for state in states_of_pair:
                demand[state] = demand.get(state, 0.0) + 1 / len(clause)
    return sorted(states, key=lambda s: (-demand.get(s, 0.0), s))
