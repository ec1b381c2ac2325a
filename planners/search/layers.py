# SPDX-License-Identifier: GPL-3.0-or-later
"""What a forward search keeps: states numbered as they are met, layers, and steps between them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from planners.joint.tables import Bools, Ints, Numbers, Rows, unique_codes

_MULTIPLIER = np.uint64(0x9E3779B97F4A7C15)


class StateTable:
    """States by number, and numbers by state."""

    def __init__(self, width: int) -> None:
        self._rows: Rows = np.zeros((1024, width), np.uint64)
        self._numbers: dict[bytes, int] = {}

    def __len__(self) -> int:
        return len(self._numbers)

    def rows(self, numbers: Ints) -> Rows:
        """The rows of states."""
        return self._rows[numbers]

    def add(self, rows: Rows) -> Ints:
        """The numbers of states; those that are new get the next ones."""
        some, number = _different(rows)
        table, before = self._numbers, len(self._numbers)
        keys = np.ascontiguousarray(rows[some]).view(f"V{8 * rows.shape[1]}").ravel().tolist()
        found = np.fromiter((table.setdefault(key, len(table)) for key in keys), np.int64)
        if len(table) > len(self._rows):
            more = np.zeros((max(len(table), 2 * len(self._rows)), rows.shape[1]), np.uint64)
            more[:before] = self._rows[:before]
            self._rows = more
        new = found >= before
        self._rows[found[new]] = rows[some[new]]
        return found[number]


def _different(rows: Rows) -> tuple[Ints, Ints]:
    """Some of the rows, among which all different ones are, and for each row its number there.

    Few of them are equal: those alone whose hash is that of another row, too.
    """
    code = np.zeros(len(rows), np.uint64)
    for column in rows.T:
        code = (code ^ column) * _MULTIPLIER
        code ^= code >> np.uint64(29)
    first, number = unique_codes(code.view(np.int64))
    met = np.flatnonzero((rows[first[number]] != rows).any(axis=1))
    number[met] = len(first) + np.arange(len(met))
    return np.concatenate((first, met)), number


def grown(values: Ints, size: int, empty: int) -> Ints:
    """An array with room for so many values; there is as much again for more."""
    more = max(size - len(values), len(values))
    return np.concatenate((values, np.full(more, empty))) if size > len(values) else values


@dataclass(frozen=True, slots=True)
class Edges:
    """Joint steps between two layers, by source, states by their numbers in the table."""

    source: Numbers
    target: Numbers
    labels: Numbers
    cost: Numbers

    def only(self, kept: Bools) -> Edges:
        """Some of them."""
        if kept.all():
            return self
        some = np.flatnonzero(kept)
        return Edges(self.source[some], self.target[some], self.labels[some], self.cost[some])

    def compact(self) -> Edges:
        """The same in as few bytes as the largest numbers need: there are many more than states."""
        return Edges(*map(_narrow, (self.source, self.target, self.labels, self.cost)))


def joined_edges(parts: Sequence[Edges], robots: int) -> Edges:
    """Parts of the steps between two layers together."""
    none = np.zeros(0, np.int8)
    every = [Edges(none, none, np.zeros((0, robots), np.int8), none), *parts]
    if len(parts) == 1:
        return parts[0]
    return Edges(*(np.concatenate([getattr(p, f.name) for p in every]) for f in fields(Edges)))


def _narrow(numbers: Numbers) -> Numbers:
    """The same numbers, none of which is negative, in the smallest signed type.

    Unsigned 64-bit numbers and signed ones would add up to floats.
    """
    return numbers.astype(np.min_scalar_type(-1 - int(numbers.max(initial=0))))
