# SPDX-License-Identifier: GPL-3.0-or-later
"""A language that was made: what is known of it, and how it was verified on the way."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from math import inf
from time import perf_counter
from typing import TYPE_CHECKING, Any

from coordlang.language.candidates import Candidates
from coordlang.language.partition import Partition
from coordlang.language.provenance import Guarantee, provenance_of
from coordlang.language.tolerance import Tolerance
from coordlang.language.warping import Clause
from coordlang.language.words import Language
from coordlang.required.divergences import FirstDifferences
from coordlang.required.failures import NONE, Failures
from coordlang.verification.by_definition import Verdict
from coordlang.verification.candidates import verify_candidates
from coordlang.verification.certificate_file import Certificate
from coordlang.verification.check_certificate import check as check_certificate
from coordlang.verification.make_certificate import certify
from coordlang.vocabulary import EXACT, Job
from coordlang.vocabulary.job import Assignment, Evidence
from coordlang.vocabulary.minimal import refuting_clauses
from planners.parallel.workers import Workers
from planners.system.errors import Refuted
from planners.system.notebook import Presented

if TYPE_CHECKING:
    from coordlang.commands.repairing import Repaired
    from coordlang.vocabulary.few_words import FewWords


@dataclass(frozen=True, slots=True, repr=False)
class Built(Presented):
    """A language, verified by definition, and how it was made.

    With a limit on the words it may be none: ``failures`` says how often robots then fail, and
    ``few_words`` how it was found.

    Attributes
    ----------
    language
        With what is proved of its number of words.
    job
        What words were looked for.
    verdict
        That it is a coordination language.
    figures, seconds
        The method's own figures (rounds, clauses, ..), and the time by phase.
    stopped
        The error that ended the method before its proof was complete, or None.
    refuting
        Clauses by which the lower bound was proved, for `certificate`.
    failures
        How often robots that choose by themselves under the words fail; never, if verified.
    repaired
        What became of the language that it started from; None without one.
    few_words
        How a limited number of words was found; None without a limit.
    fewest
        How many tasks would require coordination if only plans with the fewest actions counted;
        None if it is not known.
    deadline
        When the time limit ends, on the clock `time.monotonic`.
    """

    language: Language
    job: Job
    verdict: Verdict
    figures: Mapping[str, float]
    seconds: Mapping[str, float]
    stopped: BaseException | None = None
    refuting: Mapping[Clause, Evidence] = field(default_factory=dict)
    failures: Failures = NONE
    repaired: Repaired | None = None
    few_words: FewWords | None = None
    fewest: int | None = None
    deadline: float = inf

    @property
    def candidates(self) -> Candidates:
        """The candidate tasks."""
        return self.job.candidates

    @property
    def guarantee(self) -> Guarantee:
        """The number of words, and the proved lower bound on it."""
        return self.language.guarantee

    @property
    def is_exact(self) -> bool:
        """Whether the method finds the least number of words, if it comes to its end."""
        return self.guarantee.method in EXACT

    @property
    def tasks(self) -> int:
        """The number of candidate tasks."""
        return self.candidates.count

    @property
    def skipped(self) -> tuple[str, ...]:
        """Candidate tasks that were left out because they have no plan."""
        return self.candidates.skipped

    @property
    def first_differences(self) -> FirstDifferences:
        """Where coordination is required."""
        return self.job.first_differences

    def facts(self) -> Mapping[str, object]:
        """What the method found, and how long that took."""
        return {
            "words": self.guarantee.size,
            "lower_bound": self.guarantee.lower_bound,
            "method": self.guarantee.method,
            "tasks": self.tasks,
            "seconds": round(sum(self.seconds.values()), 3),
        }

    def certificate(self) -> Certificate:
        """Why no partition with fewer words than the proved lower bound is a language.

        For others to check; it is checked here, too.  Also of a search that was ``stopped``.  Uses
        what the method met on its way; for a method that meets nothing the search of `minimal`
        finds reasons, as long as that takes.

        Raises
        ------
        AssertionError
            If it does not prove the bound: a solver has erred.
        """
        refuted = self.guarantee.lower_bound - 1
        evidence = self.refuting or (refuting_clauses(self.job, refuted) if refuted else {})
        proof = certify(self.candidates, evidence, refuted)
        try:
            check_certificate(proof, self.candidates)
        except Refuted as error:
            raise AssertionError(f"the lower bound is not proved: {error.what}") from None
        return proof

    def data(self) -> dict[str, Any]:
        """The figures of the making as JSON data."""
        first, guarantee = self.first_differences, self.guarantee
        more: dict[str, Any] = {}
        if self.repaired is not None:
            more["repair"] = self.repaired.data()
        if self.fewest not in (None, first.requiring):
            more["tasks_requiring_coordination_with_fewest_actions"] = self.fewest
        return {
            "tasks": self.tasks,
            "states": self.candidates.states,
            "states_on_plans": len(self.job.states),
            "tasks_requiring_coordination": first.requiring,
            "divergences": len(first.divergences),
            "words": guarantee.size,
            "lower_bound": guarantee.lower_bound,
            "method": guarantee.method,
            "walk_nodes": first.nodes,
            "walk_edges": first.edges,
            "label_sets": first.sets,
            "mixtures": first.evaluations,
            "verify_nodes": self.verdict.nodes,
            "verified": self.verdict.holds,
            **self.failures.data(),
            "proved_minimal": guarantee.proved_minimal,
            **self.figures,
            **more,
            "seconds": {name: round(value, 3) for name, value in self.seconds.items()},
        }


def language_of(
    partition: Partition,
    job: Job,
    method: str,
    lower_bound: int,
    *,
    holds: bool = True,
    failures: Failures = NONE,
) -> Language:
    """The language of words that were found, with what is proved of it."""
    guarantee = Guarantee.of(method, len(partition.words), lower_bound, holds)
    provenance = provenance_of(job.candidates, guarantee, {"program": "coordlang"})
    if not holds:
        slack = provenance.tolerance.slack if provenance.tolerance else None
        tolerance = failures.tolerance or Tolerance()
        provenance = replace(provenance, tolerance=replace(tolerance, slack=slack))
    return Language.of(partition, job.candidates.model, provenance)


class Verified:
    """Verifies partitions of candidate tasks' states by definition, and knows those that hold."""

    def __init__(
        self,
        candidates: Candidates,
        workers: Workers,
        progress: Callable[[str], None],
        made: Callable[[Assignment], Partition] | None = None,
    ) -> None:
        self._candidates, self._workers, self._progress = candidates, workers, progress
        self._made = made or (lambda words: Partition.of_states(candidates.rows, words))
        self._known: list[tuple[Assignment, Partition, Verdict]] = []

    @property
    def last(self) -> Assignment | None:
        """The one that was verified last; None before there is one."""
        return self._known[-1][0] if self._known else None

    def check(self, words: Assignment) -> None:
        """Verify a partition; `AssertionError` if it is no language: a method has erred."""
        partition = self._made(words)
        verdict = verify_candidates(partition, self._candidates, self._workers, self._progress)
        if not verdict.holds:
            raise AssertionError(
                f"a method returned what is no coordination language: {verdict.witness}"
            )
        self._known.append((words, partition, verdict))

    def knows(self, words: Assignment) -> bool:
        """Whether this very partition was verified."""
        return any(known is words for known, _, _ in self._known)

    def of(self, words: Assignment) -> tuple[Partition, Verdict]:
        """A partition that was verified, and the verdict."""
        return next((partition, v) for known, partition, v in self._known if known is words)


class Clock:
    """Seconds by phase."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self._since = perf_counter()

    def note(self, phase: str) -> None:
        """Say that a phase has ended."""
        now = perf_counter()
        self.seconds[phase] = now - self._since
        self._since = now
