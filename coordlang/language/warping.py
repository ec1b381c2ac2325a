# SPDX-License-Identifier: GPL-3.0-or-later
"""When two state sequences have one sentence: warping paths, and the shortest of them.

Key fact (Proposition 7 of docs/concepts.md): ``u`` and ``v`` have the same sentence under ``f`` iff
there is a *warping path*: cells ``(i, j)`` from ``(0, 0)`` to the last indices, steps ``(1, 0)``,
``(0, 1)``, ``(1, 1)``, with ``f(u_i) = f(v_j)`` on every cell.  So whoever wants the sentences to
differ must separate ``u_i`` from ``v_j`` on some cell of *every* warping path.
"""

from __future__ import annotations

from collections.abc import Sequence

Pair = tuple[int, int]

#: A clause: at least one of these pairs of states must lie in different words.
Clause = frozenset[Pair]

_NO_PATH = 10**9


def pair(a: int, b: int) -> Pair:
    """Two states as an unordered pair."""
    return (a, b) if a < b else (b, a)


def warping_path(
    u: Sequence[int], v: Sequence[int], joined: Sequence[Sequence[bool]]
) -> list[tuple[int, int]] | None:
    """A warping path over ``joined[i][j]`` with the fewest non-identical cells, or None."""
    best = [[_NO_PATH] * len(v) for _ in u]
    for i, a in enumerate(u):
        for j, b in enumerate(v):
            if not joined[i][j]:
                continue
            before = min(_before(best, i, j)) if i or j else 0
            if before < _NO_PATH:
                best[i][j] = before + (a != b)
    if best[-1][-1] >= _NO_PATH:
        return None
    i, j = len(u) - 1, len(v) - 1
    path = [(i, j)]
    while i or j:
        options = _before(best, i, j)
        i, j = ((i - 1, j - 1), (i - 1, j), (i, j - 1))[options.index(min(options))]
        path.append((i, j))
    return path[::-1]


def _before(best: list[list[int]], i: int, j: int) -> tuple[int, int, int]:
    """The values of the three cells before ``(i, j)``: diagonal, above, left."""
    return (
        best[i - 1][j - 1] if i and j else _NO_PATH,
        best[i - 1][j] if i else _NO_PATH,
        best[i][j - 1] if j else _NO_PATH,
    )
