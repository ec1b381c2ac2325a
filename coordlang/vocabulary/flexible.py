# SPDX-License-Identifier: GPL-3.0-or-later
"""Among languages with equally many words, one whose sentences leave many plans open.

Maximises the average of E = sum_s n_s^2 / N over the candidate tasks
(`coordlang.language.flexibility`) by local search (`coordlang.vocabulary.local_search`), with
necessary clauses as constraints.  A partition without counterexample is verified by definition
before it counts.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from random import Random

import numpy as np

from coordlang.language.flexibility import Flexibility, Floats, flexibility
from coordlang.language.warping import Clause
from coordlang.required.plan_table import PlanTable, plan_table
from coordlang.vocabulary.flexibility_bound import flexibility_bounds
from coordlang.vocabulary.job import Assignment, Job, Outcome
from coordlang.vocabulary.local_search import WORK, LocalSearch
from coordlang.vocabulary.loop import Languages
from planners.joint.tables import Ints
from planners.system.errors import OutOfMemory
from planners.system.limits import run_until_stopped

#: Differences that are due to rounding.
_ROUNDING = 1e-9


def flexible(job: Job, found: Outcome, work: int = WORK) -> Outcome:
    """A language with as many words as ``found`` has, at least as flexible.

    Anytime: out of time or memory, or interrupted, the best verified language so far is returned,
    with the error in ``stopped``.

    Returns
    -------
    Outcome
        With the bound on the number of words that ``found`` has.  ``figures`` also hold
        ``flexibility`` (plans left open, averaged over tasks), ``flexibility_before`` (that of
        ``found``), ``flexibility_bound`` (which no language exceeds) and
        ``communication_saving``; nothing of these where there are too many sentences to measure.
    """
    search = _Search(job, found)
    stopped = run_until_stopped(lambda: search.run(work))
    return search.outcome(stopped)


class _Search:
    """``partition`` is the most flexible one that was verified; the objective of a local search."""

    norm = 1
    table: PlanTable
    clauses: Sequence[Clause]
    best: float
    best_word: Ints

    def __init__(self, job: Job, found: Outcome) -> None:
        self._job, self._found = job, found
        self.partition: Assignment = found.partition
        self._bound: float | None = None
        self._pending = False
        self._search: LocalSearch | None = None
        self._improvements = 0

    def outcome(self, stopped: BaseException | None) -> Outcome:
        """The best language, with what is known of it."""
        moves = self._search.moves if self._search else 0
        figures = {**self._found.figures, "moves": moves, "improvements": self._improvements}
        with suppress(OutOfMemory):
            figures |= self._measures()
        return replace(self._found, partition=self.partition, figures=figures, stopped=stopped)

    def _measures(self) -> dict[str, float]:
        """The flexibility before and after."""
        before, after = self._measured(self._found.partition), self._measured(self.partition)
        if after.value < before.value:  # of many plans some were measured, and misled the search
            after, self.partition = before, self._found.partition
        bound = sum(after.plans) / len(after.plans)
        if self._bound is not None:
            assert after.value <= self._bound * (1 + _ROUNDING), "no language exceeds the bound"
            bound = max(self._bound, after.value)  # in another order sums differ in last digits
        return {
            "flexibility": after.value,
            "flexibility_first_plan": float(after.first.mean()),
            "flexibility_before": before.value,
            "flexibility_bound": bound,
            "communication_saving": float(after.saving.mean()),
        }

    def run(self, work: int) -> None:
        """Search until the bound is reached, or it does not pay any more."""
        job, words = self._job, self._found.size
        spaces, states = job.candidates.spaces, len(job.candidates.rows)
        self._bound = float(flexibility_bounds(spaces).mean())
        if words < 2 or self._is_met:
            return
        self._languages = languages = self._found.languages or Languages.of(job)
        self.clauses = languages.clauses
        self.table = plan_table(spaces, states, job.seed, mixtures=False)
        self.best_word = job.word(self.partition)
        self.best = float(self.values(self.best_word, np.arange(len(self.table))).sum())
        permutations = languages.known.group.permutations
        random = Random(job.seed)
        self._search = LocalSearch(self, job.states, words, permutations, random, work)
        self._search.run(self.best_word, job.progress)

    def values(self, word: Ints, tasks: Ints) -> Floats:
        """How many plans of some tasks are not left open."""
        return self.table.plans_ruled_out(word, tasks)

    def offer(self, word: Ints, values: Floats) -> None:
        """Look for counterexamples to a partition better than the best; none: it is the best."""
        value = float(values.sum())
        if value < self.best * (1 - _ROUNDING) and self._languages.holds(self._job.partition(word)):
            self.best, self.best_word, self._pending = value, word, True

    def settle(self) -> bool:
        """Verify the best partition, if it is new; whether it reaches the bound."""
        if self._pending:
            partition = self._job.partition(self.best_word)
            self._job.check(partition)
            self.partition, self._pending = partition, False
            self._improvements += 1
        return self._is_met

    @property
    def _is_met(self) -> bool:
        assert self._bound is not None
        return self._measured(self.partition).value >= self._bound * (1 - _ROUNDING)

    def _measured(self, partition: Assignment) -> Flexibility:
        job = self._job
        return flexibility(job.candidates.spaces, job.of_nodes(job.word(partition)))
