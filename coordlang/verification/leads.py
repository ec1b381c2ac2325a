# SPDX-License-Identifier: GPL-3.0-or-later
"""Leads: by which words the sentence of one plan is ahead of that of another."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from planners.joint.tables import Ints, unique_codes

#: The other plan may say any word.
ANY = -1
#: The sentences differ for good.
NEVER = -2


class Leads:
    """Leads as numbers.  A lead is (who is ahead, the words ahead); number 0 is the empty lead.

    ``words`` counts the words of the language.  A plan *says* a word where it goes from a state
    with another word to a state with this one, and -1 (nothing new) elsewhere.
    """

    def __init__(self, words: int) -> None:
        self._radix = words + 1
        self._leads: list[tuple[bool, tuple[int, ...]]] = [(True, ())]
        self._numbers = {self._leads[0]: 0}
        self._after: dict[int, int] = {}
        self._wanted: dict[int, int] = {}

    def after(self, lead: Ints, first: Ints, other: Ints) -> Ints:
        """Leads after plan 1 said ``first`` and the other plan said ``other``; -1: they differ."""
        codes = (lead * self._radix + first + 1) * self._radix + other + 1
        return _each(codes, self._after, self._compute_after)

    def wanted(self, lead: Ints, first: Ints) -> Ints:
        """What the other plan may say now, but nothing, after plan 1 said ``first``.

        One word, `ANY` word, or `NEVER`: whatever it says, the sentences differ.
        """
        return _each(lead * self._radix + first + 1, self._wanted, self._compute_wanted)

    def _compute_after(self, code: int) -> int:
        rest, other = divmod(code, self._radix)
        mine, theirs = self._said(rest)
        theirs += (other - 1,) if other else ()
        common = min(len(mine), len(theirs))
        if mine[:common] != theirs[:common]:
            return -1
        ahead = (True, mine[common:]) if len(mine) >= len(theirs) else (False, theirs[common:])
        if ahead not in self._numbers:
            self._numbers[ahead] = len(self._leads)
            self._leads.append(ahead)
        return self._numbers[ahead]

    def _compute_wanted(self, code: int) -> int:
        mine, theirs = self._said(code)
        common = min(len(mine), len(theirs))
        if mine[:common] != theirs[:common]:
            return NEVER
        return mine[common] if len(mine) > common else ANY

    def _said(self, code: int) -> tuple[tuple[int, ...], tuple[int, ...]]:
        """The words of both plans that are not common, after plan 1 said its next word."""
        lead, first = divmod(code, self._radix)
        first_ahead, words = self._leads[lead]
        mine = (words if first_ahead else ()) + ((first - 1,) if first else ())
        return mine, () if first_ahead else words


def _each(codes: Ints, known: dict[int, int], compute: Callable[[int], int]) -> Ints:
    """A function of codes, computed once for each."""
    position, inverse = unique_codes(codes)
    different = codes[position].tolist()
    for code in different:
        if code not in known:
            known[code] = compute(code)
    return np.array([known[code] for code in different], np.int64)[inverse]
