# SPDX-License-Identifier: GPL-3.0-or-later
"""How much a language leaves open, and how much it need not say.

*Flexibility* of a task: draw one of its N optimal plans uniformly and say its sentence.  With
``n_s`` plans that have the sentence s, ``n_s`` plans are then open.  The expectation is ``E = sum_s
n_s^2 / N``; 1 where the sentence gives every plan away, N where one sentence holds all of them.

*Communication saving* of a plan: ``1 - len(sentence) / len(state sequence)``, the share of its
states that need no word.  The paper's figures on GWB7, 33.3 % over the 784 plans whose sentence is
shorter and 27.3 % over all 956, agree with each other only if a plan whose sentence is not shorter
saves nothing (33.3 % * 784 / 956 = 27.3 %).  Measured against the joint *actions* of the plan, one
fewer than its states, such a plan would save less than nothing.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from planners.joint.tables import Ints, ranges
from planners.search.plan_space import PlanSpace
from planners.search.plans import counts
from planners.system.errors import OutOfMemory
from planners.system.limits import memory_left, more_memory

Floats = NDArray[np.float64]

#: More plans than this are not told apart by the measures: it is near the largest float.
MANY = 10**300


@dataclass(frozen=True, slots=True)
class Flexibility:
    """Measures of a partition, one entry for each candidate task.

    The tasks of all plan spaces, in their order.

    ``plans``: N, exact.  ``expected``: plans left open in expectation over a plan drawn uniformly.
    ``first``: plans left open by the sentence of the first plan in our order.  ``most``: plans left
    open by the sentence that leaves most. ``words`` and ``first_words``: words of a sentence, in
    expectation and for the first plan.  ``steps``: joint steps of the task's plans.  Numbers of
    plans are floats with a relative error below 1e-12; a task with more than `MANY` counts as one
    with so many.
    """

    plans: tuple[int, ...]
    expected: Floats
    first: Floats
    most: Floats
    words: Floats
    first_words: Floats
    steps: Ints

    @property
    def value(self) -> float:
        """Plans left open, averaged over the tasks: what ``--prefer flexible`` maximises."""
        return float(self.expected.mean())

    @property
    def saving(self) -> Floats:
        """Expected communication saving of each task's plans, against the states of a plan."""
        return 1 - self.words / (self.steps + 1)


def flexibility(spaces: Sequence[PlanSpace], words: Sequence[Ints]) -> Flexibility:
    """Measure a partition; ``words[k]`` holds the word number of each node of ``spaces[k]``.

    Backward over the plan graphs: for every node the sentences of the plans from it with the share
    of the plans that each holds, for all tasks at once.  Shares are sums of products of positive
    numbers, so 64-bit floats lose nothing that matters, however many plans there are.  O(edges *
    sentences of a node).  Raises `OutOfMemory` when the sentences become too many to hold.
    """
    parts = [_measure(space, word) for space, word in zip(spaces, words, strict=True)]
    _, *columns = (field.name for field in fields(Flexibility))
    return Flexibility(
        tuple(n for part in parts for n in part.plans),
        *(np.concatenate([getattr(part, name) for part in parts]) for name in columns),
    )


def edge_shares(space: PlanSpace, counted: Sequence[int]) -> Floats:
    """For each edge the share of its source's plans that go over it.

    ``counted`` is `planners.search.plans.counts`.
    """
    source, target = space.sources, space.targets()
    if max(counted, default=0) < 2**53:
        number = np.array(counted, np.float64)
        return number[target] / number[source]
    pairs = zip(target.tolist(), source.tolist(), strict=True)
    return np.array([counted[t] / counted[s] for t, s in pairs], np.float64)


