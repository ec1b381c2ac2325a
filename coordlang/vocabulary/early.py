# SPDX-License-Identifier: GPL-3.0-or-later
"""Among languages with equally many words, one whose sentences differ early.

Minimises the words that must be heard until a task's sentence is known
(`coordlang.language.lateness`), averaged over the candidate tasks.  Where there are few languages
with so many words, all are measured: exact.  Else partitions are annealed, as for flexibility, from
the flexible language on.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass, field, replace

import numpy as np

from coordlang.language.flexibility import Floats
from coordlang.language.lateness import words_heard
from coordlang.required.divergences import required_nodes
from coordlang.vocabulary.annealing import Annealing, AnnealingSettings, Violations
from coordlang.vocabulary.candidate_languages import CandidateLanguages
from coordlang.vocabulary.clauses import most_constrained_first
from coordlang.vocabulary.earliness import Earliness, most_words
from coordlang.vocabulary.flexible import flexible
from coordlang.vocabulary.job import Assignment, Job, Outcome
from coordlang.vocabulary.sat import PartitionProblem
from planners.limits import run_until_stopped
from planners.tables import Ints

#: What is heard in vain at least where there are two sentences: nothing, and the first word.
_LEAST = 2.0
_ROUNDING = 1e-9


@dataclass(frozen=True, slots=True)
class EarlySettings:
    """How long a language with early differences is looked for.

    Attributes
    ----------
    partitions
        Partitions looked at to list all languages.
    listing
        Edges walked to list them, at most: that many partitions are looked at.
    flexible
        Where these are not all: how long a flexible language is looked for, to start from.
    annealing
        What follows.
    """

    partitions: int = 600
    listing: int = 5_000_000
    flexible: AnnealingSettings = field(default_factory=AnnealingSettings)
    annealing: AnnealingSettings = field(
        default_factory=lambda: AnnealingSettings(work=200_000_000)
    )


_USUAL = EarlySettings()


def early(job: Job, found: Outcome, settings: EarlySettings = _USUAL) -> Outcome:
    """A language with as many words as ``found`` has, whose sentences differ as early or earlier.

    Anytime: out of time or memory, or interrupted, the best verified language so far is returned,
    with the error in ``stopped``.

    Returns
    -------
    Outcome
        With the bound on the number of words that ``found`` has.  ``figures`` also hold
        ``words_heard`` (until the sentence is known, averaged over tasks), ``words_heard_before``
        (of ``found``) and ``words_heard_lower_bound``, which no language with so many words goes
        below.
    """
    search = _Search(job, found, settings)
    stopped = run_until_stopped(search.run)
    return search.outcome(stopped)


def all_languages(
    job: Job, size: int, languages: CandidateLanguages, partitions: int
) -> Iterator[dict[int, int] | None]:
    """All languages with at most so many words, up to symmetry; None follows the last of them.

    Of languages that are images of each other under a symmetry of the tasks one is listed.  Without
    None at the end, ``partitions`` were looked at, and there may be more.
    """
    order = most_constrained_first(job.states, languages.clauses)
    with closing(PartitionProblem(order, size)) as problem:
        seen = 0
        for _ in range(partitions):
            for clause in languages.clauses[seen:]:
                problem.separate_one(clause)
            seen = len(languages.clauses)
            partition = problem.solve()
            if partition is None:
                yield None
                return
            if languages.holds(partition):
                yield partition
                for image in _images(partition, order, languages.known.group.permutations):
                    problem.forbid(image)


def _images(
    partition: Assignment, order: Sequence[int], permutations: Sequence[Sequence[int]]
) -> Iterator[dict[int, int]]:
    """A partition and its images, each with words named by the first of their states in order."""
    for permutation in (None, *permutations):
        word = (
            {permutation[state]: own for state, own in partition.items()}
            if permutation
            else partition
        )
        name: dict[int, int] = {}
        yield {state: name.setdefault(word[state], len(name)) for state in order}


class _Search:
    """``best`` is the partition with the earliest differences, of ``value``, that was verified."""

    def __init__(self, job: Job, found: Outcome, settings: EarlySettings) -> None:
        self._job, self._found, self._settings = job, found, settings
        self.best: Assignment = found.partition
        spaces = job.candidates.spaces
        self._requires = np.concatenate([required_nodes(s)[s.starts] for s in spaces])
        self._steps = np.concatenate([s.layer[s.starts] for s in spaces])
        self._before = self.value = self._measured(found.partition)
        self.bound = float((_LEAST * self._requires).mean())

    def outcome(self, stopped: BaseException | None) -> Outcome:
        """The best language, with what is known of it."""
        figures = {
            **self._found.figures,
            "words_heard": self.value,
            "words_heard_before": self._before,
            "words_heard_lower_bound": self.bound,
        }
        return replace(self._found, partition=self.best, figures=figures, stopped=stopped)

    def run(self) -> None:
        """All languages, or those that annealing meets."""
        if self._is_least() or self._found.size < 2:
            return
        languages = CandidateLanguages.of(self._job, self._found.evidence)
        edges = sum(len(space.sources) for space in self._job.candidates.spaces)
        partitions = min(self._settings.partitions, self._settings.listing // (1 + edges))
        found = all_languages(self._job, self._found.size, languages, partitions)
        for number, partition in enumerate(found, 1):
            if partition is None:
                self.bound = self.value
                return
            self._job.progress(
                f"{self.value:.2f} words heard, at least {self.bound:.2f}: {number:,} languages"
            )
            self._accept_better(partition)
            if self._is_least():
                return
        self._start_flexible()
        if not self._is_least():
            self._anneal(languages)

    def _is_least(self) -> bool:
        return self.value <= self.bound + _ROUNDING

    def _measured(self, partition: Assignment) -> float:
        word = np.zeros(len(self._job.candidates.rows), np.int64)
        word[list(partition)] = list(partition.values())
        spaces = self._job.candidates.spaces
        return float(words_heard(spaces, [word[space.state] for space in spaces]).mean())

    def _accept_better(self, partition: Assignment) -> None:
        value = self._measured(partition)
        if value < self.value - _ROUNDING:
            self._job.check(partition)
            self.best, self.value = partition, value

    def _start_flexible(self) -> None:
        """A flexible language has few sentences for a task, and they often differ early."""
        found = flexible(self._job, self._found, self._settings.flexible)
        self._accept_better(found.partition)
        if found.stopped is not None:
            raise found.stopped

    def _anneal(self, languages: CandidateLanguages) -> None:
        settings, words = self._settings.annealing, self._found.size
        violations = Violations(self._job.states, languages.parts, languages.known.group)
        for clause in languages.clauses:
            violations.add(clause)
        bound: Floats = most_words(self._steps) - _LEAST * self._requires
        annealing = Annealing(
            self._job,
            violations,
            words,
            bound,
            self._verified,
            settings,
            Earliness(self._job.candidates.spaces, words),
        )
        annealing.begin(self.best)
        moves = max(settings.least_moves, settings.moves * len(self._job.states) * words)
        without_gain = 0
        while without_gain < settings.patience and not self._is_least():
            before = self.value
            for share in annealing.cool(moves):
                self._job.progress(
                    f"{self.value:.2f} words heard, at least {self.bound:.2f}: "
                    f"cooling {100 * share:.0f} %, {annealing.moves:,} moves"
                )
                if annealing.work > settings.work:
                    return
            without_gain = 0 if self.value < before - _ROUNDING else without_gain + 1

    def _verified(self, word: Ints) -> None:
        self._accept_better({state: int(word[state]) for state in self._job.states})
