# SPDX-License-Identifier: GPL-3.0-or-later
"""Candidate tasks and a number of words -> words under which robots fail as rarely as possible."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from coordlang.commands.built import Built, Clock, language_of
from coordlang.language.candidates import Candidates, require_solvable
from coordlang.language.partition import Partition
from coordlang.required.all_differences import differences
from coordlang.required.divergences import states_on_plans, without_divergences
from coordlang.required.failures import Failures
from coordlang.required.miscoordination import Inseparable
from coordlang.verification.by_definition import Verdict
from coordlang.verification.candidates import verify_candidates
from coordlang.vocabulary.few_words import FewWords, few_words
from coordlang.vocabulary.greedy import first_language
from coordlang.vocabulary.hidden_slack import hidden_differences
from coordlang.vocabulary.job import Job
from planners.parallel.workers import Workers
from planners.search.portions import require_room
from planners.system.limits import little_time_after

#: What a file says of how the words were found.
METHOD = "few-words"


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

    Parameters
    ----------
    candidates
        The tasks that they are for.  Plans of them may be inseparable.
    words
        The most words; 1 is silence.
    worst
        Minimise how often robots fail in the worst task, not over all tasks.
    seed
        Of all random choices.
    progress
        Called with a line of text now and then.
    workers
        Who does jobs; None: this process.

    Raises
    ------
    ProvedImpossible
        There is no candidate task.
    TooManyToCount
        Not even how often robots fail in silence can be counted.
    """
    require_solvable(candidates)
    require_room(candidates.source)
    workers = workers or Workers()
    clock = Clock()
    job = job_of(candidates, workers, seed=seed, progress=progress)
    clock.note("coordination")
    found = few_words(job, words, worst=worst)
    clock.note("vocabulary")
    partition = Partition.of_states(candidates.rows, found.partition)
    verdict = Verdict(False, candidates.count, 0, None)
    if not found.failures.worst:
        with little_time_after(found.stopped):
            verdict = verify_candidates(partition, candidates, workers, progress)
        if not verdict.holds:
            raise AssertionError(f"no robot fails, but these words do: {verdict.witness}")
    clock.note("verify")
    is_interrupted = isinstance(found.stopped, KeyboardInterrupt)
    failures = Failures(found.failures.mean, found.failures.worst)
    return Built(
        language_of(
            partition, job, METHOD, job.lower_bound, holds=verdict.holds, failures=failures
        ),
        job,
        verdict,
        _figures(found),
        clock.seconds,
        # No search was left where nothing fails.
        None if verdict.holds and not is_interrupted else found.stopped,
        failures=failures,
        few_words=found,
    )


def _figures(found: FewWords) -> dict[str, float]:
    return {
        "silence_mean": float(found.silence.mean),
        "silence_worst": float(found.silence.worst),
        "partitions_measured": found.measured,
        "partitions_recounted": found.recounted,
        "least_of_all_partitions": found.is_best,
    }


def job_of(
    candidates: Candidates,
    workers: Workers,
    *,
    seed: int = 0,
    progress: Callable[[str], None] = lambda _: None,
) -> Job:
    """What words are looked for, with a language as the incumbent if there is one.

    Where plans are inseparable there is none, and divergences are not defined; nor are they where
    states hide slack.
    """
    states = tuple(states_on_plans(candidates.spaces).tolist())
    hidden = candidates.model.hides_slack
    try:
        found = (hidden_differences if hidden else differences)(candidates, workers, progress)
    except Inseparable:
        first = without_divergences(candidates.spaces)
        return Job(candidates, states, first, seed=seed, progress=progress, workers=workers)
    job = Job(candidates, states, found, seed=seed, progress=progress, workers=workers)
    return replace(job, incumbent=first_language(job))