class Sentences:
    """Sentences as numbers: a word in front of a shorter sentence.  Number 0 is the empty one."""

    def __init__(self) -> None:
        self._number: dict[tuple[int, int], int] = {}
        self._length = [0]

    def front(self, word: Ints, rest: Ints) -> Ints:
        """The numbers of the sentences ``word`` + ``rest``."""
        size = int(word.max(initial=0)) + 1
        different, inverse = np.unique(rest * size + word, return_inverse=True)
        return np.array(
            [self._one(code % size, code // size) for code in different.tolist()], np.int64
        )[inverse]

    def _one(self, word: int, rest: int) -> int:
        number = self._number.setdefault((word, rest), len(self._length))
        if number == len(self._length):
            self._length.append(self._length[rest] + 1)
        return number

    @property
    def parts(self) -> tuple[Ints, Ints]:
        """Each sentence's first word and the sentence that follows; -1 and 0 of the empty one."""
        pairs = np.array([(-1, 0), *self._number], np.int64)
        return pairs[:, 0], pairs[:, 1]

    @property
    def lengths(self) -> Ints:
        """The number of words of each sentence."""
        return np.array(self._length, np.int64)


def _measure(space: PlanSpace, word: Ints) -> Flexibility:
    counted = counts(space)
    share_of_edge = edge_shares(space, counted)
    sentences = Sentences()
    first_sentence = np.zeros(len(space), np.int64)
    # The entries of the layer below, sorted by node: each one's node, sentence and share.
    node, said, share = np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros(0)
    starts = np.unique(space.starts)
    together, most, words, first = (np.zeros(len(space)) for _ in range(4))
    for number, span in enumerate(space.layers):
        if number == 0:
            node = np.arange(span.start, span.stop)
            said = sentences.front(word[node], np.zeros(len(node), np.int64))
            share = np.ones(len(node))
            first_sentence[node] = said
        else:
            above = space.layer_edges(number)
            target, source = above.target, above.source
            low, high = np.searchsorted(node, target), np.searchsorted(node, target, "right")
            _check_memory(int((high - low).sum()))
            entry, of = ranges(low, high - low), np.repeat(np.arange(len(source)), high - low)
            new = said_from(sentences, word, source[of], target[of], said[entry])
            weight = share[entry] * share_of_edge[above.edges][of]
            here = np.arange(span.start, span.stop)
            follows = space.targets(space.first_edges(here))
            first_sentence[here] = said_from(
                sentences, word, here, follows, first_sentence[follows]
            )
            node, said, share = summed(source[of], new, weight)
        mine = starts[(starts >= span.start) & (starts < span.stop)]
        if len(mine):
            kept = np.isin(node, mine)
            at, holds, what = node[kept], share[kept], said[kept]
            np.add.at(together, at, holds**2)
            np.maximum.at(most, at, holds)
            np.add.at(words, at, holds * sentences.lengths[what])
            np.add.at(first, at, np.where(what == first_sentence[at], holds, 0.0))
    at = space.starts
    plans = tuple(counted[n] for n in at.tolist())
    total = np.array([float(min(n, MANY)) for n in plans], np.float64)
    return Flexibility(
        plans,
        total * together[at],
        total * first[at],
        total * most[at],
        words[at],
        sentences.lengths[first_sentence[at]].astype(np.float64),
        space.layer[at],
    )


def said_from(sentences: Sentences, word: Ints, source: Ints, target: Ints, rest: Ints) -> Ints:
    """The sentences from ``source``, given those from ``target`` on.

    A word more where it is a new one.
    """
    result = rest.copy()
    fresh = word[source] != word[target]
    if fresh.any():
        result[fresh] = sentences.front(word[source[fresh]], rest[fresh])
    return result


def summed(node: Ints, said: Ints, share: Floats) -> tuple[Ints, Ints, Floats]:
    """Entries of one node and sentence added up, sorted by node."""
    size = int(said.max(initial=0)) + 1
    code, inverse = np.unique(node * size + said, return_inverse=True)
    total: Floats = np.bincount(inverse.reshape(-1), share, minlength=len(code)).astype(np.float64)
    return code // size, code % size, total


def _check_memory(entries: int) -> None:
    # Node, sentence and share, and what sorting them takes for a moment.
    if 100 * entries > memory_left():
        raise OutOfMemory(
            f"{entries:,} sentences at once are too many to measure a language by",
            remedy=f"Measure fewer tasks at a time, or use {more_memory()}.",
        )
