# SPDX-License-Identifier: GPL-3.0-or-later
"""Features that suffice: the simplest ones that tell some pair of every clause apart.

A clause is a set of pairs of states of which every language separates one.  States with equal
features are one class; the classes are words of a language iff each clause has a pair of two
classes.  So the features are a hitting set, and the simplest one is a MaxSAT question.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from coordlang.vocabulary.sat import satisfiable
from planners.joint.tables import Bools, Ints
from planners.search.sat import sat_solver

#: Members are compared with each other where they are at most so many.
_COMPARED = 4_000


class SimplestHitting:
    """The members of least weight that meet all sets of a list that only grows.

    Weights are asked for from below, so what is found is proved to be lightest.

    Parameters
    ----------
    weights
        That of each member, by number; positive.
    """

    def __init__(self, weights: Sequence[int]) -> None:
        self._weights = np.array(weights, np.int64)
        self._sets: dict[bytes, Bools] = {}
        self.bound = 0

    def add(self, members: Bools) -> None:
        """Add a set, which is not empty, as a table of what is in it."""
        self._sets.setdefault(members.tobytes(), members)

    def find(self) -> list[int]:
        """Members that meet all sets, in order."""
        if not self._sets:
            return []
        inside = np.array(list(self._sets.values())).T
        useful = undominated(inside, self._weights)
        weights = self._weights[useful].tolist()
        clauses = [[*(np.flatnonzero(one) + 1).tolist()] for one in inside[useful].T]
        while True:
            found = _lightest(weights, clauses, self.bound)
            if found is not None:
                return sorted(useful[found].tolist())
            self.bound += 1


def undominated(inside: Bools, weights: Ints) -> Ints:
    """Members without which a lightest hitting set is left, in order.

    Left out is what is in no set, or only in those of one other member that is not heavier.

    Parameters
    ----------
    inside
        What is in which sets: (members, sets).
    weights
        The weight of each member.
    """
    order = np.lexsort((np.arange(len(weights)), weights))
    _, first = np.unique(np.packbits(inside[order], axis=1), axis=0, return_index=True)
    kept = np.sort(first)  # of equal members the lightest, lightest ones first
    kept = kept[inside[order[kept]].any(axis=1)]
    if len(kept) <= _COMPARED:
        mine = inside[order[kept]].astype(np.float32)
        covers = mine @ mine.T == mine.sum(axis=1)  # [a, b]: a is in all sets of b
        earlier = np.tri(len(kept), k=-1, dtype=bool).T  # a is not heavier than b
        kept = kept[~(covers & earlier).any(axis=0)]
    found: Ints = np.sort(order[kept])
    return found


def _lightest(
    weights: Sequence[int], clauses: Sequence[Sequence[int]], bound: int
) -> list[int] | None:
    """Members with at most a total weight, by position; None if there are none."""
    solver = sat_solver("cadical153", [*_at_most(weights, bound), *clauses])
    try:
        if not satisfiable(solver):
            return None
        return [var - 1 for var in solver.get_model() if 0 < var <= len(weights)]
    finally:
        solver.delete()


def _at_most(weights: Sequence[int], bound: int) -> Iterator[list[int]]:
    """Clauses by which members weigh at most so much together, as a sequential weighted counter.

    Variable 1 + k is member k; ``count(k, j)``: the members up to k weigh at least 1 + j.
    """

    def count(member: int, number: int) -> int:
        return len(weights) + 1 + member * bound + number

    for member, weight in enumerate(weights):
        if member:
            for number in range(bound):
                yield [-count(member - 1, number), count(member, number)]
        if weight > bound:
            yield [-member - 1]
            continue
        yield from ([-member - 1, count(member, number)] for number in range(weight))
        if not member:
            continue
        for number in range(bound - weight):
            yield [-member - 1, -count(member - 1, number), count(member, number + weight)]
        yield [-member - 1, -count(member - 1, bound - weight)]
