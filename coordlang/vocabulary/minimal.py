"""The least number of words, with proof: counterexamples in, SAT out.

Loop for K words: find a partition that satisfies all clauses so far; look for plans of one sentence whose mixture fails;
each such tuple gives a clause that every language must satisfy (`coordlang.warping`).  No partition left: K words do not
suffice.  No counterexample left: a language.  Numbers of words are tried from below, and from above where that takes long,
with the same clauses, until the two meet.
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

#: Tasks are searched for counterexamples in parts, one after another: at least so many, of at most so many tasks.
_PARTS, _TASKS = 8, 1_500
#: Counterexamples taken from one part.
_MOST = 200
#: Rounds with counterexamples before another number of words is tried; doubled when nothing else is left.
_PATIENCE = 250


def minimal(job: Job) -> Outcome:
    """A language with the fewest words among all partitions.

    Anytime: out of time or memory, or interrupted, it returns the best language found with the lower bound proved so
    far and says so in ``stopped``.
    """
    search = _Search(job)
    try:
        search.run()
    except (OutOfTime, OutOfMemory, MemoryError, KeyboardInterrupt) as error:
        stop_clock()
        if search.best is None:
            raise
        # Without its traceback, which holds on to all that the search had in memory.
        return Outcome(search.best, search.lower, search.figures(), error.with_traceback(None))
    assert search.best is not None
    return Outcome(search.best, search.lower, search.figures())


class _Search:
    """Closes in on the least number of words: ``lower`` is proved to be needed, ``best`` is a language."""

    def __init__(self, job: Job) -> None:
        self._job = job
        self.lower = job.lower_bound
        self.best: Partition | None = job.incumbent
        self._rounds = 0
        self._found = 0
        self._clauses: list[Clause] = []
        self._known: set[Clause] = set()
        self._symmetries: list[list[int]] = []

    @property
    def _upper(self) -> int:
        return len(set(self.best.values())) if self.best is not None else len(self._job.states)

    def run(self) -> None:
        job = self._job
        if not job.alphas.requiring:
            self.best = dict.fromkeys(job.states, 0)
            return
        self._symmetries = [p.tolist() for p in state_symmetries(job.candidates)]
        parts = _parts(job.candidates.spaces, Random(job.seed))
        patience = _PATIENCE
        while self.best is None or self.lower < self._upper:
            # From below as long as that is quick; what is slow is first closed in from above, to have a good language.
            if self._decide(self.lower, parts, patience):
                continue
            middle = (self.lower + self._upper) // 2
            if middle == self.lower or not self._decide(middle, parts, patience):
                patience *= 2

    def _decide(self, size: int, parts: Sequence[_Part], patience: int) -> bool:
        """Find a language with ``size`` words or prove that there is none; False if patience ran out before."""
        self._clauses = reduce(self._clauses)
        colouring = Colouring(_by_demand(self._job.states, self._clauses), size)
        try:
            for clause in self._clauses:
                colouring.add(clause)
            partition = self._refine(colouring, parts, patience)
        except _Impatient:
            return False
        finally:
            colouring.delete()
        if partition is None:
            self.lower = size + 1
        else:
            self._job.check(partition)
            self.best = partition
        return True

    def _refine(self, colouring: Colouring, parts: Sequence[_Part], patience: int) -> Partition | None:
        """The loop for one number of words: a language, or None if there is none."""
        partition = colouring.solve()
        clean = position = 0
        word = np.zeros(len(self._job.candidates.rows), np.int64)
        while partition is not None and clean < len(parts):
            if patience <= 0:
                raise _Impatient
            self._rounds += 1
            word[list(partition)] = list(partition.values())
            fresh = parts[position].clauses(word)
            position = (position + 1) % len(parts)
            self._job.progress(
                f"trying {colouring.size} words, {self.lower} to {self._upper} needed: "
                f"round {self._rounds}, {len(self._clauses):,} clauses"
            )
            if not fresh:
                clean += 1
                continue
            clean = 0
            patience -= 1
            self._found += len(fresh)
            for clause in self._images(reduce(fresh)):
                self._clauses.append(clause)
                colouring.add(clause)
            partition = colouring.solve()
        return partition

    def figures(self) -> dict[str, float]:
        return {
            "rounds": self._rounds,
            "counterexamples": self._found,
            "clauses": len(self._clauses),
            "symmetries": len(self._symmetries),
        }

    def _images(self, clauses: Iterable[Clause]) -> Iterable[Clause]:
        """New clauses with their images under the symmetries."""
        for clause in clauses:
            images = [clause, *(frozenset(pair(s[a], s[b]) for a, b in clause) for s in self._symmetries)]
            for image in images:
                if image not in self._known:
                    self._known.add(image)
                    yield image


class _Impatient(Exception):
    """A number of words is not decided yet, and others may be easier."""


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
        count = min(len(goals), max(_PARTS, len(space.starts) // _TASKS))
        for number in range(count):
            mine = np.isin(goal_of_start, goals[number::count])
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
