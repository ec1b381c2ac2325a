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
_UNKNOWN = -3

#: Entries of a table that holds what is known of leads.
_LARGEST_TABLE = 4_000_000


class Leads:
    """Leads as numbers.  A lead is (who is ahead, the words ahead); number 0 is the empty lead.

    ``words`` counts the words of the language.  A plan *says* a word where it goes from a state
    with another word to a state with this one, and -1 (nothing new) elsewhere.
    """

    def __init__(self, words: int) -> None:
        self._radix = words + 1
        self._leads: list[tuple[bool, tuple[int, ...]]] = [(True, ())]
        self._numbers = {self._leads[0]: 0}
        self._known_after = _Table()
        self._known_wanted = _Table()

    def after(self, lead: Ints, first: Ints, other: Ints) -> Ints:
        """Leads after plan 1 said ``first`` and the other plan said ``other``; -1: they differ."""
        codes = (lead * self._radix + first + 1) * self._radix + other + 1
        return self._known_after.each(codes, self._compute_after)

    def wanted(self, lead: Ints, first: Ints) -> Ints:
        """What the other plan may say now, but nothing, after plan 1 said ``first``.

        One word, `ANY` word, or `NEVER`: whatever it says, the sentences differ.
        """
        return self._known_wanted.each(lead * self._radix + first + 1, self._compute_wanted)

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


class _Table:
    """A function of codes, computed once for each: in a table where the codes are small."""

    def __init__(self) -> None:
        self._table = np.full(0, _UNKNOWN)
        self._rest: dict[int, int] = {}

    def each(self, codes: Ints, compute: Callable[[int], int]) -> Ints:
        """The values of many codes."""
        most = int(codes.max(initial=-1)) + 1
        if most > _LARGEST_TABLE:
            return self._each_of_large(codes, compute)
        if most > len(self._table):
            more = np.full(max(most, 2 * len(self._table)), _UNKNOWN)
            more[: len(self._table)] = self._table
            self._table = more
        unknown = codes[self._table[codes] == _UNKNOWN]
        for code in sorted(set(unknown.tolist())):
            self._table[code] = compute(code)
        found: Ints = self._table[codes]
        return found

    def _each_of_large(self, codes: Ints, compute: Callable[[int], int]) -> Ints:
        position, inverse = unique_codes(codes)
        values = []
        for code in codes[position].tolist():
            if code not in self._rest:
                self._rest[code] = compute(code)
            values.append(self._rest[code])
        return np.array(values, np.int64)[inverse]
