# SPDX-License-Identifier: GPL-3.0-or-later
"""Merging from below: two words of a language become one, as long as it stays a language.

What a partition does not tell apart no coarser one does.  A merge that fails once fails for
ever, also of words that hold the two (Proposition 21 of docs/concepts.md), and the clauses of
failed merges say which other ones fail.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from coordlang.symmetry.subgroups import WordAction, group_table
from coordlang.vocabulary.clause_table import ClauseTable
from coordlang.vocabulary.job import Assignment
from coordlang.vocabulary.orbit_words import OrbitWords
from coordlang.vocabulary.refuter import Refuter
from planners.joint.tables import Bools, Ints

#: Failing tuples after which longer ones are not looked for, and clauses that are taken of them.
_ENOUGH, _AT_ONCE = 500, 300


def merged(
    language: Assignment, states: Sequence[int], refuter: Refuter, seed: int = 0
) -> Iterator[dict[int, int]]:
    """Languages with fewer and fewer words, made from each other by merging words.

    Those words are merged that fail to merge with the most others in common: as when a graph is
    coloured by contraction (Zykov).  Of the last one no two words can be merged.  Known failing
    plans are asked before every merge; tasks are walked after some, which are taken back if they
    fail, and twice as many the next time if not.

    Parameters
    ----------
    language
        The language to begin with.
    states
        Numbers of the states that need words.
    refuter
        Tells what is wrong with a partition.
    seed
        Of what is drawn at random: which clauses are taken.
    """
    random = np.random.default_rng(seed)
    word = _numbered(language, states, refuter.pool.states)
    table = _table(states, refuter, int(word.max()) + 1)
    merges = 1
    while True:
        trial = word
        for _ in range(merges):
            trial = _merge_best(trial, table, refuter, random)
        if trial.max() == word.max():
            return
        agreeing = refuter.agreeing(trial, None, _ENOUGH)
        if agreeing:
            table.add(refuter.pool.codes(trial, agreeing, _AT_ONCE, random))
            merges = max(1, merges // 2)
        else:
            word, merges = trial, 2 * merges
            yield {state: int(word[state]) for state in states}


def _merge_best(
    word: Ints, table: ClauseTable, refuter: Refuter, random: np.random.Generator
) -> Ints:
    """The words after the best merge that no known failing plans refute; the same if none is."""
    while (pair := _best_merge(forbidden_merges(table, word))) is not None:
        trial = np.where(word == pair[1], pair[0], word)
        trial -= trial > pair[1]
        agreeing = refuter.pool.agreeing(trial, None, _ENOUGH)
        if not agreeing:
            return trial
        table.add(refuter.pool.codes(trial, agreeing, _AT_ONCE, random))
    return word


def forbidden_merges(table: ClauseTable, word: Ints) -> Bools:
    """(words, words) the pairs of words of a language that some clause forbids to merge.

    A clause does whose separated pairs all have these two words.
    """
    words = int(word.max()) + 1
    one, other = word[table.first[: len(table)]], word[table.second[: len(table)]]
    codes = np.minimum(one, other) * words + np.maximum(one, other)
    least = np.where(one == other, words**2, codes).min(axis=1)
    only = least == np.where(one == other, -1, codes).max(axis=1)
    a, b = divmod(least[only], words)
    forbidden = np.eye(words, dtype=np.bool_)
    forbidden[a, b] = forbidden[b, a] = True
    return forbidden


def _best_merge(forbidden: Bools) -> tuple[int, int] | None:
    """The allowed pair with the most words that neither may be merged with; the first of such."""
    if forbidden.all():
        return None
    share = forbidden.astype(np.int64)
    common = np.where(forbidden, -1, share @ share)
    a, b = divmod(int(common.argmax()), len(common))
    return min(a, b), max(a, b)


def _numbered(language: Assignment, states: Sequence[int], rows: int) -> Ints:
    """The word of each state number, words from 0 on without gaps."""
    word = np.zeros(rows, np.int64)
    _, numbers = np.unique([language[state] for state in states], return_inverse=True)
    word[list(states)] = numbers
    return word


def _table(states: Sequence[int], refuter: Refuter, size: int) -> ClauseTable:
    images = refuter.pool.images
    alone = WordAction({0: tuple(range(size))})
    kind = OrbitWords.of(states, group_table(images), alone, size)
    assert kind is not None, "the identity fixes all words"
    return ClauseTable(kind, images)
