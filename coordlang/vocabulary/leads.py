# SPDX-License-Identifier: GPL-3.0-or-later
"""Leads: the words by which one plan's sentence is ahead of another's, numbered."""

from __future__ import annotations

import numpy as np

from planners.joint.tables import Ints

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

    def after(self, lead: Ints, first: Ints, second: Ints) -> Ints:
        """The leads when the plans enter words ``first`` and ``second``, or `NO_WORD`.

        `PARTED` where their sentences part.  One entry for each of ``lead``.
        """
        words = int(max(first.max(initial=NO_WORD), second.max(initial=NO_WORD))) + 2
        codes = (lead * words + (first + 1)) * words + (second + 1)
        different, of_code = np.unique(codes, return_inverse=True)
        leads, entered = np.divmod(different, words * words)
        mine, theirs = np.divmod(entered, words)
        rows = zip(leads.tolist(), (mine - 1).tolist(), (theirs - 1).tolist(), strict=True)
        found: Ints = np.array([self._one(row) for row in rows], np.int64)[of_code.reshape(-1)]
        return found

    def _one(self, key: tuple[int, int, int]) -> int:
        known = self._after.get(key)
        if known is None:
            known = self._after[key] = self._between(*key)
        return known

    def _between(self, lead: int, first: int, second: int) -> int:
        """The number of the lead when the plans enter these words."""
        ahead, words = self._leads[lead]
        mine = _entered(words if ahead == 1 else (), first)
        theirs = _entered(words if ahead == 2 else (), second)
        shared = min(len(mine), len(theirs))
        if mine[:shared] != theirs[:shared]:
            return PARTED
        if len(mine) == len(theirs):
            return NO_LEAD
        rest = (1, mine[shared:]) if len(mine) > shared else (2, theirs[shared:])
        if rest not in self._number:
            self._number[rest] = len(self._leads)
            self._leads.append(rest)
        return self._number[rest]


def _entered(words: tuple[int, ...], word: int) -> tuple[int, ...]:
    return words if word == NO_WORD else (*words, word)
