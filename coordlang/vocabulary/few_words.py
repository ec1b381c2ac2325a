# SPDX-License-Identifier: GPL-3.0-or-later
"""The partition into K words under which robots fail least often.

The loop of `minimal` is asked first: where K words are enough for a language, nothing fails.  Else
this is the best that can be said with them (`coordlang.required.failure`): all partitions are tried
where they are few, or it is local search (`coordlang.vocabulary.annealing`).  Partitions are
measured on tables of plans, and the best few are counted exactly.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import closing, suppress
from dataclasses import dataclass
from fractions import Fraction
from math import inf
from random import Random

import numpy as np

from coordlang.language.flexibility import Floats
from coordlang.required.failure import FailureProbability, TooManyToCount, failure_probability
from coordlang.required.plan_table import PlanTable, plan_table
from coordlang.symmetry.group import symmetry_group
from coordlang.vocabulary.annealing import EQUAL, Annealing, AnnealingSettings, Measure
from coordlang.vocabulary.job import Assignment, Job, word_count
from coordlang.vocabulary.loop import Budget
from coordlang.vocabulary.minimal import MinimalSearch
from planners.joint.tables import Ints
from planners.system.errors import OutOfTime
from planners.system.limits import little_time_after, run_until_stopped

#: Partitions up to which all are tried.
_ALL = 50_000
#: Tasks of which a table has plans; of more some are drawn.
_TASKS = 3_000
#: The worst task is searched for by a norm with this exponent, which has slopes everywhere.
_NORM = 8
#: Partitions that are counted exactly at a time.
_RECOUNTED = 3
#: Partitions that are drawn to begin with the best of them.
_BEGINS = 10


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
        Whether no partition into so many words is better: all were tried, or nothing fails.
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


def few_words(
    job: Job,
    words: int,
    *,
    worst: bool = False,
    start: Assignment | None = None,
    settings: AnnealingSettings | None = None,
) -> FewWords:
    """Find the partition into at most ``words`` words under which robots fail least.

    Anytime: when a limit comes, the best partition so far is returned.

    Parameters
    ----------
    job
        What it is for; its incumbent is a language, None where plans are inseparable.
    worst
        Minimise how often robots fail in the worst task, not in the mean.
    start
        Words, at most so many, that are as good as known: the result is no worse.

    Raises
    ------
    TooManyToCount
        If not even silence can be counted.
    """
    search = _Search(job, words, worst)
    job.progress("counting how often robots fail in silence")
    search.count([0] * len(job.states))
    if start is not None:
        search.count([start[state] for state in job.states])
    stopped = run_until_stopped(lambda: search.run(start, settings or AnnealingSettings()))
    if stopped is not None and search.candidates:
        search.candidates = search.candidates[:1]
        with suppress(TooManyToCount, OutOfTime, KeyboardInterrupt), little_time_after(stopped):
            search.recount()
    return search.result(stopped)


class _Search:
    """The best partitions: measured in floats, counted exactly.

    Attributes
    ----------
    partition, failures, silence
        The best one that was counted, how often robots fail under it, and in silence.
    candidates
        Partitions to count, each with its rank, the best first.
    """

    def __init__(self, job: Job, words: int, worst: bool) -> None:
        self._job, self._words, self._worst = job, words, worst
        self.partition: Assignment = {}
        self.failures = self.silence = FailureProbability(())
        self.candidates: list[tuple[float, tuple[int, ...]]] = []
        self._is_best = words == 1
        self._annealing: Annealing | None = None
        self._measured = self._counted = 0

    def result(self, stopped: BaseException | None) -> FewWords:
        """The best one."""
        return FewWords(
            self.partition,
            self.failures,
            self.silence,
            self._is_best or self._never_fails,
            self._measured + (self._annealing.moves if self._annealing else 0),
            self._counted,
            stopped,
        )

    @property
    def _never_fails(self) -> bool:
        return not self.failures.worst

    def run(self, start: Assignment | None, settings: AnnealingSettings) -> None:
        """A language, if there is one; else all partitions, or local search."""
        if self._is_best or self._never_fails:
            return
        language = self._coarsest_language()
        if language is not None and word_count(language) <= self._words:
            self._take(language, FailureProbability((Fraction(0),) * len(self.silence.tasks)))
            return
        job = self._job
        table = plan_table(
            job.candidates.spaces, len(job.candidates.rows), most_tasks=_TASKS, seed=job.seed
        )
        if table.is_complete and partitions(len(job.states), self._words, _ALL) <= _ALL:
            self._try_all(table)
        else:
            self._anneal(table, start or language, settings)

    def _coarsest_language(self) -> Assignment | None:
        """The language with the fewest words that is found with some effort."""
        if self._job.incumbent is None:
            return None
        with closing(MinimalSearch(self._job)) as search:
            search.merge()
            if search.upper > self._words:
                search.decide(self._words, Budget())
            return search.best

    def _try_all(self, table: PlanTable) -> None:
        """Measure all partitions, and count the best ones exactly."""
        every = np.arange(len(table))
        least, equal = inf, list[tuple[int, ...]]()
        for number, chosen in enumerate(_all(len(self._job.states), self._words), 1):
            rank = self._rank(table.failures(self._word_of(chosen), every), table.tasks)
            self._measured += 1
            if rank < least - EQUAL:
                least, equal = rank, []
                self.candidates = [(rank, chosen)]
            if rank < least + EQUAL and len(equal) < _RECOUNTED:
                equal.append(chosen)
            if least < EQUAL:
                break
            if number % 1_000 == 0:
                self._job.progress(f"trying all partitions: {number:,} so far")
        self.candidates = [(least, chosen) for chosen in equal]
        self.recount()
        self._is_best = True

    def _anneal(
        self, table: PlanTable, begin: Assignment | None, settings: AnnealingSettings
    ) -> None:
        """Cool again and again, until nothing fails or a cooling finds nothing better."""
        job, random = self._job, Random(self._job.seed)
        states = list(job.states)

        def offer(word: Ints, values: Floats, _: float) -> None:
            self._offer(self._rank(values, table.tasks), word[states].tolist())

        annealing = self._annealing = Annealing(
            states,
            self._words,
            Measure(table, table.failures, lambda values: self._energy(values, table.tasks)),
            offer,
            random,
            permutations=symmetry_group(job.candidates).permutations,
            settings=settings,
        )
        every = np.arange(len(table))
        drawn = [self._word_of(self._drawn(begin, random)) for _ in range(_BEGINS)]
        values = [table.failures(word, every) for word in drawn]
        self._measured = _BEGINS
        first = min(range(_BEGINS), key=lambda n: self._energy(values[n], table.tasks))
        offer(drawn[first], values[first], 0.0)
        annealing.begin(drawn[first])
        for _ in annealing.search(self._value, job.progress):
            self.recount()
            if self._never_fails:
                return
            annealing.begin(self._word_of([self.partition[state] for state in states]))

    def _value(self) -> float:
        mean, worst = self.failures.mean, self.failures.worst
        return float(worst + mean / 1_000 if self._worst else mean)

    def _drawn(self, begin: Assignment | None, random: Random) -> list[int]:
        """Drawn words; of a partition with more words each becomes one of fewer."""
        states = self._job.states
        if begin is None:
            return [random.randrange(self._words) for _ in states]
        words = sorted(set(begin.values()))
        if len(words) <= self._words:
            return [words.index(begin[state]) for state in states]
        becomes = {word: random.randrange(self._words) for word in words}
        return [becomes[begin[state]] for state in states]

    def _word_of(self, chosen: Sequence[int]) -> Ints:
        """The word number of every state, on plans or not."""
        word = np.zeros(len(self._job.candidates.rows), np.int64)
        word[list(self._job.states)] = chosen
        return word

    def _energy(self, values: Floats, tasks: int) -> float:
        """What is minimised: the mean, or a smooth stand-in for the worst task."""
        if not len(values):
            return 0.0
        mean = float(values.sum()) / tasks
        if not self._worst:
            return mean
        norm = float(np.linalg.norm(values, _NORM)) / float(len(values) ** (1 / _NORM))
        return norm + mean / 100

    def _rank(self, values: Floats, tasks: int) -> float:
        """By what partitions are compared in the end; near the energy."""
        if not len(values):
            return 0.0
        mean = float(values.sum()) / tasks
        return float(values.max()) + mean / 1_000 if self._worst else mean

    def _offer(self, rank: float, chosen: Sequence[int]) -> None:
        """Keep a partition for an exact count if it is among the best."""
        limit = self.candidates[-1][0] if len(self.candidates) >= _RECOUNTED else inf
        if rank < limit - EQUAL:
            known = canonical(chosen)
            if all(known != other for _, other in self.candidates):
                self.candidates = sorted([*self.candidates, (rank, known)])[:_RECOUNTED]

    def recount(self) -> None:
        """Count the best partitions exactly, and keep the best one."""
        for _, chosen in self.candidates:
            self.count(chosen)
        self.candidates.clear()

    def count(self, chosen: Sequence[int]) -> None:
        """Count one partition exactly; keep it if it is the best one."""
        word, spaces = self._word_of(chosen), self._job.candidates.spaces
        found = failure_probability(spaces, [word[space.state] for space in spaces])
        self._counted += 1
        partition = dict(zip(self._job.states, map(int, chosen), strict=True))
        if not self.silence.tasks:
            self.silence = found
            self._take(partition, found)
        elif self._order(found) < self._order(self.failures):
            self._take(partition, found)

    def _order(self, found: FailureProbability) -> tuple[Fraction, Fraction]:
        """What is minimised: the mean, then the worst task; or the other way round."""
        pair = found.mean, found.worst
        return pair[::-1] if self._worst else pair

    def _take(self, partition: Assignment, failures: FailureProbability) -> None:
        self.partition, self.failures = partition, failures


def partitions(states: int, words: int, most: int) -> int:
    """How many partitions of some states into at most so many words there are; ``most`` + 1: more.

    By the recurrence of restricted growth strings.
    """
    counts = {0: 1}  # how many beginnings use so many words
    for _ in range(states):
        longer: dict[int, int] = {}
        for used, number in counts.items():
            longer[used] = longer.get(used, 0) + used * number
            if used < words:
                longer[used + 1] = longer.get(used + 1, 0) + number
        counts = longer
        if sum(counts.values()) > most:
            return most + 1
    return sum(counts.values())


def _all(states: int, words: int) -> Iterator[tuple[int, ...]]:
    """All partitions into at most so many words, as restricted growth strings."""

    def extend(prefix: tuple[int, ...], used: int) -> Iterator[tuple[int, ...]]:
        if len(prefix) == states:
            yield prefix
            return
        for word in range(min(used + 1, words)):
            yield from extend((*prefix, word), max(used, word + 1))

    return extend((), 0)


def canonical(chosen: Sequence[int]) -> tuple[int, ...]:
    """The same partition with its words numbered in the order of their first states."""
    number: dict[int, int] = {}
    return tuple(number.setdefault(int(word), len(number)) for word in chosen)
