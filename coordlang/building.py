"""Candidate tasks -> a verified language: the steps of the mission in their order."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from time import perf_counter
from typing import Literal

from coordlang.certificate import Certificate, certify
from coordlang.language.partition import Partition
from coordlang.language.provenance import Guarantee, provenance_of
from coordlang.language.warping import Clause
from coordlang.language.words import Language
from coordlang.required.composition_walk import walk
from coordlang.required.divergences import FirstDifferences, first_differences, states_on_plans
from coordlang.required.miscoordination import Inseparable, inseparable
from coordlang.tasks.candidates import Candidates, require_solvable
from coordlang.verification.by_definition import Verdict, verify
from coordlang.verification.overlapping import verify_overlapping
from coordlang.vocabulary import METHODS, Job, Outcome, greedy
from coordlang.vocabulary.enlarging import enlarge
from coordlang.vocabulary.flexible import flexible
from coordlang.vocabulary.job import Assignment, Evidence
from coordlang.vocabulary.minimal import refute
from planners.limits import STOPPING, stop_clock


@dataclass(frozen=True, slots=True)
class Built:
    """A verified language and the figures of its making.

    ``figures`` are the method's own (rounds, clauses, ..), ``seconds`` are by phase.  ``stopped``
    is the error that ended the method before its proof was complete, or None.  ``job`` and
    ``evidence`` are what `certificate_of` needs.
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


def build_language(
    candidates: Candidates,
    method: str = "greedy",
    *,
    seed: int = 0,
    alpha_only: bool = False,
    prefer: Literal["flexible"] | None = None,
    overlap: bool = False,
    progress: Callable[[str], None] = lambda _: None,
) -> Built:
    """Build a coordination language for candidate tasks and verify it by definition.

    ``alpha_only`` is for the method "separating": plans are separated where they part, never where
    they meet.  ``prefer`` "flexible": of the languages with as many words as the method finds, one
    whose sentences leave many plans open. ``overlap``: then give states further words as long as
    that leaves more plans open (`coordlang.language.overlapping`).

    Raises `Inseparable` (with the two plans) when there is none, `OutOfMemory` before the memory
    budget is used up.
    """
    require_solvable(candidates)
    clock = _Clock()
    progress("looking for inseparable plans")
    for space in candidates.spaces:
        witness = inseparable(space)
        if witness is not None:
            raise Inseparable(witness)
    progress("walking pairs of plans")
    found = first_differences(candidates.spaces)
    clock.note("coordination")
    checked: list[_Checked] = []

    def check(assignment: Assignment) -> None:
        checked.append(_verified(candidates, assignment))

    states = tuple(states_on_plans(candidates.spaces).tolist())
    job = Job(candidates, states, found, None, seed, alpha_only, progress, check)
    if method != "greedy":
        # What is left when an anytime method is stopped; verified now, because there is no time
        # then.
        first = greedy(job).partition
        check(first)
        job = replace(job, incumbent=first)
        clock.note("incumbent")
    progress(f"building words ({method})")
    try:
        outcome = METHODS[method](job)
        clock.note("vocabulary")
        if prefer == "flexible" and outcome.stopped is None:
            outcome = flexible(job, outcome)
            clock.note("flexible")
        if not any(known.assignment is outcome.partition for known in checked):
            progress("verifying by definition")
            check(outcome.partition)
    except STOPPING as error:
        stop_clock()
        if not checked:
            raise
        outcome = Outcome(checked[-1].assignment, job.lower_bound, {}, error.with_traceback(None))
    best = next(known for known in checked if known.assignment is outcome.partition)
    clock.note("verify")
    partition = best.partition
    if overlap and outcome.stopped is None:
        progress("enlarging words")
        try:
            partition, outcome = _overlapping(candidates, partition, outcome)
        except STOPPING as error:
            stop_clock()  # the words as they were are a verified language
            outcome = replace(outcome, stopped=error.with_traceback(None))
        clock.note("overlap")
    size = len(partition.words)
    guarantee = Guarantee(method, size, outcome.lower_bound, size == outcome.lower_bound)
    provenance = provenance_of(candidates, guarantee, {"program": "coordlang"})
    language = Language.of(partition, candidates.model, provenance)
    return Built(
        language,
        found,
        len(job.states),
        best.verdict,
        outcome.figures,
        clock.seconds,
        outcome.stopped,
        job,
        outcome.evidence,
    )


def _overlapping(
    candidates: Candidates, partition: Partition, outcome: Outcome
) -> tuple[Partition, Outcome]:
    """The partition with further words of its states, verified by definition."""
    spaces = candidates.spaces
    word = partition.word_of(candidates.rows)
    enlarged = enlarge(
        spaces,
        [walk(space).requires for space in spaces],
        {state: int(word[state]) for state in outcome.partition},
    )
    partition = partition.enlarged(candidates.rows, enlarged.words)
    verdict = verify_overlapping(partition, spaces)
    if not verdict.holds:
        raise AssertionError(f"the enlarged words are no coordination language: {verdict.witness}")
    figures = {
        **outcome.figures,
        "overlapping_words": enlarged.further,
        "overlapping_flexibility": float(enlarged.expected.mean()),
        "partition_flexibility": float(enlarged.before.mean()),
    }
    return partition, replace(outcome, figures=figures, stopped=enlarged.stopped)


def certificate_of(built: Built) -> Certificate:
    """Why no partition with fewer words than the proved lower bound is a language.

    For others to check.

    Uses what the method met on its way; for a method that meets nothing the search of `minimal`
    finds reasons.  As long as that takes: not anytime.
    """
    refuted = built.language.guarantee.lower_bound - 1
    evidence = built.evidence or (refute(built.job, refuted) if refuted else {})
    return certify(built.job.candidates, evidence, refuted)


@dataclass(frozen=True, slots=True)
class _Checked:
    """What a method returned, as a partition, and the verdict that it is a language."""

    assignment: Assignment
    partition: Partition
    verdict: Verdict


def _verified(candidates: Candidates, assignment: Assignment) -> _Checked:
    partition = Partition.of_states(candidates.rows, assignment)
    verdict = verify(partition, candidates.spaces)
    if not verdict.holds:
        raise AssertionError(
            f"a method returned what is no coordination language: {verdict.witness}"
        )
    return _Checked(assignment, partition, verdict)


class _Clock:
    """Seconds by phase."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self._since = perf_counter()

    def note(self, phase: str) -> None:
        now = perf_counter()
        self.seconds[phase] = now - self._since
        self._since = now
