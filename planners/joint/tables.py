# SPDX-License-Identifier: GPL-3.0-or-later
"""Tables of numbers: runs of a CSR table, truth values in blocks, duplicate rows out, rows found.

A table has one row for each item (a state, a node of a walk) and is sorted where it is looked up
in.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import prod
from typing import Any

import numpy as np
from numpy.typing import NDArray

#: Numbers of things: states, nodes, edges, labels.
Ints = NDArray[np.int64]
#: Numbers of which many are kept, in as few bytes as they need.
Numbers = NDArray[np.integer[Any]]
#: Truth values.
Bools = NDArray[np.bool_]
#: States as rows of 64-bit blocks, (states, blocks).
Rows = NDArray[np.uint64]

#: Values a coded tuple may have.
_MOST = 2**63 - 1


def ranges(starts: Ints, counts: Ints) -> Ints:
    """``[s, s+1, .., s+c-1]`` for every pair, joined."""
    total = int(counts.sum())
    ends = np.cumsum(counts)
    within: Ints = np.arange(total) + np.repeat(starts - (ends - counts), counts)
    return within


def kept_runs(first: Ints, kept: Bools) -> Ints:
    """The bounds of the runs of a CSR table (runs + 1) of whose entries only some are kept."""
    bounds: Ints = np.concatenate(([0], np.cumsum(kept)))[first]
    return bounds


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
    return true[:, :columns].astype(np.bool_)


def unique_rows(rows: Rows) -> tuple[Rows, NDArray[np.int64]]:
    """The different rows, sorted, and for each input row its number among them."""
    sizes = [int(column.max(initial=0)) + 1 for column in rows.T]
    if len(sizes) == 1 or prod(sizes) <= _MOST:
        code = rows[:, 0]
        for column, size in zip(rows.T[1:], sizes[1:], strict=True):
            code = code * np.uint64(size) + column
        position, inverse = unique_codes(code)
        return rows[position], inverse
    order = np.lexsort(rows.T[::-1])
    ordered = rows[order]
    fresh = np.ones(len(rows), np.bool_)
    fresh[1:] = (ordered[1:] != ordered[:-1]).any(axis=1)
    inverse = np.empty(len(rows), np.int64)
    inverse[order] = np.cumsum(fresh) - 1
    return ordered[fresh], inverse


def find_rows(table: Rows, rows: Rows) -> NDArray[np.int64]:
    """For each of ``rows`` its number in the sorted ``table`` (as made by `unique_rows`), or -1."""
    if len(table) == 0:
        return np.full(len(rows), -1, np.int64)
    keys, wanted = _comparable(table), _comparable(rows)
    found = np.minimum(np.searchsorted(keys, wanted), len(table) - 1)
    return np.where(keys[found] == wanted, found, -1)


def _comparable(rows: Rows) -> NDArray[np.generic]:
    """Rows as one sortable value each, in the order of `unique_rows`."""
    if rows.shape[1] == 1:
        return rows[:, 0]
    # Big-endian bytes compare like the numbers, word by word.
    wide = np.ascontiguousarray(rows.astype(">u8"))
    return wide.view(f"V{8 * rows.shape[1]}").reshape(-1)


def unique_codes(codes: NDArray[np.integer[Any]]) -> tuple[Ints, Ints]:
    """A position of each different code, in the order of codes, and each one's number among them.

    Twice as fast as `numpy.unique`, whose positions are those of first occurrences.
    """
    order = np.argsort(codes)
    ordered = codes[order]
    fresh = np.ones(len(codes), np.bool_)
    fresh[1:] = ordered[1:] != ordered[:-1]
    inverse = np.empty(len(codes), np.int64)
    inverse[order] = np.cumsum(fresh) - 1
    return order[fresh], inverse


def unique_tuples(table: Ints, bounds: list[int]) -> tuple[Ints, Ints]:
    """The different rows of ``table``, sorted, and each row's number among them.

    ``bounds[k]`` is one more than the largest value of column k; values start at 0.  Columns are
    packed into as few 64-bit codes as they fit, so that most tables sort as plain numbers.
    """
    codes: list[Ints] = []
    code = np.zeros(len(table), np.int64)
    size = 1
    for column, bound in enumerate(bounds):
        if size * bound > _MOST:
            codes.append(code)
            code, size = np.zeros(len(table), np.int64), 1
        code = code * bound + table[:, column]
        size *= bound
    codes.append(code)
    if len(codes) == 1:
        position, inverse = unique_codes(code)
        return table[position], inverse
    _, inverse = unique_rows(np.stack(codes, axis=1).astype(np.uint64))
    position = np.zeros(int(inverse.max(initial=-1)) + 1, np.int64)
    position[inverse] = np.arange(len(table))
    return table[position], inverse
