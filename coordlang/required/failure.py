# SPDX-License-Identifier: GPL-3.0-or-later
"""How often robots that choose by themselves miscoordinate: exactly, or else estimated.

The speaker draws one of a task's N optimal plans uniformly and says its sentence s.  Each of the n
robots draws one of the ``n_s`` plans with that sentence, uniformly and independently, and follows
its part.  With ``good_s`` of the n-tuples of these plans mixing to an optimal plan of the task, of
whatever sentence, ``P(fail) = sum_s n_s / N * (1 - good_s / n_s^n)``.  One word for all states is
silence; a coordination language has probability 0.

No plans are listed: of plan i the mixture uses robot i's labels only, so ``good_s`` is the sum over
the optimal plans of the product over robots of the number of plans with sentence s in which the
robot does the same (Proposition 25 of docs/concepts.md).

How many plans have each of a robot's sequences is kept as a *weighted set*: its moves, each first
label with a positive integer and the weighted set of what may follow.  The greatest common divisor
of all weights is taken out, so that sets that differ by a factor only are one: the number of
interleavings of others' moves does not matter.
"""

from __future__ import annotations

from bisect import bisect
from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from fractions import Fraction
from itertools import accumulate
from math import gcd, prod, sqrt
from random import Random
from statistics import mean
from typing import Any, NamedTuple

import numpy as np

from coordlang.language.candidates import Candidates
from coordlang.language.provenance import Tolerance, percent
from coordlang.language.sentences import Sentence, sentence
from coordlang.language.words import Partition
from coordlang.required.choices import Choices, LabelSets
from planners.joint.tables import Ints
from planners.search.plan_space import PlanSpace
from planners.search.plans import counts
from planners.search.portions import estimate
from planners.system.errors import OutOfMemory, OutOfTime
from planners.system.limits import reaching, stop_clock

#: The weighted set that holds only the empty sequence, once.
END = 0
#: So many times a weighted set, by number.
Multiple = tuple[int, int]


