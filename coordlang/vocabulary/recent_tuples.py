# SPDX-License-Identifier: GPL-3.0-or-later
"""Failing tuples that agreed under some partition before: asked first, for they often do again."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import groupby

import numpy as np

from coordlang.vocabulary.failing_tuples import Agreeing, agreeing_rows
from coordlang.vocabulary.refuter import Refuter
from planners.joint.tables import Ints


@dataclass(frozen=True, slots=True)
class _OfLength:
    """Images of tuples of one length.

    ``by_step`` (length, robots, images) their states, ``source`` (2, images): the number of the
    symmetry, in the order of meeting, and the tuple's row.
    """

    by_step: Ints
    source: Ints


@dataclass(slots=True)
class RecentTuples:
    """Images of failing tuples that agreed, of all that a refuter knows.

    Attributes
    ----------
    refuter
        Is asked where few of them agree.
    enough
        Longer tuples are left out of its answers once there are so many.
    least
        It is asked where fewer of them agree.
    """

    refuter: Refuter
    enough: int
    least: int = 1
    _tables: dict[int, _OfLength] = field(default_factory=dict)
    _images: list[Ints] = field(default_factory=list)

    def agreeing(self, word: Ints, images: Sequence[Ints] | None = None) -> list[Agreeing]:
        """Failing tuples that a partition does not tell apart; none if it is a language.

        See `Refuter.agreeing`.
        """
        known = list(self._still_agreeing(word))
        if sum(len(found.rows) for found in known) >= self.least:
            return known
        every = self.refuter.agreeing(word, images, self.enough)
        self._add(every, known)
        return every

    def _still_agreeing(self, word: Ints) -> Iterator[Agreeing]:
        """Those to which a partition gives one sentence, short ones first."""
        for length, table in sorted(self._tables.items()):
            image, row = table.source[:, agreeing_rows(word, table.by_step)]
            for number in np.unique(image).tolist():
                yield Agreeing(length, self._images[number], row[image == number])

    def _add(self, agreeing: Sequence[Agreeing], known: Sequence[Agreeing]) -> None:
        """Remember images of tuples; ``known`` are those of them that are remembered."""
        number_of = {id(to): number for number, to in enumerate(self._images)}
        old = {(found.length, id(found.to)): found.rows for found in known}
        for length, together in groupby(agreeing, key=lambda found: found.length):
            parts = [self._tables[length]] if length in self._tables else []
            for found in together:
                key = (length, id(found.to))
                rows = np.setdiff1d(found.rows, old[key]) if key in old else found.rows
                if id(found.to) not in number_of:
                    number_of[id(found.to)] = len(self._images)
                    self._images.append(found.to)
                states = self.refuter.pool.sequences(found, rows)
                source = np.stack((np.full(len(rows), number_of[id(found.to)]), rows))
                parts.append(_OfLength(states.transpose(2, 1, 0), source))
            self._tables[length] = _OfLength(
                np.concatenate([part.by_step for part in parts], axis=2),
                np.concatenate([part.source for part in parts], axis=1),
            )
