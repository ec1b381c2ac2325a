# SPDX-License-Identifier: GPL-3.0-or-later
"""Candidate tasks -> a verified language: the steps of the mission in their order."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from math import inf
from time import perf_counter
from typing import Any

from coordlang.commands.options import BuildPreference, MethodOptions
from coordlang.commands.repairing import Repaired, repair_language
from coordlang.explanation.simple import simple
from coordlang.language.candidates import Candidates, require_solvable
from coordlang.language.partition import Partition
from coordlang.language.provenance import Guarantee, Tolerance, provenance_of
from coordlang.language.warping import Clause
from coordlang.language.words import Language
from coordlang.required.divergences import (
    FirstDifferences,
    differences,
    states_on_plans,
    without_divergences,
)
from coordlang.required.failure import NONE, Failures
from coordlang.required.miscoordination import Inseparable
from coordlang.verification.by_definition import Verdict, verify_candidates
from coordlang.verification.certificate_file import Certificate
from coordlang.verification.check_certificate import check as check_certificate
from coordlang.verification.make_certificate import certify
from coordlang.vocabulary import METHODS, Job, Outcome
from coordlang.vocabulary.few_words import FewWords, few_words
from coordlang.vocabulary.flexible import flexible
from coordlang.vocabulary.greedy import first_language
from coordlang.vocabulary.hidden_slack import hidden_differences
from coordlang.vocabulary.job import Assignment, Evidence
from coordlang.vocabulary.minimal import refuting_clauses
from planners.parallel.workers import Workers
from planners.search.portions import require_room
from planners.system.errors import OutOfMemory, Refuted, UsageError
from planners.system.limits import little_time_after, run_until_stopped, start_clock, time_left
from planners.system.notebook import Presented, counted
from planners.system.options import record_from

PREFERENCES: Mapping[BuildPreference, Callable[[Job, Outcome], Outcome]] = {
    "flexible": flexible,
    "simple": simple,
}
#: What a file says of how a limited number of words was found.
FEW_WORDS = "few-words"


@dataclass(frozen=True, slots=True, repr=False)
class Built(Presented):
    """A language, verified by definition, and how it was made.

    With a limit on the words it may be none: ``failures`` says how often robots then fail, and
    ``few_words`` how it was found.

    ``job`` is what words were looked for, ``verdict`` that it is a coordination language;
    ``figures`` and ``seconds`` are the method's own figures and the time by phase.  ``stopped`` is
    the error that ended the method before its proof was complete, or None.  By the clauses
    ``refuting`` the lower bound was proved.  ``repaired`` says what became of the language that it
    started from, and ``fewest`` how many tasks would require coordination if only plans with the
    fewest actions counted, if that is known.  The time limit ends at the ``deadline``, on the clock
    `time.monotonic`.
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
    shown = ("tasks", "guarantee")

    @property
    def candidates(self) -> Candidates:
        """The candidate tasks."""
        return self.job.candidates

    @property
    def guarantee(self) -> Guarantee:
        """The number of words, and the proved lower bound on it."""
        return self.language.guarantee

    @property
    def tasks(self) -> int:
        """The number of candidate tasks."""
        return self.candidates.count

    @property
    def first_differences(self) -> FirstDifferences:
        """Where coordination is required."""
        return self.job.first_differences

    def certificate(self) -> Certificate:
        """Why no partition with fewer words than the proved lower bound is a language.

        For others to check; it is checked here, too.  Also of a search that was ``stopped``.  Uses
        what the method met on its way; for a method that meets nothing the search of `minimal`
        finds reasons, as long as that takes.  Raises `AssertionError` if it does not prove the
        bound: a solver has erred.
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

    def text(self, width: int) -> str:
        """The figures of the making in whole lines of at most ``width`` characters."""
        figures = self.data()
        proof, verified = f"at least {figures['lower_bound']} needed, ", "verified"
        if figures["proved_minimal"]:
            proof = "proved minimal, "
        if self.few_words is not None and not figures["verified"]:
            proof, verified = "", "no coordination language"
        words, tasks = counted(figures["words"], "word"), counted(figures["tasks"], "task")
        lines = [
            f"{words} ({figures['method']}, {proof}{verified}) for {tasks}, "
            f"{figures['tasks_requiring_coordination']:,} of which require coordination",
            f"{figures['states_on_plans']:,} states on {self.candidates.model.kept_plans}, "
            f"{figures['divergences']:,} divergences, {figures['walk_nodes']:,} nodes of plans, "
            f"{sum(figures['seconds'].values()):.2f} s",
            *self._what_would_be(),
            *self._how_often_robots_fail(),
            *_optimised(figures),
            *([self.repaired.text(width)] if self.repaired else []),
        ]
        return "".join(f"{line}\n" for line in lines)

    def _what_would_be(self) -> Iterator[str]:
        """What more effort might bring, and what another cost would change."""
        guarantee, requiring = self.guarantee, self.first_differences.requiring
        if guarantee.method == "best" and not guarantee.proved_minimal:
            larger = "limit" if self.stopped else f"--effort than {self.job.effort}"
            yield (
                f"between {guarantee.lower_bound} and {guarantee.size} words are needed: a larger "
                f"{larger} may find fewer or prove that there are none"
            )
        if self.fewest not in (None, requiring):
            would = f"{counted(self.fewest or 0, 'task')} would require coordination"
            less = "" if self.fewest else ": one word would do"
            yield f"with --cost makespan+actions {would}, not {requiring:,}{less}"

    def _how_often_robots_fail(self) -> Iterator[str]:
        """How often under as many words as were asked for, and how often in silence."""
        found = self.few_words
        if found is None:
            return
        line = f"robots that choose by themselves {self.failures.text()}"
        if self.verdict.holds:
            line = "no robot fails: this is a coordination language"
        elif found.is_best and len(self.language.words) > 1:
            line += " (the least of all partitions)"
        yield line
        yield f"in silence they {Failures(found.silence.mean, found.silence.worst).text()}"


def _optimised(figures: Mapping[str, Any]) -> Iterator[str]:
    """How many plans the sentences leave open or how short formulas are, where one is preferred."""
    if "flexibility" in figures:
        yield (
            f"a sentence leaves {figures['flexibility']:,.2f} plans open on average ("
            f"{figures['flexibility_before']:,.2f} before, "
            f"{figures['flexibility_bound']:,.2f} at most), "
            f"communication saving {100 * figures['communication_saving']:.1f} %"
        )
    if "terms" in figures:
        terms, limits = figures["terms"], figures["limits"]
        proved = (terms, limits) == (figures["terms_lower_bound"], figures["limits_lower_bound"])
        proof = "proved the shortest" if proved else f"at least {figures['terms_lower_bound']}"
        before = f"{counted(figures['terms_before'], 'term')}, {figures['limits_before']} limits"
        yield (
            f"formulas of {counted(terms, 'term')} with {counted(limits, 'limit')} on variables "
            f"({before} before; {proof})"
        )


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

    def job(self, options: MethodOptions) -> Job:
        """What words are to be found; `Inseparable` if there is no language over states."""
        find = hidden_differences if self.candidates.model.hides_slack else differences
        return self.job_for(find(self.candidates, self.workers, self.progress), options)

    def job_for(self, found: FirstDifferences, options: MethodOptions) -> Job:
        """The same, for plans that part like that."""
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
    options: MethodOptions | None = None,
    words: int | None = None,
    worst: bool = False,
    start: Language | None = None,
    reserve: float = 0.0,
    progress: Callable[[str], None] = lambda _: None,
    workers: Workers | None = None,
    **way: object,
) -> Built:
    """Build a coordination language for candidate tasks and verify it by definition.

    ``method`` and ``way`` are as in `MethodOptions`, of which ``options`` may be given in their
    place.  A search that has a language leaves the share ``reserve`` of a time limit's rest for
    `Built.certificate`.  The language does not depend on ``workers``.

    With ``words`` there are at most so many, under which robots that choose by themselves fail
    least often (``worst``: in the worst task, not over all).  Plans of the tasks may then be
    inseparable; one word is silence.  With ``start`` as few states of this language as possible
    change their word; those that the tasks' problem cannot have are left out.

    Raises `Inseparable`, which has two plans that show it, if there is no language over states,
    `ProvedImpossible` if there is no candidate task, `OutOfMemory` before the memory limit is
    reached, where there is no language yet to return, `UsageError` for options that contradict each
    other, and `TooManyToCount` where not even failures in silence can be counted.
    """
    options = options or record_from(MethodOptions, {"method": method, **way}, "build_language")
    method, making = options.method, Making(candidates, workers, progress)
    if words is not None:
        return _few_words(making, words, worst=worst, seed=options.seed)
    if start is not None:
        return repair_language(making, start, options)
    if candidates.model.hides_slack and method in ("greedy", "separating"):
        raise UsageError(
            f"--method {method} parts plans where their states first differ, and with slack they "
            "may differ in where they wait",
            remedy="Add --words-see-slack, by which states say how much is left, or --method "
            "minimal.",
        )
    job = making.job(options)
    making.note("coordination")
    if method != "greedy":
        try:
            require_room(candidates.source)
        except OutOfMemory:
            if method != "best":
                raise
            job = replace(job, effort=0)
        # It is verified now, for there is no time when an anytime method is stopped.
        job = replace(job, incumbent=first_language(job))
        making.check(job.incumbent or {})
        making.note("incumbent")
        if reserve:
            start_clock((1 - reserve) * time_left())
    progress(f"building words ({method})")
    found = _outcome(job, options, making)
    making.note("verify")
    return making.built(
        job,
        making.known(found.partition),
        method,
        found.lower_bound,
        figures=found.figures,
        stopped=found.stopped,
        refuting=found.refuting,
    )


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


def _few_words(making: Making, words: int, *, worst: bool, seed: int) -> Built:
    """The few words; where robots never fail they are verified, as every coordination language."""
    require_room(making.candidates.source)
    job = job_for_few_words(making, seed)
    making.note("coordination")
    found = few_words(job, words, worst=worst)
    making.note("vocabulary")
    stopped = found.stopped
    if not found.failures.worst:
        with little_time_after(stopped):
            making.check(found.partition)
        if not isinstance(stopped, KeyboardInterrupt):
            stopped = None  # no search was left where nothing fails
    making.note("verify")
    unverified = (
        making.partition_of(found.partition),
        Verdict(False, making.candidates.count, 0, None),
    )
    return making.built(
        job,
        making.known(found.partition) or unverified,
        FEW_WORDS,
        job.lower_bound,
        figures={
            "silence_mean": float(found.silence.mean),
            "silence_worst": float(found.silence.worst),
            "partitions_measured": found.measured,
            "partitions_recounted": found.recounted,
            "least_of_all_partitions": found.is_best,
        },
        stopped=stopped,
        failures=Failures(found.failures.mean, found.failures.worst),
        few_words=found,
    )


def job_for_few_words(making: Making, seed: int = 0) -> Job:
    """What words are looked for, with a language as the incumbent if there is one.

    Where plans are inseparable there is none, and divergences are not defined; nor are they where
    states hide slack.
    """
    options, spaces = MethodOptions(seed=seed), making.candidates.spaces
    try:
        job = making.job(options)
    except Inseparable:
        job = making.job_for(without_divergences(spaces), options)
        return replace(job, states=tuple(states_on_plans(spaces).tolist()))
    return replace(job, incumbent=first_language(job))
