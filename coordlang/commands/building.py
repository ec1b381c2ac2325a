# SPDX-License-Identifier: GPL-3.0-or-later
"""Candidate tasks -> a verified language: the steps of the mission in their order."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Literal

from coordlang.commands.built import Built, Clock, Verified, language_of
from coordlang.explanation.simple import simple
from coordlang.language.candidates import Candidates, require_solvable
from coordlang.required.all_differences import differences
from coordlang.vocabulary import EXACT, METHODS, Job, Outcome
from coordlang.vocabulary.flexible import flexible
from coordlang.vocabulary.greedy import first_language
from coordlang.vocabulary.hidden_slack import hidden_differences
from planners.parallel.workers import Workers
from planners.search.portions import require_room
from planners.system.errors import OutOfMemory, UsageError
from planners.system.limits import little_time_after, run_until_stopped, start_clock, time_left
from planners.system.options import option, record_from

#: Effort of ``--method best`` that takes a second or two on small tasks.
EFFORT = 10
#: How words are found: a key of `coordlang.vocabulary.METHODS`.
Method = Literal["best", "greedy", "separating", "minimal", "exhaustive"]
#: What the language should be like, of those with the fewest words, by the value of ``--prefer``.
BuildPreference = Literal["flexible", "simple"]
PREFERENCES: Mapping[BuildPreference, Callable[[Job, Outcome], Outcome]] = {
    "flexible": flexible,
    "simple": simple,
}


@dataclass(frozen=True, slots=True)
class MethodOptions:
    """How the words of a language are found.

    Raises `UsageError` for a value that the method does not support.
    """

    method: Method = option(
        "best",
        "best: few words within some effort, and how many are needed at least.  greedy: fast.  "
        "separating: fewest words that part plans where they differ first or last.  minimal: "
        "fewest words at all, with proof.  exhaustive: brute force.",
    )
    effort: int = option(
        EFFORT,
        "best: what the search for fewer words may spend, in thousands of conflicts of its solver.",
        "N",
        least=0,
    )
    seed: int = option(0, "Seed of all random choices.", least=0)
    alpha_only: bool = option(
        False, "separating: part plans where they differ first, never where last."
    )
    prefer: BuildPreference | None = option(
        None,
        "Of the languages with the fewest words that were found one whose ..  "
        "flexible: sentences leave many plans open.  simple: words have short formulas.",
    )

    def __post_init__(self) -> None:
        if self.alpha_only and self.method != "separating":
            raise UsageError(
                "--alpha-only belongs to --method separating",
                remedy="Add --method separating, or leave out --alpha-only.",
            )
        if self.effort != EFFORT and self.method != "best":
            raise UsageError(
                "--effort belongs to --method best",
                remedy="Leave out --effort, or --method.",
            )
        if self.prefer and self.method in ("greedy", "separating"):
            raise UsageError(
                f"--prefer {self.prefer} belongs to --method best, minimal or exhaustive",
                remedy=f"Leave out --method {self.method}, or --prefer.",
            )

    @property
    def is_exact(self) -> bool:
        """Whether the method finds the least number of words."""
        return self.method in EXACT


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
    require_solvable(candidates)
    workers = workers or Workers()
    clock = Clock()
    hidden = candidates.model.hides_slack
    if hidden and method in ("greedy", "separating"):
        raise UsageError(
            f"--method {method} parts plans where their states first differ, and with slack they "
            "may differ in where they wait",
            remedy="Add --words-see-slack, by which states say how much is left, or --method "
            "minimal.",
        )
    found = (hidden_differences if hidden else differences)(candidates, workers, progress)
    clock.note("coordination")
    states = tuple(found.states.tolist())
    verified = Verified(candidates, workers, progress)
    job = Job(
        candidates,
        states,
        found,
        seed=options.seed,
        alpha_only=options.alpha_only,
        effort=options.effort,
        progress=progress,
        check=verified.check,
        workers=workers,
    )
    if method != "greedy":
        job = _with_incumbent(_within_room(job, options.method))
        clock.note("incumbent")
        if reserve:
            start_clock((1 - reserve) * time_left())
    progress(f"building words ({method})")
    outcome = _outcome(job, options, verified, clock)
    partition, verdict = verified.of(outcome.partition)
    clock.note("verify")
    return Built(
        language_of(partition, job, method, outcome.lower_bound),
        job,
        verdict,
        outcome.figures,
        clock.seconds,
        outcome.stopped,
        outcome.refuting,
    )


def _within_room(job: Job, method: Method) -> Job:
    """Without effort if the plans of all tasks do not fit; other methods raise `OutOfMemory`."""
    try:
        require_room(job.candidates.source)
    except OutOfMemory:
        if method != "best":
            raise
        return replace(job, effort=0)
    return job


def _with_incumbent(job: Job) -> Job:
    """Verify a greedy partition, which is what is left when an anytime method is stopped.

    It is verified now because there is no time then.  Where states hide slack it has a word for
    each state: no plans are inseparable.
    """
    first = first_language(job)
    job.check(first)
    return replace(job, incumbent=first)


def _outcome(job: Job, options: MethodOptions, verified: Verified, clock: Clock) -> Outcome:
    """What the method finds; if it is stopped early, the last partition that was verified."""
    found: list[Outcome] = []

    def run() -> None:
        outcome = METHODS[options.method](job)
        clock.note("vocabulary")
        if options.prefer and outcome.stopped is None:
            outcome = PREFERENCES[options.prefer](job, outcome)
            clock.note(options.prefer)
        if not verified.knows(outcome.partition):
            job.progress("verifying by definition")
            with little_time_after(outcome.stopped):
                job.check(outcome.partition)
        found.append(outcome)

    stopped = run_until_stopped(run)
    if stopped is None:
        return found[0]
    if verified.last is None:
        raise stopped
    return Outcome(verified.last, job.lower_bound, stopped=stopped)
