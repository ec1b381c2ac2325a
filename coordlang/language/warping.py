# SPDX-License-Identifier: GPL-3.0-or-later
"""When two state sequences have one sentence: warping paths, and the shortest of them.

Key fact (Proposition 7 of docs/concepts.md): ``u`` and ``v`` have the same sentence under ``f`` iff
there is a *warping path*: cells ``(i, j)`` from ``(0, 0)`` to the last indices, steps ``(1, 0)``,
``(0, 1)``, ``(1, 1)``, with ``f(u_i) = f(v_j)`` on every cell.  So whoever wants the sentences to
differ must separate ``u_i`` from ``v_j`` on some cell of *every* warping path.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

Pair = tuple[int, int]

#: A clause: at least one of these pairs of states must lie in different words.
Clause = frozenset[Pair]


def pair(a: int, b: int) -> Pair:
    """Two states as an unordered pair."""
    return (a, b) if a < b else (b, a)


def separates(words: Mapping[int, int], clause: Clause) -> bool:
    """Whether states of some pair of a clause have different words."""
    return any(words[a] != words[b] for a, b in clause)


def warping_path(
    u: Sequence[int], v: Sequence[int], joined: Sequence[Sequence[bool]]
) -> list[tuple[int, int]] | None:
    """A warping path over ``joined[i][j]`` with the fewest non-identical cells, or None."""
    # Cells are counted from 1: each has one before it, and there is no path to those at the rim.
    best = {(0, 0): 0}

    def before(i: int, j: int) -> dict[tuple[int, int], int]:
        cells = (i - 1, j - 1), (i - 1, j), (i, j - 1)
        return {cell: best[cell] for cell in cells if cell in best}

    for i, a in enumerate(u, 1):
        for j, b in enumerate(v, 1):
            if joined[i - 1][j - 1] and (found := before(i, j)):
                best[i, j] = min(found.values()) + (a != b)
    i, j = len(u), len(v)
    if (i, j) not in best:
        return None
    path = []
    while i:
        path.append((i - 1, j - 1))
        i, j = min(before(i, j), key=best.__getitem__)
    return path[::-1]
