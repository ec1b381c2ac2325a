# SPDX-License-Identifier: GPL-3.0-or-later
"""Among languages with equally many words, one whose sentences leave many plans open.

Maximises the average of E = sum_s n_s^2 / N over the candidate tasks
(`coordlang.language.flexibility`) by local search (`coordlang.vocabulary.annealing`), with
necessary clauses as constraints.  A partition without counterexample is verified by definition
before it counts.
"""

from __future__ import annotations

from dataclasses import replace
from random import Random

import numpy as np

from coordlang.language.flexibility import Flexibility, Floats, flexibility
from coordlang.required.plan_table import plan_table
from coordlang.vocabulary.annealing import Annealing, AnnealingSettings, Constraints, Measure
from coordlang.vocabulary.flexibility_bound import flexibility_bounds
from coordlang.vocabulary.job import Assignment, Job, Outcome
from coordlang.vocabulary.loop import Languages
from planners.joint.tables import Ints
from planners.system.errors import OutOfMemory
from planners.system.limits import run_until_stopped

#: The search ends where no language is more flexible by more than rounding.
_ROUNDING = 1e-9
#: Tasks of which a table has plans; of more some are drawn.
_TASKS = 3_000


def flexible(job: Job, found: Outcome, settings: AnnealingSettings | None = None) -> Outcome:
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
    search = _Search(job, found, settings or AnnealingSettings())
    stopped = run_until_stopped(search.run)
    return search.outcome(stopped)


class _Search:
    """``best`` is the most flexible partition that was verified."""

    def __init__(self, job: Job, found: Outcome, settings: AnnealingSettings) -> None:
        self._job, self._found, self._settings = job, found, settings
        self._languages = found.languages
        self._constraints = Constraints()
        self.best: Assignment = found.partition
        self._bound: Floats | None = None
        self._least = 0.0
        self._pending: Ints | None = None
        self._moves = self._improvements = 0

    def outcome(self, stopped: BaseException | None) -> Outcome:
        """The best language, with what is known of it."""
        figures = {
            **self._found.figures,
            "moves": self._moves,
            "improvements": self._improvements,
            **self._measures(),
        }
        return replace(self._found, partition=self.best, figures=figures, stopped=stopped)

    def _measures(self) -> dict[str, float]:
        """The flexibility before and after; nothing where it takes too much memory."""
        try:
            before, after = (
                _measured(self._job, partition) for partition in (self._found.partition, self.best)
            )
        except OutOfMemory:
            return {}
        if after.value < before.value:  # of many plans some were measured, and misled the search
            after, self.best = before, self._found.partition
        bound = sum(after.plans) / len(after.plans)
        if self._bound is not None:
            bound = float(self._bound.mean())
            assert after.value <= bound * (1 + _ROUNDING), "no language exceeds the bound"
            bound = max(bound, after.value)  # sums in another order differ in their last digits
        return {
            "flexibility": after.value,
            "flexibility_first_plan": float(after.first.mean()),
            "flexibility_before": before.value,
            "flexibility_bound": bound,
            "communication_saving": float(after.saving.mean()),
        }

    def run(self) -> None:
        """Anneal until the bound is reached, or it does not pay any more."""
        job, words = self._job, self._found.size
        spaces = job.candidates.spaces
        self._bound = flexibility_bounds(spaces)
        if words < 2 or _is_met(self._bound, _measured(job, self.best)):
            return
        self._languages = languages = self._languages or Languages.of(job)
        self._constraints.add(languages.clauses)
        table = plan_table(
            spaces, len(job.candidates.rows), most_tasks=_TASKS, seed=job.seed, mixtures=False
        )
        measure = Measure(
            table,
            table.plans_left_open,
            lambda values: -float(values.mean()),
            -float(table.count.mean()),
        )
        annealing = Annealing(
            job.states,
            words,
            measure,
            self._offer,
            Random(job.seed),
            constraints=self._constraints,
            permutations=languages.known.group.permutations,
            settings=self._settings,
        )
        annealing.begin(languages.word(self.best))
        self._least = annealing.energy
        for _ in annealing.search(lambda: self._least, self._report):
            self._moves = annealing.moves
            self._verify_pending()
            if _is_met(self._bound, _measured(job, self.best)):
                return
            annealing.begin(languages.word(self.best))

    def _offer(self, word: Ints, _: Floats, energy: float) -> None:
        """Look for counterexamples to a partition better than the best; none: it is the best."""
        if energy >= self._least - _ROUNDING * abs(self._least):
            return
        languages = self._languages
        assert languages is not None
        known = len(languages.clauses)
        if languages.holds({state: int(word[state]) for state in self._job.states}):
            self._least, self._pending = energy, word.copy()
        else:
            self._constraints.add(languages.clauses[known:])

    def _verify_pending(self) -> None:
        if self._pending is not None:
            partition = {state: int(self._pending[state]) for state in self._job.states}
            self._job.check(partition)
            self.best, self._pending = partition, None
            self._improvements += 1

    def _report(self, what: str) -> None:
        self._job.progress(
            f"{self._found.size} words leave {-self._least:,.2f} plans open: {what}, "
            f"{len(self._constraints):,} clauses"
        )


def _is_met(bound: Floats, measured: Flexibility) -> bool:
    return measured.value >= float(bound.mean()) * (1 - _ROUNDING)


def _measured(job: Job, partition: Assignment) -> Flexibility:
    word = np.zeros(len(job.candidates.rows), np.int64)
    word[list(partition)] = list(partition.values())
    spaces = job.candidates.spaces
    return flexibility(spaces, [word[space.state] for space in spaces])
