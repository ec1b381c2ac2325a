# SPDX-License-Identifier: GPL-3.0-or-later
"""Weighted sets of label sequences: how many plans have each sequence, up to a common factor.

As `coordlang.required.label_sets`, with multiplicities: a weighted set of sequences of one length
is written as its moves, each first label with a positive integer and the weighted set of what may
follow.  The greatest common divisor of all weights is taken out, so that sets that differ by a
factor only are one: the number of interleavings of others' moves does not matter.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable
from math import gcd

from coordlang.required.label_sets import LabelSets

#: The weighted set that holds only the empty sequence, once.
END = 0
#: So many times a weighted set, by number.
Multiple = tuple[int, int]


class WeightedSets:
    """All weighted sets that were met, by number; equal ones have one number.

    ``sets`` numbers their supports, the sequences without weights.  ``work`` counts the multiples
    that were added up.
    """

    def __init__(self, sets: LabelSets) -> None:
        self.sets = sets
        self.work = 0
        #: Each first label of a set with the multiple of what follows.
        self.moves: list[dict[int, Multiple]] = [{}]
        #: How many sequences a set has, with their weights.
        self.totals: list[int] = [1]
        #: The set of its sequences, in ``sets``.
        self.supports: list[int] = [END]
        self._number: dict[tuple[tuple[int, int, int], ...], int] = {}
        self._sums: dict[tuple[Multiple, ...], Multiple] = {}

    def __len__(self) -> int:
        """Count the different weighted sets."""
        return len(self.moves)

    def of_moves(self, moves: dict[int, list[Multiple]]) -> Multiple:
        """The weighted set in which each first label is followed by the sum of some multiples."""
        added = {label: self.sum(moves[label]) for label in sorted(moves)}
        factor = gcd(*(times for times, _ in added.values()))
        key = tuple((label, times // factor, after) for label, (times, after) in added.items())
        known = self._number.get(key)
        if known is None:
            known = self._number[key] = len(self.moves)
            self.moves.append({label: (times, after) for label, times, after in key})
            self.totals.append(sum(times * self.totals[after] for _, times, after in key))
            self.supports.append(
                self.sets.of_moves({label: self.supports[after] for label, _, after in key})
            )
        return factor, known

    def sum(self, multiples: Iterable[Multiple]) -> Multiple:
        """The sum of some multiples, at least one, of sets of sequences of one length."""
        times_of: dict[int, int] = defaultdict(int)
        for times, number in multiples:
            times_of[number] += times
            self.work += 1
        if len(times_of) == 1:
            ((number, times),) = times_of.items()
            return times, number
        factor = gcd(*times_of.values())
        key = tuple((times_of[number] // factor, number) for number in sorted(times_of))
        known = self._sums.get(key)
        if known is None:
            moves: dict[int, list[Multiple]] = defaultdict(list)
            for times, number in key:
                for label, (weight, after) in self.moves[number].items():
                    moves[label].append((times * weight, after))
            known = self._sums[key] = self.of_moves(moves)
        times, number = known
        return factor * times, number
