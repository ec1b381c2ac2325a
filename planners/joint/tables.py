# SPDX-License-Identifier: GPL-3.0-or-later
"""Tables of numbers: runs of a CSR table, truth values in blocks, duplicate rows out, rows found.

A table has one row for each item (a state, a node of a walk) and is sorted where it is looked up
in.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

#: Numbers of things: states, nodes, edges, labels.
Ints = NDArray[np.int64]
#: Numbers of which many are kept, in as few bytes as they need.
Numbers = NDArray[np.integer[Any]]
#: Truth values.
Bools = NDArray[np.bool_]
#: Shares, or places on a plane.
Floats = NDArray[np.float64]
#: States as rows of 64-bit blocks, (states, blocks).
Rows = NDArray[np.uint64]

T = TypeVar("T", bound=np.integer[Any])

#: Values a packed row may have.
_MOST = 2**63 - 1


def narrow(numbers: Numbers) -> Numbers:
    """The same numbers, none of which is negative, in the smallest signed type.

    Unsigned 64-bit numbers and signed ones would add up to floats.
    """
    return numbers.astype(np.min_scalar_type(-1 - int(numbers.max(initial=0))))


def ranges(starts: Ints, counts: Ints) -> Ints:
    """``[s, s+1, .., s+c-1]`` for every pair, joined."""
    before = starts + counts - counts.cumsum()
    within: Ints = before.repeat(counts)
    within += np.arange(len(within))
    return within


def differs(values: Numbers) -> Bools:
    """Which entries differ from the one before; the first does."""
    found = np.ones(len(values), np.bool_)
    np.not_equal(values[1:], values[:-1], out=found[1:])
    return found


def kept_runs(first: Ints, kept: Bools) -> Ints:
    """The bounds of the runs of a CSR table (runs + 1) of whose entries only some are kept."""
    return np.concatenate(([0], np.cumsum(kept)))[first]


def spans(sizes: NDArray[np.float64], most: int) -> Iterator[slice]:
    """Cut a table so that the sizes of each piece sum to at most ``most``.

    A larger row is a piece of its own.
    """
    ends = np.cumsum(sizes)
    start = 0
    while start < len(sizes):
        before = ends[start - 1] if start else 0.0
        end = max(start + 1, int(np.searchsorted(ends, before + most, side="right")))
        yield slice(start, end)
        start = end


def packed(table: Bools) -> Rows:
    """Truth values as rows of blocks: (rows, columns) to (rows, blocks of 64 columns)."""
    blocks = np.zeros((len(table), -(-table.shape[1] // 64) * 8), np.uint8)
    bits = np.packbits(table, axis=1, bitorder="little")
    blocks[:, : bits.shape[1]] = bits
    return blocks.view("<u8").astype(np.uint64, copy=False)


def unpacked(rows: Rows, columns: int) -> Bools:
    """The truth values of rows of blocks, (rows, columns)."""
    blocks = np.ascontiguousarray(rows, "<u8")
    true = np.unpackbits(blocks.view(np.uint8), axis=1, bitorder="little")
    return true[:, :columns].view(np.bool_)


def unique_rows(table: NDArray[T]) -> tuple[NDArray[T], Ints]:
    """The different rows of a table, sorted, and each row's number among them; none is negative.

    Columns are packed into as few 64-bit codes as they fit, so that most tables sort as plain
    numbers.
    """
    codes: list[Rows] = []
    size = _MOST + 1
    for column in table.T:
        bound = int(np.maximum.reduce(column, initial=0)) + 1
        size *= bound
        if size > _MOST:
            codes.append(column.astype(np.uint64))
            size = bound
        else:
            codes[-1] *= np.uint64(bound)
            codes[-1] += column.astype(np.uint64)
    codes = codes or [np.zeros(len(table), np.uint64)]  # without columns all rows are one
    order = codes[0].argsort() if len(codes) == 1 else np.lexsort(codes[::-1])
    fresh = differs(codes[0][order])
    for code in codes[1:]:
        fresh |= differs(code[order])
    number = np.empty(len(table), np.int64)
    number[order] = fresh.cumsum() - 1
    return table[order[fresh]], number


def of_each_row(table: Ints, function: Callable[..., int]) -> Ints:
    """What a function of its numbers says of each row; it is asked once for each different row."""
    different, number = unique_rows(table)
    return np.array([function(*row) for row in different.tolist()], np.int64)[number]


def find_rows(table: NDArray[T], rows: NDArray[T]) -> Ints:
    """For each of ``rows`` its number in the sorted ``table`` (as made by `unique_rows`), or -1."""
    if len(table) == 0:
        return np.full(len(rows), -1, np.int64)
    keys, wanted = _comparable(table), _comparable(rows)
    found = np.minimum(np.searchsorted(keys, wanted), len(table) - 1)
    return np.where(keys[found] == wanted, found, -1)


def _comparable(rows: NDArray[T]) -> NDArray[np.generic]:
    """Rows as one sortable value each, in the order of `unique_rows`."""
    if rows.shape[1] == 1:
        return rows[:, 0]
    # Big-endian bytes compare like the numbers, word by word.
    wide = np.ascontiguousarray(rows.astype(">u8"))
    return wide.view(f"V{8 * rows.shape[1]}").reshape(-1)
