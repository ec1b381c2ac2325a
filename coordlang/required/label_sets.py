# SPDX-License-Identifier: GPL-3.0-or-later
"""Sets of label sequences, each kept once: canonical, deterministic, acyclic automata.

A set of sequences of one length is written as its *moves*: each first label with the set of what
may follow it.  Equal sets have one number, as in a decision diagram, so that equality is equality
of numbers, and unions and inclusions are worked out once for each different pair.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from planners.joint.tables import Bools, Ints, unique_tuples

#: The set that holds only the empty sequence.
END = 0
#: Up to so many entries for each pair that is asked for, a table of all pairs of sets is filled in
#: place of sorting.
_TABLE = 32


class LabelSets:
    """All sets of label sequences that were met, by number.

    Numbers are nodes of a trie over moves ``(label, what follows)`` in the order of labels, so each
    beginning of a set's moves is a set too.  All sequences of a set have one length.
    """

    def __init__(self) -> None:
        self._child: dict[tuple[int, int, int], int] = {}
        self._parent: list[tuple[int, int, int]] = [(END, -1, -1)]
        self._moves: list[dict[int, int] | None] = [{}]
        self._union: dict[tuple[int, int], int] = {}
        self._within: dict[tuple[int, int], bool] = {}

    def __len__(self) -> int:
        """Count the different sets."""
        return len(self._parent)

    def moves(self, number: int) -> dict[int, int]:
        """Each first label of a set with the number of the set of what follows it."""
        found = self._moves[number]
        if found is None:
            path = []
            at = number
            while at != END:
                at, label, after = self._parent[at]
                path.append((label, after))
            found = self._moves[number] = dict(reversed(path))
        return found

    def of_moves(self, moves: dict[int, int]) -> int:
        """The number of the set with these moves."""
        number = END
        for label in sorted(moves):
            number = self._extended(number, label, moves[label])
        return number

    def _extended(self, number: int, label: int, after: int) -> int:
        key = (number, label, after)
        known = self._child.get(key)
        if known is None:
            known = self._child[key] = len(self._parent)
            self._parent.append(key)
            self._moves.append(None)
        return known

    def union(self, one: int, other: int) -> int:
        """The union of two sets of sequences of one length."""
        if one == other:
            return one
        key = (one, other) if one < other else (other, one)
        known = self._union.get(key)
        if known is None:
            together = dict(self.moves(one))
            for label, after in self.moves(other).items():
                mine = together.get(label)
                together[label] = after if mine is None else self.union(mine, after)
            known = self._union[key] = self.of_moves(together)
        return known

    def within(self, one: int, other: int) -> bool:
        """Whether every sequence of ``one`` is one of ``other``; both have one length."""
        if one == other:
            return True
        key = (one, other)
        known = self._within.get(key)
        if known is None:
            theirs = self.moves(other)
            known = self._within[key] = all(
                label in theirs and self.within(after, theirs[label])
                for label, after in self.moves(one).items()
            )
        return known

    # ---- many at once

    def unions(self, first: Ints, sizes: Ints, members: Ints) -> Ints:
        """For each group, ``members[first : first + size]``, the union of its sets."""
        result = members[first].copy()
        for position in range(1, int(sizes.max(initial=0))):
            open_groups = np.flatnonzero(sizes > position)
            pairs = np.column_stack((result[open_groups], members[first[open_groups] + position]))
            different, inverse = unique_tuples(pairs, [len(self)] * 2)
            united = [self.union(a, b) for a, b in different.tolist()]
            result[open_groups] = np.array(united, np.int64)[inverse]
        return result

    def sets(self, first: Ints, sizes: Ints, labels: Ints, after: Ints) -> Ints:
        """For each group of moves, sorted by label, the set that has them."""
        result = np.full(len(first), END, np.int64)
        most = int(labels.max(initial=0)) + 1
        for position in range(int(sizes.max(initial=0))):
            open_groups = np.flatnonzero(sizes > position)
            at = first[open_groups] + position
            rows = np.column_stack((result[open_groups], labels[at], after[at]))
            different, inverse = unique_tuples(rows, [len(self), most, len(self)])
            extended = [self._extended(*row) for row in different.tolist()]
            result[open_groups] = np.array(extended, np.int64)[inverse]
        return result

    def within_each(self, one: Ints, other: Ints) -> Bools:
        """For each pair whether ``one[k]`` is `within` ``other[k]``."""
        answers: Bools = one == other
        left = np.flatnonzero(~answers)
        if len(self) ** 2 <= _TABLE * len(left):
            codes = one[left] * len(self) + other[left]
            table = np.zeros(len(self) ** 2, np.bool_)
            table[codes] = True
            asked = np.flatnonzero(table)
            rows = zip(*(part.tolist() for part in np.divmod(asked, len(self))), strict=True)
            table[asked] = [self.within(a, b) for a, b in rows]
            answers[left] = table[codes]
        else:
            pairs = np.column_stack((one[left], other[left]))
            different, inverse = unique_tuples(pairs, [len(self)] * 2)
            known = np.array([self.within(a, b) for a, b in different.tolist()], np.bool_)
            answers[left] = known[inverse]
        return answers

    def all_within(self, one: Sequence[int], other: Sequence[int]) -> bool:
        """Whether each set of ``one`` is `within` its partner."""
        return all(map(self.within, one, other))
