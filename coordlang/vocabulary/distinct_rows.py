# SPDX-License-Identifier: GPL-3.0-or-later
"""The distinct rows of a growing table: what holds of many equal rows is asked once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planners.joint.tables import Ints, find_rows

#: An odd multiplier: what is equal has equal keys, other things nearly never.
MULTIPLIER = np.uint64(0x9E3779B97F4A7C15)


@dataclass(frozen=True, slots=True)
class DistinctRows:
    """Distinct rows, numbered as they were met.

    Attributes
    ----------
    rows
        (rows, columns) each of them once.
    """

    rows: Ints
    _keys: NDArray[np.uint64]
    _numbers: Ints

    @classmethod
    def none(cls, columns: int) -> DistinctRows:
        """No rows yet."""
        no_numbers = np.zeros(0, np.int64)
        return cls(np.zeros((0, columns), np.int64), no_numbers.view(np.uint64), no_numbers)

    def numbered(self, table: Ints) -> tuple[DistinctRows, Ints]:
        """These rows and those of a table, and the number of each row of the table."""
        keys, first, of_row = np.unique(row_keys(table.T), return_index=True, return_inverse=True)
        found = find_rows(self._keys[:, None], keys[:, None])
        fresh = found < 0
        numbers = len(self.rows) + np.cumsum(fresh) - 1
        numbers[~fresh] = self._numbers[found[~fresh]]
        at = np.searchsorted(self._keys, keys[fresh])
        more = DistinctRows(
            np.concatenate((self.rows, table[first[fresh]])),
            np.insert(self._keys, at, keys[fresh]),
            np.insert(self._numbers, at, numbers[fresh]),
        )
        return more, numbers[of_row]


def row_keys(columns: Ints) -> NDArray[np.uint64]:
    """(..) a number for each row of a table (columns, ..); different rows nearly always differ."""
    keys = np.zeros(columns.shape[1:], np.uint64)
    for column in columns:
        keys = (keys ^ (column.astype(np.uint64) + np.uint64(1))) * MULTIPLIER
        keys ^= keys >> np.uint64(29)
    return keys
