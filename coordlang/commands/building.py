# SPDX-License-Identifier: GPL-3.0-or-later
"""Candidate tasks -> a verified language: the steps of the mission in their order."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from time import perf_counter
from typing import Literal, cast

from coordlang.explanation.simple import simple
from coordlang.language.candidates import Candidates, require_solvable
from coordlang.language.partition import Partition
from coordlang.language.provenance import Guarantee, provenance_of
from coordlang.language.warping import Clause
from coordlang.language.words import Language
from coordlang.required.all_differences import differences
from coordlang.required.divergences import FirstDifferences
from coordlang.required.failures import NONE, Failures
from coordlang.verification.by_definition import Verdict
from coordlang.verification.candidates import verify_candidates
from coordlang.verification.certificate_file import Certificate
from coordlang.verification.make_certificate import certify
from coordlang.vocabulary import EXACT, METHODS, Job, Outcome, greedy
from coordlang.vocabulary.flexible import flexible
from coordlang.vocabulary.hidden_slack import hidden_differences
from coordlang.vocabulary.job import Assignment, Evidence
from coordlang.vocabulary.minimal import refuting_clauses
from planners.parallel.workers import Workers
from planners.search.portions import require_room
from planners.system.errors import UsageError
from planners.system.limits import little_time_after, run_until_stopped, start_clock, time_left
from planners.system.messages import echoed
from planners.system.options import option

#: How words are found: a key of `coordlang.vocabulary.METHODS`.
Method = Literal["greedy", "separating", "minimal", "exhaustive"]
#: What the language should be like, of those with the fewest words, by the value of ``--prefer``.
BuildPreference = Literal["flexible", "simple"]
PREFERENCES: Mapping[BuildPreference, Callable[[Job, Outcome], Outcome]] = {
    "flexible": flexible,
    "simple": simple,
}


@dataclass(frozen=True, slots=True)
class Built:
    """A verified language and the figures of its making.

    ``figures`` are the method's own (rounds, clauses, ..), ``seconds`` are by phase.  ``stopped``
    is the error that ended the method before its proof was complete, or None.  ``failures`` says
    how often robots miscoordinate under the words: never under a verified language.  ``job`` and
    ``evidence``, clauses that prove the lower bound, are what `certificate_of` needs.
    """

    language: Language
    first_differences: FirstDifferences
    states: int
    verdict: Verdict
    figures: Mapping[str, float]
    seconds: dict[str, float]
    stopped: BaseException | None
    job: Job
    evidence: Mapping[Clause, Evidence]
    failures: Failures = NONE


@dataclass(frozen=True, slots=True)
class MethodOptions:
    """How the words of a language are found.

    Raises `UsageError` for a value that there is not, or one that the method does not support.
    """

    method: Method = option(
        "greedy",
        "greedy: fast.  separating: fewest words that part plans where they differ first or last.  "
        "minimal: fewest words at all, with proof.  exhaustive: brute force.",
    )
    seed: int = option(0, "Seed of all random choices.", least=0)
    alpha_only: bool = option(
        False, "separating: part plans where they differ first, never where last."
    )
    prefer: BuildPreference | None = option(
        None,
        "Of the languages with the fewest words (--method minimal or exhaustive) one whose ..  "
        "flexible: sentences leave many plans open.  simple: words have short formulas.",
    )

    def __post_init__(self) -> None:
        if self.method not in METHODS:
            raise UsageError(
                f"there is no method {echoed(self.method)}",
                remedy=f"Methods are {', '.join(METHODS)}.",
            )
        if self.alpha_only and self.method != "separating":
            raise UsageError(
                "--alpha-only belongs to --method separating",
                remedy="Add --method separating, or leave out --alpha-only.",
            )
        if self.prefer is not None and self.prefer not in PREFERENCES:
            raise UsageError(
                f"there is no preference {echoed(self.prefer)}",
                remedy=f"--prefer takes {', '.join(PREFERENCES)}.",
            )
        if self.prefer and not self.is_exact:
            raise UsageError(
                f"--prefer {self.prefer} belongs to --method minimal or exhaustive",
                remedy="Add --method minimal, or leave out --prefer.",
            )

    @property
    def is_exact(self) -> bool:
        """Whether the method finds the least number of words."""
        return self.method in EXACT


def build_language(
    candidates: Candidates,
    method: str = "greedy",
    *,
    seed: int = 0,
    alpha_only: bool = False,
    prefer: BuildPreference | None = None,
    reserve: float = 0.0,
    progress: Callable[[str], None] = lambda _: None,
    workers: Workers | None = None,
) -> Built:
    """Build a coordination language for candidate tasks and verify it by definition.

    Parameters
    ----------
    candidates
        The tasks that it must serve.
    method, seed, alpha_only, prefer
        See `MethodOptions`.
    reserve
        Share of a time limit's rest that a search, once there is a language, leaves for
        `certificate_of`.
    progress
        Called with a line of text now and then.
    workers
        Who does jobs; None: this process.  The language does not depend on it.

    Raises
    ------
    Inseparable
        There is no language over states; the error has two plans that show it.
    ProvedImpossible
        There is no candidate task.
    OutOfMemory
        Before the memory limit is reached, where there is no language yet to return.
    UsageError
        The options contradict each other.
    """
    options = MethodOptions(cast(Method, method), seed, alpha_only, prefer)
    require_solvable(candidates)
    workers = workers or Workers()
    clock = Clock()
    hidden = candidates.model.hides_slack
    if hidden and not options.is_exact:
        raise UsageError(
            f"--method {method} parts plans where their states first differ, and with slack they "
            "may differ in where they wait",
            remedy="Add --words-see-slack, by which states say how much is left, or --method "
            "minimal.",
        )
    found = (hidden_differences if hidden else differences)(candidates, workers, progress)
    clock.note("coordination")
    states = tuple(found.states.tolist())
    verified: list[_Verified] = []
    job = Job(
        candidates,
        states,
        found.first,
        seed=seed,
        alpha_only=alpha_only,
        progress=progress,
        check=lambda assignment: verified.append(
            _verified(candidates, assignment, workers, progress)
        ),
        workers=workers,
    )
    if method != "greedy":
        require_room(candidates.source)
        job = _with_incumbent(job)
        clock.note("incumbent")
        if reserve:
            start_clock((1 - reserve) * time_left())
    progress(f"building words ({method})")
    outcome = _outcome(job, options, verified, clock)
    best = next(known for known in verified if known.assignment is outcome.partition)
    clock.note("verify")
    guarantee = Guarantee.of(method, len(best.partition.words), outcome.lower_bound)
    provenance = provenance_of(candidates, guarantee, {"program": "coordlang"})
    return Built(
        language=Language.of(best.partition, candidates.model, provenance),
        first_differences=found.first,
        states=len(states),
        verdict=best.verdict,
        figures=outcome.figures,
        seconds=clock.seconds,
        stopped=outcome.stopped,
        job=job,
        evidence=outcome.refuting,
    )


def _with_incumbent(job: Job) -> Job:
    """Verify a greedy partition, which is what is left when an anytime method is stopped.

    It is verified now because there is no time then.  Where states hide slack it has a word for
    each state: no plans are inseparable.
    """
    if job.candidates.model.hides_slack:
        first: Assignment = {state: word for word, state in enumerate(job.states)}
    else:
        first = greedy(job).partition
    job.check(first)
    return replace(job, incumbent=first)


def _outcome(
    job: Job, options: MethodOptions, verified: Sequence[_Verified], clock: Clock
) -> Outcome:
    """What the method finds; if it is stopped early, the last partition that was verified."""
    found: list[Outcome] = []

    def run() -> None:
        outcome = METHODS[options.method](job)
        clock.note("vocabulary")
        if options.prefer and outcome.stopped is None:
            outcome = PREFERENCES[options.prefer](job, outcome)
            clock.note(options.prefer)
        if not any(known.assignment is outcome.partition for known in verified):
            job.progress("verifying by definition")
            with little_time_after(outcome.stopped):
                job.check(outcome.partition)
        found.append(outcome)

    stopped = run_until_stopped(run)
    if stopped is None:
        return found[0]
    if not verified:
        raise stopped
    return Outcome(verified[-1].assignment, job.lower_bound, stopped=stopped)


def certificate_of(built: Built) -> Certificate:
    """Why no partition with fewer words than the proved lower bound is a language.

    For others to check.  The bound is proved also where the search for fewer words was stopped.

    Uses what the method met on its way; for a method that meets nothing the search of `minimal`
    finds reasons.  As long as that takes: not anytime.
    """
    refuted = built.language.guarantee.lower_bound - 1
    evidence = built.evidence or (refuting_clauses(built.job, refuted) if refuted else {})
    return certify(built.job.candidates, evidence, refuted)


@dataclass(frozen=True, slots=True)
class _Verified:
    """What a method returned, as a partition, and the verdict that it is a language."""

    assignment: Assignment
    partition: Partition
    verdict: Verdict


def _verified(
    candidates: Candidates,
    assignment: Assignment,
    workers: Workers,
    progress: Callable[[str], None],
) -> _Verified:
    partition = Partition.of_states(candidates.rows, assignment)
    verdict = verify_candidates(partition, candidates, workers, progress)
    if not verdict.holds:
        raise AssertionError(
            f"a method returned what is no coordination language: {verdict.witness}"
        )
    return _Verified(assignment, partition, verdict)


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