class WeightedSets:
    """All weighted sets that were met, by number; equal ones have one number.

    ``sets`` numbers their supports, the sequences without weights.  ``work`` counts the multiples
    that were added up.
    """

    def __init__(self) -> None:
        self.sets = LabelSets()
        self.work = 0
        #: Each first label of a set with the multiple of what follows.
        self.moves: list[dict[int, Multiple]] = [{}]
        #: How many sequences a set has, with their weights.
        self.totals: list[int] = [1]
        #: The set of its sequences, in ``sets``.
        self.supports: list[int] = [END]
        self._number: dict[tuple[tuple[int, int, int], ...], int] = {}
        self._sums: dict[tuple[Multiple, ...], Multiple] = {}

    def of_moves(self, moves: dict[int, list[Multiple]]) -> Multiple:
        """The weighted set in which each first label is followed by the sum of some multiples."""
        added = {label: self.sum(moves[label]) for label in sorted(moves)}
        factor = gcd(*(times for times, _ in added.values()))
        key = tuple((label, times // factor, after) for label, (times, after) in added.items())
        known = self._number.get(key)
        if known is None:
            known = self._number[key] = len(self.moves)
            self.moves.append({label: (times, after) for label, times, after in key})
            self.totals.append(sum(times * self.totals[after] for _, times, after in key))
            self.supports.append(
                self.sets.of_moves({label: self.supports[after] for label, _, after in key})
            )
        return factor, known

    def sum(self, multiples: Iterable[Multiple]) -> Multiple:
        """The sum of some multiples, at least one, of sets of sequences of one length."""
        times_of: dict[int, int] = defaultdict(int)
        for times, number in multiples:
            times_of[number] += times
            self.work += 1
        if len(times_of) == 1:
            ((number, times),) = times_of.items()
            return times, number
        factor = gcd(*times_of.values())
        key = tuple((times_of[number] // factor, number) for number in sorted(times_of))
        known = self._sums.get(key)
        if known is None:
            moves: dict[int, list[Multiple]] = defaultdict(list)
            for times, number in key:
                for label, (weight, after) in self.moves[number].items():
                    moves[label].append((times * weight, after))
            known = self._sums[key] = self.of_moves(moves)
        times, number = known
        return factor * times, number


#: Additions of one count after which it is given up, some minutes of work.
MOST = 50_000_000


class TooManyToCount(OutOfMemory):
    """A failure probability that would take more work than it is allowed."""


class FailureProbability(NamedTuple):
    """How often robots miscoordinate, exactly: in a task drawn uniformly, and in the worst one."""

    mean: Fraction
    worst: Fraction


def failure_probability(
    spaces: Iterable[PlanSpace], words: Iterable[Ints | None], most: int = MOST
) -> FailureProbability:
    """Count how often robots miscoordinate in all tasks of some plan spaces.

    ``words`` are for each of the ``spaces`` the word number of each node; None: silence.  Raises
    `TooManyToCount` beyond ``most`` additions.
    """
    sets = WeightedSets()
    found: list[Fraction] = []
    for space, word in zip(spaces, words, strict=True):
        found += FailureCount(space, word, sets, most).tasks()
    return FailureProbability(mean(found), max(found))


def failure_of_sentence(
    space: PlanSpace, start: int, fits: PlanSpace, most: int = MOST
) -> Fraction:
    """How often robots miscoordinate in a task once a sentence was said.

    ``space`` holds the optimal plans of the task, from the node ``start`` on, and ``fits`` those
    with the sentence, as a plan space of one task.  Raises `TooManyToCount` beyond ``most``
    additions.
    """
    sets = WeightedSets()
    begin = int(fits.starts[0])
    (parts,) = FailureCount(fits, None, sets, most).by_sentence({begin})[begin].values()
    size, good = FailureCount(space, None, sets, most).good_of(parts, start)
    return 1 - Fraction(good, size**space.robots)


#: Plans from a node with one sentence: for each robot how many of them have each of its sequences.
_Parts = tuple[Multiple, ...]


class FailureCount:
    """The failure probabilities of the tasks of one plan space.

    ``word`` is the word number of each node, None: silence.  Plan spaces of one model may share
    ``sets``; ``most`` additions are made by them and this count together.
    """

    def __init__(
        self, space: PlanSpace, word: Ints | None, sets: WeightedSets, most: int = MOST
    ) -> None:
        self.space = space
        self.choices = Choices(space, sets.sets)
        self._word: list[int] = [0] * len(space) if word is None else word.tolist()
        self._sets = sets
        self._most = most
        self._targets: list[int] = space.targets().tolist()
        self._labels: list[list[int]] = space.labels.tolist()
        self._good: dict[tuple[int, ...], int] = {}
        self._sentences: dict[tuple[int, int], int] = {}

    def tasks(self) -> list[Fraction]:
        """The failure probability of each task."""
        starts: list[int] = self.space.starts.tolist()
        asked = {start for start in starts if self.choices.requires[start]}

        def so_far() -> str:
            return (
                f"failures counted with {self._sets.work:,} additions, over {len(self.space):,} "
                f"states on {self.space.model.kept_plans}"
            )

        with reaching(so_far, self.space.model.smaller("smaller tasks")):
            said = self.by_sentence(asked) if asked else {}
            found = {node: self._probability(node, said[node].values()) for node in sorted(asked)}
        return [found.get(start, Fraction(0)) for start in starts]

    def by_sentence(self, nodes: set[int]) -> dict[int, dict[int, _Parts]]:
        """The plans from these nodes, and from all below them, by the number of their sentence."""
        said: dict[int, dict[int, _Parts]] = {}
        for node in np.flatnonzero(self.space.descendants(np.array(sorted(nodes)))).tolist():
            said[node] = self._said(node, said)
        return said

    def _said(self, node: int, said: dict[int, dict[int, _Parts]]) -> dict[int, _Parts]:
        """The plans from a node by sentence, given those from the nodes below it."""
        word, robots = self._word[node], range(self.space.robots)
        edges = self.space.out_edges(node)
        if not edges:
            return {self._front(word, -1): tuple((1, END) for _ in robots)}
        moves = defaultdict[int, list[dict[int, list[Multiple]]]](
            lambda: [defaultdict(list) for _ in robots]
        )
        for edge in edges:
            target, labels = self._targets[edge], self._labels[edge]
            is_new = self._word[target] != word
            for rest, plans in said[target].items():
                sentence = self._front(word, rest) if is_new else rest
                for mine, label, part in zip(moves[sentence], labels, plans, strict=True):
                    mine[label].append(part)
        self._check()
        return {sentence: tuple(map(self._sets.of_moves, own)) for sentence, own in moves.items()}

    def _front(self, word: int, rest: int) -> int:
        """The number of the sentence that says ``word`` and then ``rest`` (-1: nothing)."""
        return self._sentences.setdefault((word, rest), len(self._sentences))

    def _probability(self, start: int, said: Iterable[_Parts]) -> Fraction:
        robots = self.space.robots
        found, plans = Fraction(0), 0
        for parts in said:
            size, good = self.good_of(parts, start)
            found += Fraction(size**robots - good, size ** (robots - 1))
            plans += size
        return found / plans

    def good_of(self, parts: _Parts, start: int) -> tuple[int, int]:
        """Of the plans with one sentence: how many, and how many n-tuples mix to a plan."""
        factors, chosen = zip(*parts, strict=True)
        size = factors[0] * self._sets.totals[chosen[0]]
        return size, prod(factors) * self.good(chosen, start)

    def good(self, chosen: tuple[int, ...], node: int) -> int:
        """How many choices of one sequence from each weighted set are an optimal plan from a node.

        Each counts as often as its weights multiply to.
        """
        key = (*chosen, node)
        if key not in self._good:
            self._good[key] = self._count(chosen, node)
        return self._good[key]

    def _count(self, chosen: tuple[int, ...], node: int) -> int:
        sets, choices = self._sets, self.choices
        supports = [sets.supports[number] for number in chosen]
        here = choices.of_node[:, node].tolist()
        if not choices.requires[node] and all(map(choices.sets.within, supports, here)):
            return prod(sets.totals[number] for number in chosen)  # whatever they choose
        moves = [sets.moves[number] for number in chosen]
        total = 0
        for edge in self.space.out_edges(node):
            sets.work += 1
            labels = self._labels[edge]
            if all(label in own for own, label in zip(moves, labels, strict=True)):
                steps = (own[label] for own, label in zip(moves, labels, strict=True))
                times, after = zip(*steps, strict=True)
                total += prod(times) * self.good(after, self._targets[edge])
        self._check()
        return total

    def _check(self) -> None:
        if self._sets.work > self._most:
            raise TooManyToCount(
                "how often robots miscoordinate is not counted: that takes more than "
                f"{self._most:,} additions",
                remedy="Give smaller or fewer tasks.",
            )


#: Additions that take some seconds.
_QUICKLY = 2_000_000
#: Runs that are drawn where counting takes too long.
_RUNS = 1_000


@dataclass(frozen=True, slots=True)
class FailureEstimate:
    """The share of ``runs`` independent draws in which robots failed.

    ``low`` and ``high`` are the 95 % confidence interval, by Wilson's score.
    """

    value: float
    low: float
    high: float
    runs: int

    def text(self) -> str:
        """Return it as text, named as an estimate."""
        return (
            f"about {percent(self.value)} (estimated from {self.runs:,} draws: "
            f"{100 * self.low:.1f} to {100 * self.high:.1f} %)"
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
            data["failure_estimate"] = asdict(self.estimate)
        return data

    def text(self) -> str:
        """Return it as the end of a sentence, "robots .. fail ..": how often, over many tasks."""
        if self.mean is not None and self.worst is not None:
            return (
                f"fail in {percent(self.mean)} of all runs, and in "
                f"{percent(self.worst)} in the worst task"
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
        return Failures(*failure_probability(spaces, words, most))
    except TooManyToCount as error:
        return Failures(None, None, estimated_failure(spaces, words, _RUNS, seed=0), error.what)


def failures_under(partition: Partition, candidates: Candidates, *, is_claimed: bool) -> Failures:
    """Count how often robots fail under words in all candidate tasks.

    If it ``is_claimed`` by a language file it is counted whatever the work is, up to `MOST`
    additions; `TooManyToCount` if that cannot be.  Else only where that takes seconds.
    """
    if not is_claimed and estimate(candidates.source).is_large:
        return Failures(None, None, None, "there are too many tasks to do it at once")
    try:
        spaces = candidates.spaces
        words = [partition.word_of(space.rows)[space.state] for space in spaces]
        found = failures(spaces, words, MOST if is_claimed else _QUICKLY)
    except OutOfTime as error:
        stop_clock()
        found = Failures(None, None, None, error.what)
    if is_claimed and found.mean is None:
        raise TooManyToCount(
            f"what the language tolerates cannot be checked: {found.why_not}",
            remedy="Say --tasks FILE with fewer tasks.",
        )
    return found


def wilson(successes: int, runs: int) -> tuple[float, float]:
    """Return the 95 % confidence interval of a proportion, by Wilson's score (1927)."""
    share, z = successes / runs, 1.959963984540054  # above which 2.5 % of a normal variable are
    twice = 2 * (runs + z**2)
    middle = (2 * runs * share + z**2) / twice
    half = z / twice * sqrt(4 * runs * share * (1 - share) + z**2)
    return middle - half if successes else 0.0, middle + half if successes < runs else 1.0


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
    return FailureEstimate(failures / runs, *wilson(failures, runs), runs)


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
        return self.space.mixture_fails(start, plans)

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
