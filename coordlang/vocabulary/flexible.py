# SPDX-License-Identifier: GPL-3.0-or-later
"""Among languages with equally many words, one whose sentences leave many plans open.

Maximises the average of E = sum_s n_s^2 / N over the candidate tasks
(`coordlang.language.flexibility`) by simulated annealing over partitions
(`coordlang.vocabulary.annealing`), with the clauses that counterexamples give
(`coordlang.language.warping`) as constraints.  A partition without counterexample is verified by
definition before it counts.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from coordlang.language.flexibility import Flexibility, Floats, flexibility
from coordlang.required.divergences import required_nodes
from coordlang.symmetry.group import symmetry_group
from coordlang.vocabulary.annealing import Annealing, AnnealingSettings, Violations
from coordlang.vocabulary.flexibility_bound import flexibility_bounds
from coordlang.vocabulary.job import Assignment, Job, Outcome
from coordlang.vocabulary.necessary_clauses import task_parts
from planners.joint.tables import Ints
from planners.system.errors import OutOfMemory
from planners.system.limits import run_until_stopped

_USUAL = AnnealingSettings()
#: The search ends where no language is more flexible by more than rounding.
_ROUNDING = 1e-9


def flexible(job: Job, found: Outcome, settings: AnnealingSettings = _USUAL) -> Outcome:
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
    search = _Search(job, found, settings)
    stopped = run_until_stopped(search.run)
    return search.outcome(stopped)


class _Search:
    """``best`` is the most flexible partition that was verified."""

    def __init__(self, job: Job, found: Outcome, settings: AnnealingSettings) -> None:
        self._job, self._found, self._settings = job, found, settings
        self.best: Assignment = found.partition
        self._bound: Floats | None = None
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
        spaces = self._job.candidates.spaces
        requires = [required_nodes(space) for space in spaces]
        self._bound = flexibility_bounds(spaces, requires)
        if self._found.size < 2:
            return
        parts = task_parts(spaces, requires, self._settings.tasks_of_a_part)
        violations = Violations(self._job.states, parts, symmetry_group(self._job.candidates))
        for clause in self._found.evidence:
            violations.add(clause)
        annealing = Annealing(
            self._job, violations, self._found.size, self._bound, self._verified, self._settings
        )
        annealing.begin(self.best)
        self._cool_as_long_as_it_pays(annealing, violations, float(self._bound.mean()))

    def _cool_as_long_as_it_pays(
        self, annealing: Annealing, violations: Violations, most: float
    ) -> None:
        settings, words = self._settings, self._found.size
        moves = max(settings.least_moves, settings.moves * len(self._job.states) * words)
        without_gain = 0
        while (
            without_gain < settings.patience
            and annealing.work < settings.work
            and annealing.best_value < most * (1 - _ROUNDING)
        ):
            before = annealing.best_value
            for share in annealing.cool(moves):
                self._moves = annealing.moves
                self._job.progress(
                    f"{words} words leave {annealing.best_value:,.2f} of at most {most:,.2f} plans "
                    f"open: cooling {100 * share:.0f} %, {annealing.moves:,} moves, "
                    f"{len(violations):,} clauses"
                )
            if annealing.best_value > settings.better * before:
                moves, without_gain = 2 * moves, 0
            else:
                without_gain += 1

    def _verified(self, word: Ints) -> None:
        partition = {state: int(word[state]) for state in self._job.states}
        self._job.check(partition)
        self.best = partition
        self._improvements += 1


def _measured(job: Job, partition: Assignment) -> Flexibility:
    word = np.zeros(len(job.candidates.rows), np.int64)
    word[list(partition)] = list(partition.values())
    return flexibility(
        job.candidates.spaces, [word[space.state] for space in job.candidates.spaces]
    )
