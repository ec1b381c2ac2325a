# SPDX-License-Identifier: GPL-3.0-or-later
"""Merging from below: two words of a language become one, as long as it stays a language.

What a partition does not tell apart no coarser one does.  A merge that fails once fails for
ever, also of words that hold the two (Proposition 21 of docs/concepts.md).  So the failing plans
met so far are asked about all merges at once, and tasks are searched only for one that none of
them forbids.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from coordlang.vocabulary.failing_tuples import FailingTuples, Shape, sequences_agree
from coordlang.vocabulary.job import Assignment, words_of_states
from coordlang.vocabulary.languages import Languages
from coordlang.vocabulary.sat import Undecided
from planners.joint.tables import Bools, Ints

#: Steps of robots that may be looked at to decide a merge, at first: some seconds.
_STEPS = 2_000_000
#: Failing tuples, under one symmetry, that are asked together: some megabytes.
_TOGETHER = 100_000


def merged(
    language: Assignment, states: Sequence[int], languages: Languages
) -> Iterator[dict[int, int]]:
    """Languages with fewer and fewer words, made from each other by merging words.

    Those words are merged that hold the fewest states together.  Tasks are searched after some
    merges, which are taken back if they fail, and twice as many the next time if not.  A merge that
    takes too long to decide is left for later, and then given twice the work.  Of the last language
    no two words can be merged.  The best one so far comes after each search.

    ``language`` is the one to begin with, ``states`` are those that need words, and
    ``languages`` tells what is wrong with a partition.
    """
    mine, pool = np.array(states), languages.pool
    word = words_of_states(language, pool.states)
    _, word[mine] = np.unique(word[mine], return_inverse=True)
    closed, left = forbidden_merges(pool, word, {}), False
    merges, steps = 1, _STEPS
    while True:
        pair = _next_merge(word[mine], closed)
        if pair is None:
            if not left:
                return
            closed, left, steps = forbidden_merges(pool, word, {}), False, 2 * steps
            continue
        trial, of_trial = _merged_often(word, closed, pair, mine, merges)
        known = {shape: own.shape[2] for shape, own in pool.by_shape.items()}
        try:
            holds = not languages.agreeing(trial, None, 1, steps)
        except Undecided:
            holds = False
            if merges == 1:
                closed[pair] = closed[pair[::-1]] = left = True
        if holds:
            word, merges = trial, 2 * merges
            closed = of_trial | forbidden_merges(pool, word, {})
        else:
            merges = max(1, merges // 2)
            closed |= forbidden_merges(pool, word, known)
        yield {state: int(word[state]) for state in states}


def forbidden_merges(pool: FailingTuples, word: Ints, known: Mapping[Shape, int]) -> Bools:
    """(words, words) the pairs of words of a language that some failing tuple forbids to merge.

    Those after whose merge all its sequences have one sentence.  Of two sentences the words that
    differ first become one, or one of them becomes the word before: three pairs can do that.
    ``known`` says how many tuples of each shape are not asked.
    """
    forbidden = np.eye(int(word.max()) + 1, dtype=np.bool_)
    for shape, by_step in sorted(pool.by_shape.items()):
        for first in range(known.get(shape, 0), by_step.shape[2], _TOGETHER):
            some = by_step[:, :, first : first + _TOGETHER]
            for to in pool.images:
                _forbid(forbidden, word[to].take(some))
    return forbidden


def _forbid(forbidden: Bools, said: Ints) -> None:
    """Note the merges after which sequences, by their words (length, plans, tuples), agree."""
    entered = np.zeros(said.shape, np.int64)
    entered[1:] = (said[1:] != said[:-1]).cumsum(axis=0)
    sentence = np.full(said.shape, -1)
    np.put_along_axis(sentence, entered, said, axis=0)
    other = (sentence[:, 1:] != sentence[:, :1]).any(axis=0).argmax(axis=0) + 1
    every = np.arange(said.shape[2])
    one, two = sentence[:, 0], sentence[:, other, every]
    first = (one != two).argmax(axis=0)
    before, x, y = one[first - 1, every], one[first, every], two[first, every]
    for a, b in ((x, y), (x, before), (y, before)):
        rows = np.flatnonzero((a >= 0) & (b >= 0) & ~forbidden[a, b])
        into, gone = np.minimum(a, b)[rows], np.maximum(a, b)[rows]
        words = said[:, :, rows]
        agree = sequences_agree(np.where(words == gone, into, words))
        forbidden[into[agree], gone[agree]] = forbidden[gone[agree], into[agree]] = True


def _merged_often(
    word: Ints, forbidden: Bools, pair: tuple[int, int], mine: Ints, merges: int
) -> tuple[Ints, Bools]:
    """The words, and what is forbidden, after a merge and more, so many or as many as there are."""
    word, forbidden = _merge(word, forbidden, pair)
    for _ in range(merges - 1):
        if (further := _next_merge(word[mine], forbidden)) is None:
            break
        word, forbidden = _merge(word, forbidden, further)
    return word, forbidden


def _next_merge(word: Ints, forbidden: Bools) -> tuple[int, int] | None:
    """Of the words of some states two that may be merged, with the fewest; None if none may."""
    if forbidden.all():
        return None
    size = np.bincount(word, minlength=len(forbidden))
    together = np.where(forbidden, 2 * len(word) + 1, size[:, None] + size)
    a, b = divmod(int(together.argmin()), len(forbidden))
    return a, b


def _merge(word: Ints, forbidden: Bools, pair: tuple[int, int]) -> tuple[Ints, Bools]:
    """The words, and the merges that are forbidden, after two became one."""
    into, gone = pair
    word = np.where(word == gone, into, word)
    forbidden = forbidden.copy()
    forbidden[into] |= forbidden[gone]
    forbidden[:, into] |= forbidden[:, gone]
    left = np.delete(np.delete(forbidden, gone, axis=0), gone, axis=1)
    return word - (word > gone), left
