# SPDX-License-Identifier: GPL-3.0-or-later
"""Leads: the words by which one plan's sentence is ahead of another's, numbered."""

from __future__ import annotations

import numpy as np

from planners.tables import Ints, unique_tuples

#: The lead of two sentences that are alike.
NO_LEAD = 0
#: What follows where neither sentence is the beginning of the other.
PARTED = -1
#: In place of a word where a plan goes on in the word where it is.
NO_WORD = -1


class Leads:
    """Numbers of leads, as they are met.

    A lead is which of two plans is ahead, 1 or 2, and the words; `NO_LEAD` is (0, no words).
    """

    def __init__(self) -> None:
        self._leads: list[tuple[int, tuple[int, ...]]] = [(0, ())]
        self._number = {self._leads[NO_LEAD]: NO_LEAD}
        self._after: dict[tuple[int, int, int], int] = {}

    def words(self, lead: int) -> tuple[int, tuple[int, ...]]:
        """Which of the two plans is ahead, 1 or 2 (0: neither), and by which words."""
        return self._leads[lead]

    def after(self, lead: Ints, first: Ints, second: Ints) -> Ints:
        """The leads when the plans enter words ``first`` and ``second``, or `NO_WORD`.

        `PARTED` where their sentences part.  One entry for each of ``lead``.
        """
        if not len(lead):
            return lead
        table = np.column_stack((lead, first + 1, second + 1))
        bounds = [int(table[:, k].max()) + 1 for k in range(3)]
        different, inverse = unique_tuples(table, bounds)
        numbers = [self._one(a, b - 1, c - 1) for a, b, c in different.tolist()]
        return np.array(numbers, np.int64)[inverse]

    def _one(self, lead: int, first: int, second: int) -> int:
        key = (lead, first, second)
        if key not in self._after:
            ahead, words = self._leads[lead]
            mine = _entered(words if ahead == 1 else (), first)
            theirs = _entered(words if ahead == 2 else (), second)
            self._after[key] = self._between(mine, theirs)
        return self._after[key]

    def _between(self, mine: tuple[int, ...], theirs: tuple[int, ...]) -> int:
        """The number of the lead between two sentences."""
        shared = min(len(mine), len(theirs))
        if mine[:shared] != theirs[:shared]:
            return PARTED
        if len(mine) == len(theirs):
            return NO_LEAD
        lead = (1, mine[shared:]) if len(mine) > shared else (2, theirs[shared:])
        if lead not in self._number:
            self._number[lead] = len(self._leads)
            self._leads.append(lead)
        return self._number[lead]


def _entered(words: tuple[int, ...], word: int) -> tuple[int, ...]:
    return words if word == NO_WORD else (*words, word)
