# SPDX-License-Identifier: GPL-3.0-or-later
"""Clauses as arrays, with the clauses of each orbit of states: what local search asks and changes.

A clause holds under a partition iff one of its pairs of states has two words.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from coordlang.vocabulary.distinct_rows import MULTIPLIER
from coordlang.vocabulary.orbit_words import OrbitWords
from planners.joint.tables import Bools, Ints

#: Clause and orbit as one number.
_RADIX = 1 << 32


class ClauseTable:
    """A growing table of clauses about one kind of partition.

    Parameters
    ----------
    kind
        What is looked for; its orbits are the variables.
    images
        The symmetries whose images of a clause are added with it.

    Attributes
    ----------
    first, second
        (clauses, pairs) the states of the pairs; rows are filled up with a state and itself.
    clauses_of
        For each orbit the clauses with a pair of one of its states and one of another orbit or
        its own.
    pairs_of
        For each orbit, how many pairs of each of these clauses have a state of it.
    """

    def __init__(self, kind: OrbitWords, images: Sequence[Ints]) -> None:
        self.kind, self._images = kind, images
        self.first = self.second = np.zeros((0, 1), np.int64)
        self.clauses_of = [np.zeros(0, np.int64) for _ in kind.members]
        self.pairs_of = [np.zeros(0, np.int64) for _ in kind.members]
        self._count = 0
        self._known = np.zeros(0, np.uint64)

    def __len__(self) -> int:
        return self._count

    def add(self, pairs: Ints) -> int:
        """Add clauses with their images; how many of them are new.

        Parameters
        ----------
        pairs
            (clauses, pairs) codes ``a * states + b``, -1 where a clause has fewer pairs.
        """
        codes = _rows_of_sets(self._all_images(pairs))
        keys, place = np.unique(_keys(codes), return_index=True)
        new = ~np.isin(keys, self._known)
        codes = codes[np.sort(place[new])]
        if len(codes):
            self._known = np.concatenate((self._known, keys[new]))
            states = len(self.kind.orbit)
            self._append(*(np.where(codes < 0, 0, part) for part in divmod(codes, states)))
        return len(codes)

    def separated(self, word: Ints, clauses: Ints | None = None) -> Ints:
        """How many pairs of some of the clauses, or of all, have two words."""
        chosen = slice(self._count) if clauses is None else clauses
        apart: Bools = word[self.first[chosen]] != word[self.second[chosen]]
        separated: Ints = apart.sum(axis=1)
        return separated

    def _all_images(self, pairs: Ints) -> Ints:
        states = len(self.kind.orbit)
        a, b = divmod(pairs, states)
        images = []
        for to in self._images:
            x, y = to[a], to[b]
            codes = np.minimum(x, y) * states + np.maximum(x, y)
            images.append(np.where(pairs < 0, -1, codes))
        return np.concatenate(images)

    def _append(self, first: Ints, second: Ints) -> None:
        begin, end = self._count, self._count + len(first)
        if end > len(self.first) or first.shape[1] > self.first.shape[1]:
            rows = 2 * end if end > len(self.first) else len(self.first)
            shape = rows, max(first.shape[1], self.first.shape[1])
            self.first, self.second = (_grown(old, shape) for old in (self.first, self.second))
        self.first[begin:end, : first.shape[1]] = first
        self.second[begin:end, : first.shape[1]] = second
        self._count = end
        self._note(first, second, begin)

    def _note(self, first: Ints, second: Ints, begin: int) -> None:
        """Write new clauses, numbered from ``begin``, to the orbits of their states."""
        row, column = np.nonzero(first != second)
        one, other = (self.kind.orbit[part[row, column]] for part in (first, second))
        both = np.concatenate((one, other[one != other]))
        clauses = np.concatenate((row, row[one != other])) + begin
        codes, pairs = np.unique(both * _RADIX + clauses, return_counts=True)
        orbits, clauses = divmod(codes, _RADIX)
        bounds = np.searchsorted(orbits, np.arange(len(self.clauses_of) + 1)).tolist()
        for orbit in np.unique(orbits).tolist():
            mine = slice(bounds[orbit], bounds[orbit + 1])
            self.clauses_of[orbit] = np.concatenate((self.clauses_of[orbit], clauses[mine]))
            self.pairs_of[orbit] = np.concatenate((self.pairs_of[orbit], pairs[mine]))


def _rows_of_sets(codes: Ints) -> Ints:
    """Each row without repetitions, sorted downwards, with -1 at its end."""
    codes = np.sort(codes, axis=1)
    codes[:, :-1][codes[:, 1:] == codes[:, :-1]] = -1
    codes = -np.sort(-codes, axis=1)
    return codes[:, : max(1, int((codes >= 0).sum(axis=1).max(initial=0)))]


def _keys(codes: Ints) -> np.ndarray[tuple[int, ...], np.dtype[np.uint64]]:
    """A number for each row, whatever number of -1 is at its end.

    Different clauses have different keys, nearly always; others are lost.
    """
    keys = np.zeros(len(codes), np.uint64)
    for column in codes.T:
        mixed = (keys ^ (column + 1).astype(np.uint64)) * MULTIPLIER
        mixed ^= mixed >> np.uint64(29)
        keys = np.where(column >= 0, mixed, keys)
    return keys


def _grown(old: Ints, shape: tuple[int, int]) -> Ints:
    new = np.zeros(shape, np.int64)
    new[: old.shape[0], : old.shape[1]] = old
    return new
