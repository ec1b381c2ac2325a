# SPDX-License-Identifier: GPL-3.0-or-later
"""Candidate tasks -> a verified language: the steps of the mission in their order."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from time import perf_counter
from typing import Any

from coordlang.commands.built import Built
from coordlang.commands.options import BuildPreference, MethodOptions
from coordlang.explanation.simple import simple
from coordlang.language.candidates import Candidates, require_solvable
from coordlang.language.partition import Partition
from coordlang.language.provenance import Guarantee, provenance_of
from coordlang.language.tolerance import Tolerance
from coordlang.language.words import Language
from coordlang.required.divergences import (
    FirstDifferences,
    differences,
    states_on_plans,
    without_divergences,
)
from coordlang.required.failure import Failures
from coordlang.required.miscoordination import Inseparable
from coordlang.verification.by_definition import Verdict, verify_candidates
from coordlang.vocabulary import METHODS, Job, Outcome
from coordlang.vocabulary.few_words import few_words
from coordlang.vocabulary.flexible import flexible
from coordlang.vocabulary.greedy import first_language
from coordlang.vocabulary.hidden_slack import hidden_differences
from coordlang.vocabulary.job import Assignment
from planners.parallel.workers import Workers
from planners.search.portions import require_room
from planners.system.errors import OutOfMemory, UsageError
from planners.system.limits import little_time_after, run_until_stopped, start_clock, time_left
from planners.system.options import record_from

PREFERENCES: Mapping[BuildPreference, Callable[[Job, Outcome], Outcome]] = {
    "flexible": flexible,
    "simple": simple,
}
#: What a file says of how a limited number of words was found.
FEW_WORDS = "few-words"


class Making:
    """Candidate tasks on their way to a language: who works, the time by phase, what is verified.

    ``progress`` is called with a line of text now and then, ``partition_of`` makes a partition of
    what a method finds, ``verified`` are the partitions that were verified, with the verdict.
    Raises `ProvedImpossible` if there is no candidate task.
    """

    def __init__(
        self,
        candidates: Candidates,
        workers: Workers | None = None,
        progress: Callable[[str], None] = lambda _: None,
    ) -> None:
        require_solvable(candidates)
        self.candidates, self.workers, self.progress = candidates, workers or Workers(), progress
        self.seconds: dict[str, float] = {}
        self.partition_of: Callable[[Assignment], Partition] = partial(
            Partition.of_states, candidates.rows
        )
        self.verified: list[tuple[Assignment, Partition, Verdict]] = []
        self._since = perf_counter()

    def note(self, phase: str) -> None:
        """Say that a phase has ended."""
        now = perf_counter()
        self.seconds[phase] = now - self._since
        self._since = now

    def differences(self) -> FirstDifferences:
        """Where coordination is required; `Inseparable` if there is no language over states."""
        find = hidden_differences if self.candidates.model.hides_slack else differences
        return find(self.candidates, self.workers, self.progress)

    def job(self, found: FirstDifferences, options: MethodOptions) -> Job:
        """What words are to be found, for plans that part like that."""
        return Job(
            self.candidates,
            tuple(found.states.tolist()),
            found,
            seed=options.seed,
            alpha_only=options.alpha_only,
            effort=options.effort,
            progress=self.progress,
            check=self.check,
            workers=self.workers,
        )

    def verdict(self, partition: Partition) -> Verdict:
        """Whether a partition is a coordination language, by definition."""
        return verify_candidates(partition, self.candidates, self.workers, self.progress)

    def check(self, words: Assignment) -> None:
        """Verify what a method found; `AssertionError` if it is no language: it has erred."""
        partition = self.partition_of(words)
        verdict = self.verdict(partition)
        if not verdict.holds:
            raise AssertionError(
                f"a method returned what is no coordination language: {verdict.witness}"
            )
        self.verified.append((words, partition, verdict))

    def known(self, words: Assignment) -> tuple[Partition, Verdict] | None:
        """The partition and the verdict, if this very assignment was verified."""
        return next(((own, verdict) for w, own, verdict in self.verified if w is words), None)

    def built(
        self,
        job: Job,
        found: tuple[Partition, Verdict] | None,
        method: str,
        lower_bound: int,
        **more: Any,
    ) -> Built:
        """The language of words that were found, with what is proved of it; ``more`` of `Built`."""
        assert found is not None, "it was verified"
        partition, verdict = found
        guarantee = Guarantee.of(method, len(partition.words), lower_bound, verdict.holds)
        provenance = provenance_of(self.candidates, guarantee, {"program": "coordlang"})
        if not verdict.holds:
            slack = provenance.tolerance.slack if provenance.tolerance else None
            tolerance = more["failures"].tolerance or Tolerance()
            provenance = replace(provenance, tolerance=replace(tolerance, slack=slack))
        language = Language.of(partition, self.candidates.model, provenance)
        return Built(language, job, verdict, seconds=self.seconds, **more)


def build_language(
    candidates: Candidates,
    method: str = "best",
    *,
    reserve: float = 0.0,
    progress: Callable[[str], None] = lambda _: None,
    workers: Workers | None = None,
    **way: object,
) -> Built:
    """Build a coordination language for candidate tasks and verify it by definition.

    Parameters
    ----------
    candidates
        The tasks that it must serve.
    method, way
        See `MethodOptions`.
    reserve
        Share of a time limit's rest that a search, once there is a language, leaves for
        `Built.certificate`.
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
    options = record_from(MethodOptions, {"method": method, **way}, "build_language")
    making = Making(candidates, workers, progress)
    if candidates.model.hides_slack and method in ("greedy", "separating"):
        raise UsageError(
            f"--method {method} parts plans where their states first differ, and with slack they "
            "may differ in where they wait",
            remedy="Add --words-see-slack, by which states say how much is left, or --method "
            "minimal.",
        )
    found = making.differences()
    making.note("coordination")
    job = making.job(found, options)
    if method != "greedy":
        job = _within_room(job, method)
        # It is verified now, for there is no time when an anytime method is stopped.
        job = replace(job, incumbent=first_language(job))
        making.check(job.incumbent or {})
        making.note("incumbent")
        if reserve:
            start_clock((1 - reserve) * time_left())
    progress(f"building words ({method})")
    outcome = _outcome(job, options, making)
    making.note("verify")
    return making.built(
        job,
        making.known(outcome.partition),
        method,
        outcome.lower_bound,
        figures=outcome.figures,
        stopped=outcome.stopped,
        refuting=outcome.refuting,
    )


