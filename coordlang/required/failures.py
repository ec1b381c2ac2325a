# SPDX-License-Identifier: GPL-3.0-or-later
"""How often robots fail under words, as far as it can be told: counted, estimated, or neither.

Where counting takes too long, plans are drawn.
"""

from __future__ import annotations

from bisect import bisect
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import accumulate
from math import sqrt
from random import Random
from typing import Any

from coordlang.language.candidates import Candidates
from coordlang.language.partition import Partition
from coordlang.language.sentences import Sentence, sentence
from coordlang.language.tolerance import Tolerance, percent
from coordlang.required.failure import MOST, TooManyToCount, failure_probability
from planners.joint.tables import Ints
from planners.search.plan_space import PlanSpace
from planners.search.plans import counts
from planners.search.portions import estimate
from planners.system.errors import OutOfTime
from planners.system.limits import stop_clock

#: Additions that take some seconds.
_QUICKLY = 2_000_000
#: Runs that are drawn where counting takes too long.
_RUNS = 1_000
#: The two-sided 95 % quantile of the normal distribution.
_Z = 1.959963984540054


@dataclass(frozen=True, slots=True)
class FailureEstimate:
    """How often robots failed in ``runs`` independent draws.

    ``low`` and ``high`` are the 95 % confidence interval, by Wilson's score.
    """

    failures: int
    runs: int

    @property
    def value(self) -> float:
        """The share of runs that failed."""
        return self.failures / self.runs

    @property
    def interval(self) -> tuple[float, float]:
        """The 95 % confidence interval."""
        return wilson(self.failures, self.runs)

    def data(self) -> dict[str, Any]:
        """Return it as JSON data."""
        low, high = self.interval
        return {"value": self.value, "low": low, "high": high, "runs": self.runs}

    def text(self) -> str:
        """Return it as text, named as an estimate."""
        low, high = self.interval
        return (
            f"about {percent(self.value)} (estimated from {self.runs:,} draws: "
            f"{100 * low:.1f} to {100 * high:.1f} %)"
        )


@dataclass(frozen=True, slots=True)
class Failures:
    """How often robots that choose by themselves miscoordinate.

    ``mean`` over the tasks, and ``worst`` in the worst one, None where it is not counted;
    ``estimate`` of the mean, where it was too much work to count; ``why_not`` it is not counted.
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
            data["failure_estimate"] = self.estimate.data()
        return data

    def text(self) -> str:
        """Return it as the end of a sentence, "robots .. fail ..": how often, over many tasks."""
        if self.mean is not None and self.worst is not None:
            return (
                f"fail in {percent(float(self.mean))} of all runs, and in "
                f"{percent(float(self.worst))} in the worst task"
            )
        if self.estimate is not None:
            return f"fail in {self.estimate.text()} of all runs"
        return f"fail in an unknown share of all runs ({self.why_not})"


#: Of words that are verified: nothing is counted.
NONE = Failures(Fraction(0), Fraction(0))


def failures(
    spaces: Sequence[PlanSpace], words: Sequence[Ints | None], most: int = MOST
) -> Failures:
    """Count how often robots fail in some tasks; what is too much work is estimated.

    ``spaces``, ``words`` and ``most`` are as in `failure_probability`.
    """
    try:
        found = failure_probability(spaces, words, most)
    except TooManyToCount as error:
        return Failures(None, None, estimated_failure(spaces, words, _RUNS, seed=0), error.what)
    return Failures(found.mean, found.worst)


def failures_under(
    partition: Partition, candidates: Candidates, *, is_claimed: bool = False, most: int = MOST
) -> Failures:
    """Count how often robots fail under words in all candidate tasks.

    If it ``is_claimed`` by a language file it is counted whatever the work is, up to ``most``
    additions; else only where that takes seconds.
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


def wilson(successes: int, runs: int) -> tuple[float, float]:
    """Return the 95 % confidence interval of a proportion, by Wilson's score (1927).

    It stays within 0 .. 1 and is not degenerate where all runs or none succeed.

    Raises
    ------
    ValueError
        Without runs, or if there are not between 0 and ``runs`` successes.
    """
    if runs < 1 or not 0 <= successes <= runs:
        raise ValueError(f"{successes} successes in {runs} runs")
    share, weight = successes / runs, _Z**2 / runs
    middle = (share + weight / 2) / (1 + weight)
    half = _Z / (1 + weight) * sqrt(share * (1 - share) / runs + weight / (4 * runs))
    # Without these the ends miss 0 and 1 by a rounding error.
    low = 0.0 if successes == 0 else middle - half
    high = 1.0 if successes == runs else middle + half
    return low, high


def estimated_failure(
    spaces: Sequence[PlanSpace], words: Sequence[Ints | None], runs: int, seed: int
) -> FailureEstimate:
    """Draw a task uniformly, a plan of it, and for each robot a plan with the same sentence.

    ``spaces`` hold at least one task; ``words`` are for each of them the word number of each node,
    None: silence.  What is drawn ``runs`` times depends on ``seed``.
    """
    random = Random(seed)
    games = [_Game(space, word) for space, word in zip(spaces, words, strict=True)]
    tasks = [(game, start) for game in games for start in game.space.starts.tolist()]
    failures = 0
    for _ in range(runs):
        game, start = random.choice(tasks)
        failures += game.fails(start, random)
    return FailureEstimate(failures, runs)


class _Game:
    """Plans drawn from one plan space, freely or with a sentence."""

    def __init__(self, space: PlanSpace, word: Ints | None) -> None:
        self.space = space
        self._counted = counts(space)
        self._word: list[int] = [0] * len(space) if word is None else word.tolist()
        self._fitting: dict[tuple[int, Sentence], int] = {}

    def fails(self, start: int, random: Random) -> bool:
        """Whether robots that draw by themselves, after a sentence was said, miscoordinate."""
        first = self._drawn(start, None, random)
        said = sentence(self._word[node] for node in self.space.nodes_on(start, first))
        plans = [self._drawn(start, said, random) for _ in range(self.space.robots)]
        steps = [
            tuple(self.space.labels_of(edge)[robot] for robot, edge in enumerate(step))
            for step in zip(*plans, strict=True)
        ]
        return self.space.path_with(start, steps) is None

    def _drawn(self, node: int, said: Sentence | None, random: Random) -> list[int]:
        """The edges of a plan drawn uniformly, of those with a sentence (None: of all)."""
        path = []
        while edges := self.space.out_edges(node):
            targets = self.space.successors(node)
            rests = [self._rest(node, target, said) for target in targets]
            weights = map(self._number, targets, rests)
            ends = list(accumulate(weights))
            chosen = bisect(ends, random.randrange(ends[-1]))
            path.append(edges[chosen])
            node, said = targets[chosen], rests[chosen]
        return path

    def _rest(self, node: int, target: int, said: Sentence | None) -> Sentence | None:
        """What is left to say from ``target`` on, after ``said`` from ``node`` on."""
        return said if said is None or self._word[target] == self._word[node] else said[1:]

    def _number(self, node: int, said: Sentence | None) -> int:
        """How many plans from a node have a sentence (None: any)."""
        if said is None:
            return self._counted[node]
        if said[:1] != (self._word[node],):
            return 0
        key = (node, said)
        if key not in self._fitting:
            targets = self.space.successors(node)
            following = sum(self._number(t, self._rest(node, t, said)) for t in targets)
            self._fitting[key] = following if targets else int(len(said) == 1)
        return self._fitting[key]
