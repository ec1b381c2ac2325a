# SPDX-License-Identifier: GPL-3.0-or-later
"""How often robots fail under words, as far as it can be told: counted, estimated, or neither."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from coordlang.language.candidates import Candidates
from coordlang.language.partition import Partition
from coordlang.language.tolerance import Tolerance, percent
from coordlang.required.failure import (
    MOST,
    FailureProbability,
    TooManyToCount,
    failure_probability,
)
from coordlang.required.sampled import FailureEstimate, estimated_failure
from planners.joint.tables import Ints
from planners.search.plan_space import PlanSpace
from planners.search.portions import estimate
from planners.system.errors import OutOfTime
from planners.system.limits import stop_clock

#: Additions that take some seconds.
_QUICKLY = 2_000_000
#: Runs that are drawn where counting takes too long.
_RUNS = 1_000


@dataclass(frozen=True, slots=True)
class Failures:
    """How often robots that choose by themselves miscoordinate.

    Attributes
    ----------
    mean, worst
        Over the tasks, and in the worst one; None where it is not counted.
    estimate
        Of the mean, where it was too much work to count.
    why_not
        Why it is not counted.
    """

    mean: Fraction | None
    worst: Fraction | None
    estimate: FailureEstimate | None = None
    why_not: str = ""

    @property
    def tolerance(self) -> Tolerance | None:
        """What a language file may claim, None where it is not counted."""
        if self.mean is None or self.worst is None:
            return None
        return Tolerance(float(self.mean), float(self.worst))

    def data(self) -> dict[str, Any]:
        """Return it as JSON data: probabilities, null where they are not counted."""
        data: dict[str, Any] = {
            "failure_mean": None if self.mean is None else float(self.mean),
            "failure_worst": None if self.worst is None else float(self.worst),
        }
        if self.estimate is not None:
            data["failure_estimate"] = estimate_data(self.estimate)
        return data

    def text(self) -> str:
        """Return it as the end of a sentence, "robots .. fail ..": how often, over many tasks."""
        if self.mean is not None and self.worst is not None:
            return (
                f"fail in {percent(float(self.mean))} of all runs, and in "
                f"{percent(float(self.worst))} in the worst task"
            )
        if self.estimate is not None:
            return f"fail in {estimate_text(self.estimate)} of all runs"
        return f"fail in an unknown share of all runs ({self.why_not})"


#: Of words that are verified: nothing is counted.
NONE = Failures(Fraction(0), Fraction(0))


def estimate_data(estimate: FailureEstimate) -> dict[str, Any]:
    """An estimate as JSON data."""
    low, high = estimate.interval
    return {"value": estimate.value, "low": low, "high": high, "runs": estimate.runs}


def estimate_text(estimate: FailureEstimate) -> str:
    """An estimate as text, named as one."""
    low, high = estimate.interval
    return (
        f"about {percent(estimate.value)} (estimated from {estimate.runs:,} draws: "
        f"{100 * low:.1f} to {100 * high:.1f} %)"
    )


def failures(
    spaces: Sequence[PlanSpace], words: Sequence[Ints | None], most: int = MOST, seed: int = 0
) -> Failures:
    """Count how often robots fail in some tasks; what is too much work is estimated.

    Parameters
    ----------
    spaces, words, most
        As in `coordlang.required.failure.failure_probability`.
    seed
        What an estimate depends on.
    """
    try:
        found: FailureProbability = failure_probability(spaces, words, most)
    except TooManyToCount as error:
        return Failures(None, None, estimated_failure(spaces, words, _RUNS, seed), error.what)
    return Failures(found.mean, found.worst)


def failures_under(
    partition: Partition, candidates: Candidates, *, is_claimed: bool = False, most: int = MOST
) -> Failures:
    """Count how often robots fail under words in all candidate tasks.

    Parameters
    ----------
    is_claimed
        Whether a language file claims it, so that it is counted whatever the work is, up to
        ``most`` additions; else only where that takes seconds.
    """
    if not is_claimed:
        most = min(most, _QUICKLY)
        if estimate(candidates.source).is_large:
            return Failures(None, None, None, "there are too many tasks to do it at once")
    try:
        spaces = candidates.spaces
        words = [partition.word_of(space.rows)[space.state] for space in spaces]
        return failures(spaces, words, most)
    except OutOfTime as error:
        stop_clock()
        return Failures(None, None, None, error.what)
