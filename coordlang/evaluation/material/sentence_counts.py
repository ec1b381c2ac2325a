"""What the plans of every candidate task say in a language.

Its sentences, and how many plans each of them has.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from coordlang.language.words import Language
from coordlang.tasks.candidates import Candidates
from planners.errors import OutOfMemory
from planners.search.plan_space import PlanSpace
from planners.tables import Ints

#: A sentence as word numbers.
Words = tuple[int, ...]

#: Tasks whose own numbers are kept in the results.
MOST_LISTED = 1000


@dataclass(frozen=True, slots=True)
class SentenceCounts:
    """The sentences of one task.

    ``steps``: the joint steps of its optimal plans.  ``plans``: sentence -> how many of them have
    it, exactly.  ``first`` and ``last``: the sentences of the first and of the last plan in the
    order of `planners.search.plans.Plans`.
    """

    steps: int
    plans: Mapping[Words, int]
    first: Words
    last: Words

    @property
    def count(self) -> int:
        """N, the number of optimal plans."""
        return sum(self.plans.values())

    @property
    def expected_open(self) -> Fraction:
        """Plans left open by the sentence of a plan drawn uniformly: sum of n_s^2 / N."""
        return Fraction(sum(n * n for n in self.plans.values()), self.count)

    @property
    def expected_words(self) -> Fraction:
        """Words of the sentence of a plan drawn uniformly."""
        return Fraction(sum(n * len(s) for s, n in self.plans.items()), self.count)

    @property
    def fewest_words(self) -> int:
        """Words of the shortest sentence."""
        return min(map(len, self.plans))

    def saving(self, words: Fraction | int) -> float:
        """Communication saving of a sentence.

        The share of the plan's states (steps + 1) that need no word.
        """
        return float(1 - Fraction(words) / (self.steps + 1))


def sentence_counts_in(candidates: Candidates, language: Language) -> Iterator[SentenceCounts]:
    """What each candidate task's plans say, task by task."""
    table = language.partition(candidates.model)
    for space in candidates.spaces:
        yield from said(space, table.word_of(space.rows)[space.state])


def said(space: PlanSpace, word: Ints) -> list[SentenceCounts]:
    """The sentences of the tasks of one plan space; ``word`` holds the word number of each node."""
    plans = sentence_counts(space, word)
    first = _ends(space, word, 0)
    last = _ends(space, word, -1)
    layer: list[int] = space.layer.tolist()
    return [SentenceCounts(layer[n], plans[n], first[n], last[n]) for n in space.starts.tolist()]


def sentence_counts(
    space: PlanSpace, word: Ints, keep: NDArray[np.bool_] | None = None, most: int | None = None
) -> list[Mapping[Words, int]]:
    """For each node: sentence -> how many plans from there have it.

    Only plans over edges of ``keep`` where it is given.

    Backward over the plan graph, for all tasks at once: O(edges * sentences of a node).  Raises
    `OutOfMemory` when that becomes more than ``most`` steps.
    """
    words: list[int] = word.tolist()
    plans: list[Mapping[Words, int]] = []
    work = 0
    bounds = zip(
        space.first[:-1].tolist(), space.first[1:].tolist(), space.layer.tolist(), strict=True
    )
    for node, (low, high, layer) in enumerate(bounds):
        if layer == 0:
            plans.append({(words[node],): 1})
            continue
        total: Counter[Words] = Counter()
        edges = slice(low, high)
        targets = space.target[edges] if keep is None else space.target[edges][keep[edges]]
        for target in targets.tolist():
            work += len(plans[target])
            for rest, number in plans[target].items():
                total[_in_front(words[node], rest)] += number
        if most is not None and work > most:
            raise OutOfMemory(f"the tasks have more than {most:,} sentences of parts of plans")
        plans.append(total)
    return plans


def _ends(space: PlanSpace, word: Ints, which: int) -> list[Words]:
    """For each node the sentence of the plan that always takes the first or the last edge.

    ``which`` is the edge's number (0: first, -1: last).
    """
    words: list[int] = word.tolist()
    found: list[Words] = []
    for node, (low, high) in enumerate(
        zip(space.first[:-1].tolist(), space.first[1:].tolist(), strict=True)
    ):
        if low == high:
            found.append((words[node],))
        else:
            found.append(_in_front(words[node], found[int(space.target[low:high][which])]))
    return found


def _in_front(word: int, rest: Words) -> Words:
    return rest if rest[0] == word else (word, *rest)
