# SPDX-License-Identifier: GPL-3.0-or-later
"""How often robots miscoordinate, estimated by drawing: where counting takes too long."""

from __future__ import annotations

from bisect import bisect
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import accumulate
from math import sqrt
from random import Random

from coordlang.language.sentences import Sentence, sentence
from planners.joint.tables import Ints
from planners.search.plan_space import PlanSpace
from planners.search.plans import counts

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

    Parameters
    ----------
    spaces
        The plan spaces of the tasks, at least one task.
    words
        For each the word number of each node; None: silence.
    runs, seed
        How often, and what the draws depend on.
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
        said = sentence(self._word[node] for node in self._drawn(start, None, random)[0])
        plans = [self._drawn(start, said, random)[1] for _ in range(self.space.robots)]
        labels = [[self.space.labels_of(edge) for edge in plan] for plan in plans]
        steps = [tuple(row[n] for n, row in enumerate(step)) for step in zip(*labels, strict=True)]
        return self.space.path_with(start, steps) is None

    def _drawn(
        self, node: int, said: Sentence | None, random: Random
    ) -> tuple[list[int], list[int]]:
        """The nodes and edges of a plan drawn uniformly, of those with a sentence (None: all)."""
        nodes, path = [node], []
        while edges := self.space.out_edges(node):
            rests = [self._rest(node, self.space.target_of(edge), said) for edge in edges]
            weights = [
                self._number(self.space.target_of(edge), rest)
                for edge, rest in zip(edges, rests, strict=True)
            ]
            chosen = bisect(list(accumulate(weights)), random.randrange(sum(weights)))
            path.append(edges[chosen])
            node, said = self.space.target_of(path[-1]), rests[chosen]
            nodes.append(node)
        return nodes, path

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
            self._fitting[key] = (
                sum(self._number(t, self._rest(node, t, said)) for t in targets)
                if targets
                else int(len(said) == 1)
            )
        return self._fitting[key]
