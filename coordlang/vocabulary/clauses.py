# SPDX-License-Identifier: GPL-3.0-or-later
"""Sets of clauses: those that others imply, frequent pairs, the order of states that they give.

A clause says that one of its pairs of states must be separated; with fewer pairs it asks for
more, and implies every clause that holds its pairs.
"""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Iterable

from coordlang.language.warping import Clause, Pair


def without_implied(clauses: Iterable[Clause], comparisons: int = sys.maxsize) -> list[Clause]:
    """The clauses that no other one implies (by a subset of its pairs), shortest first.

    ``clauses``: in any order; duplicates are dropped.  ``comparisons``: pairs of clauses that are
    compared; after so many the longer clauses are left as they are.
    """
    kept: list[Clause] = []
    compared = 0
    # A kept clause stands under one of its pairs: what it implies has that pair as well.
    by_pair: dict[Pair, list[Clause]] = {}
    for clause in sorted(set(clauses), key=lambda c: (len(c), sorted(c))):
        if compared < comparisons:
            others = [other for p in clause for other in by_pair.get(p, ())]
            compared += len(others)
            if any(other <= clause for other in others):
                continue
        kept.append(clause)
        rarest = min(sorted(clause), key=lambda p: len(by_pair.get(p, ())))
        by_pair.setdefault(rarest, []).append(clause)
    return kept


def most_frequent_pairs(clauses: Iterable[Clause], number: int) -> list[Pair]:
    """The pairs that most clauses hold, at most ``number``, the most frequent first."""
    frequency = Counter(states for clause in clauses for states in clause)
    return sorted(frequency, key=lambda p: (-frequency[p], p))[:number]


def most_constrained_first(states: Iterable[int], clauses: Iterable[Clause]) -> list[int]:
    """The states by how much the clauses ask of them: a good order to name words in.

    A pair counts for both its states, with the share that it has in its clause.
    """
    demand: dict[int, float] = {}
    for clause in clauses:
        for states_of_pair in clause:
            for state in states_of_pair:
                demand[state] = demand.get(state, 0.0) + 1 / len(clause)
    return sorted(states, key=lambda s: (-demand.get(s, 0.0), s))


def clique(edges: Iterable[Pair]) -> list[int]:
    """A large clique, the best that greedy search finds from any state.

    Its states need words of their own.
    """
    near: dict[int, set[int]] = {}
    for a, b in sorted(edges):
        near.setdefault(a, set()).add(b)
        near.setdefault(b, set()).add(a)
    best: list[int] = []
    for start in sorted(near):
        clique, candidates = [start], set(near[start])
        while candidates:
            chosen = max(candidates, key=lambda s: (len(near[s] & candidates), -s))
            clique.append(chosen)
            candidates &= near[chosen]
        best = max(best, clique, key=len)
    return best