def build_few_words(
    candidates: Candidates,
    words: int,
    *,
    worst: bool = False,
    seed: int = 0,
    progress: Callable[[str], None] = lambda _: None,
    workers: Workers | None = None,
) -> Built:
    """Find words, at most so many, under which robots that choose by themselves fail least often.

    Where they never do, the words are verified by definition, as every coordination language.
    Plans of the tasks may be inseparable; one word is silence.  With ``worst`` it counts how often
    robots fail in the worst task, not over all tasks.  Arguments and errors are as in
    `build_language`, and `TooManyToCount` where not even failures in silence can be counted.
    """
    making = Making(candidates, workers, progress)
    require_room(candidates.source)
    job = job_for_few_words(making, seed)
    making.note("coordination")
    found = few_words(job, words, worst=worst)
    making.note("vocabulary")
    stopped = found.stopped
    unverified = making.partition_of(found.partition), Verdict(False, candidates.count, 0, None)
    if not found.failures.worst:
        with little_time_after(stopped):
            making.check(found.partition)
        if not isinstance(stopped, KeyboardInterrupt):
            stopped = None  # no search was left where nothing fails
    making.note("verify")
    figures = {
        "silence_mean": float(found.silence.mean),
        "silence_worst": float(found.silence.worst),
        "partitions_measured": found.measured,
        "partitions_recounted": found.recounted,
        "least_of_all_partitions": found.is_best,
    }
    return making.built(
        job,
        making.known(found.partition) or unverified,
        FEW_WORDS,
        job.lower_bound,
        figures=figures,
        stopped=stopped,
        failures=Failures(found.failures.mean, found.failures.worst),
        few_words=found,
    )


def job_for_few_words(making: Making, seed: int = 0) -> Job:
    """What words are looked for, with a language as the incumbent if there is one.

    Where plans are inseparable there is none, and divergences are not defined; nor are they where
    states hide slack.
    """
    spaces = making.candidates.spaces
    try:
        found = making.differences()
    except Inseparable:
        job = making.job(without_divergences(spaces), MethodOptions(seed=seed))
        return replace(job, states=tuple(states_on_plans(spaces).tolist()))
    job = making.job(found, MethodOptions(seed=seed))
    return replace(job, incumbent=first_language(job))


def _within_room(job: Job, method: str) -> Job:
    """Without effort if the plans of all tasks do not fit; other methods raise `OutOfMemory`."""
    try:
        require_room(job.candidates.source)
    except OutOfMemory:
        if method != "best":
            raise
        return replace(job, effort=0)
    return job


def _outcome(job: Job, options: MethodOptions, making: Making) -> Outcome:
    """What the method finds; if it is stopped early, the last partition that was verified."""
    found: list[Outcome] = []

    def run() -> None:
        outcome = METHODS[options.method](job)
        making.note("vocabulary")
        if options.prefer and outcome.stopped is None:
            outcome = PREFERENCES[options.prefer](job, outcome)
            making.note(options.prefer)
        if making.known(outcome.partition) is None:
            job.progress("verifying by definition")
            with little_time_after(outcome.stopped):
                job.check(outcome.partition)
        found.append(outcome)

    stopped = run_until_stopped(run)
    if stopped is None:
        return found[0]
    if not making.verified:
        raise stopped
    return Outcome(making.verified[-1][0], job.lower_bound, stopped=stopped)
