# SPDX-License-Identifier: GPL-3.0-or-later
"""The partition into K words under which robots fail least often.

The loop of `minimal` is asked first: where K words are enough for a language, nothing fails.  Else
this is the best that can be said with them (`coordlang.required.failure`): all partitions are tried
where they are few, or it is local search (`coordlang.vocabulary.local_search`).  Partitions are
measured on tables of plans, and the best ones are counted exactly.
"""

from __future__ import annotations

from contextlib import closing, suppress
from fractions import Fraction

import numpy as np

from coordlang.required.failure import FailureProbability, TooManyToCount, failure_probability
from coordlang.required.plan_table import PlanTable
from coordlang.symmetry.group import symmetry_group
from coordlang.vocabulary.exhaustive import partitions
from coordlang.vocabulary.job import Assignment, Job, Outcome, word_count
from coordlang.vocabulary.local_search import WORK, LocalSearch
from coordlang.vocabulary.loop import Budget
from coordlang.vocabulary.minimal import MinimalSearch
from planners.joint.tables import Floats, Ints
from planners.system.errors import OutOfTime
from planners.system.limits import little_time_after, run_until_stopped

#: Partitions up to which all are tried.
_ALL = 50_000
#: The worst task is searched for by a norm with this exponent, which has slopes everywhere.
_NORM = 8
#: Digits by which measured partitions are compared.
_DIGITS = 9


def few_words(
    job: Job,
    words: int,
    *,
    worst: bool = False,
    start: Assignment | None = None,
    work: int = WORK,
) -> tuple[Outcome, FailureProbability]:
    """Find the partition into at most ``words`` words under which robots fail least.

    Anytime: when a limit comes, the best partition so far is returned.

    The incumbent of the ``job`` is a language, None where plans are inseparable.  ``worst``:
    minimise how often robots fail in the worst task, not in the mean.  ``start``: words, at most so
    many, that are as good as known: the result is no worse.  ``work``: plans that local search may
    measure.

    Returns the partition, and how often robots fail under it, exactly.  ``figures`` hold how often
    they fail in silence, ``least_of_all_partitions`` (whether all were tried, or nothing fails),
    and how many were measured, and counted exactly.  Raises `TooManyToCount` if not even silence
    can be counted.
    """
    # There are no more words than states: of any larger number the answer is the same.
    search = _Search(job, min(words, len(job.states)), worst)
    stopped = run_until_stopped(lambda: search.run(start, work))
    if stopped is not None:
        with suppress(TooManyToCount, OutOfTime, KeyboardInterrupt), little_time_after(stopped):
            search.settle()
    return search.outcome(stopped), search.failures


class _Search(LocalSearch):
    """The best partition that was counted exactly."""

    def __init__(self, job: Job, words: int, worst: bool) -> None:
        super().__init__(job, words)
        self._worst = worst
        self.norm = _NORM if worst else 1
        self._measured = self._counted = 0
        self._is_best = words == 1
        #: The best partition measured since the last one was counted, with its value.
        self._candidate: tuple[tuple[float, float], Ints] | None = None
        job.progress("counting how often robots fail in silence")
        silence = job.word({})
        self._silence = self._count(silence)
        self._take(silence, self._silence)

    def outcome(self, stopped: BaseException | None) -> Outcome:
        figures = {
            "silence_mean": float(self._silence.mean),
            "silence_worst": float(self._silence.worst),
            "partitions_measured": self._measured,
            "partitions_recounted": self._counted,
            "least_of_all_partitions": self._is_best or not self.failures.worst,
        }
        partition = self._job.partition(self.best_word)
        return Outcome(partition, self._job.lower_bound, figures, stopped)

    def run(self, start: Assignment | None, work: int) -> None:
        """A language, if there is one; else all partitions, or local search."""
        job = self._job
        if start is not None:
            self._candidate = (0.0, 0.0), job.word(start)
        if self.settle() or self._is_best:
            return
        language = self._coarsest_language()
        if language is not None and word_count(language) <= self._words:
            self._take(job.word(language), FailureProbability(Fraction(0), Fraction(0)))
            return
        spaces, states = job.candidates.spaces, len(job.candidates.rows)
        self.table = PlanTable(spaces, states, job.seed, mixtures=True)
        if self.table.is_complete and partition_count(len(job.states), self._words) <= _ALL:
            self._try_all()
        else:
            self._search_locally(start or language, work)

    def _coarsest_language(self) -> Assignment | None:
        """The language with the fewest words that is found with some effort."""
        if self._job.incumbent is None:
            return None
        with closing(MinimalSearch(self._job)) as search:
            search.merge()
            if search.upper > self._words:
                search.decide(self._words, Budget())
            return search.best

    def _try_all(self) -> None:
        states = self._job.states
        for size in range(1, self._words + 1):
            for chosen in partitions(len(states), size):
                self._look_at(self._job.word(dict(zip(states, chosen, strict=True))))
                if self._measured % 1_000 == 0:
                    self._job.progress(f"trying all partitions: {self._measured:,} so far")
        self.settle()
        self._is_best = True

    def _search_locally(self, begin: Assignment | None, work: int) -> None:
        """Begin with a partition made of ``begin``, or of single states, by merging words."""
        job = self._job
        begin = begin or {state: state for state in job.states}
        into = {word: n for n, word in enumerate(sorted(set(begin.values())))}
        if len(into) > self._words:
            into = {word: self._random.randrange(self._words) for word in into}
        word = job.word({state: into[begin[state]] for state in job.states})
        self._look_at(word)
        self.anneal(word, symmetry_group(job.candidates).permutations, work)

    def _look_at(self, word: Ints) -> None:
        self.offer(word, self.values(word, np.arange(len(self.table))))

    def values(self, word: Ints, tasks: Ints) -> Floats:
        """How often robots fail in some tasks."""
        self._measured += 1
        return self.table.failures(word, tasks)

    def offer(self, word: Ints, values: Floats) -> None:
        """Keep a partition for an exact count if it is the best one."""
        found = round(float(values.sum()), _DIGITS), round(float(values.max(initial=0)), _DIGITS)
        rank = found[::-1] if self._worst else found
        if self._candidate is None or rank < self._candidate[0]:
            self._candidate = rank, word

    def settle(self) -> bool:
        """Count the best partition exactly; keep it if it is better; whether nothing fails."""
        if self._candidate is not None:
            word = self._candidate[1]
            found = self._count(word)
            if self._order(found) < self._order(self.failures):
                self._take(word, found)
            self._candidate = None  # not before: counting may be stopped
        return not self.failures.worst

    def _count(self, word: Ints) -> FailureProbability:
        self._counted += 1
        return failure_probability(self._job.candidates.spaces, self._job.of_nodes(word))

    def _take(self, word: Ints, failures: FailureProbability) -> None:
        self.best_word, self.failures = word, failures
        self.best = float(self._order(failures)[0])

    def _order(self, found: FailureProbability) -> tuple[Fraction, Fraction]:
        """What is minimised: the mean, then the worst task; or the other way round."""
        return (found.worst, found.mean) if self._worst else found


def partition_count(states: int, words: int) -> int:
    """How many partitions of some states into at most so many words there are."""
    into = [1, *(0 for _ in range(words))]  # by how many words
    for _ in range(states):
        into = [0, *(n * into[n] + into[n - 1] for n in range(1, words + 1))]
    return sum(into)
