# SPDX-License-Identifier: GPL-3.0-or-later
"""Features that suffice: the simplest ones that tell some pair of every clause apart.

A clause is a set of pairs of states of which every language separates one.  States with equal
features are one class; the classes are words of a language iff each clause has a pair of two
classes.  So the features are a hitting set, and the simplest one is a MaxSAT question.

Fewer words: a clause over pairs of states is one over pairs of classes, for states of one class
cannot be separated.  From one word for each class downwards: a partition of the classes that
satisfies all clauses, what refutes it, and so on (as in `coordlang.vocabulary.minimal`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from coordlang.language.warping import Clause, pair
from coordlang.vocabulary.sat import PartitionProblem, Undecided, satisfiable
from planners.joint.tables import Bools, Ints
from planners.search.sat import sat_solver

#: Members are compared with each other where they are at most so many.
_COMPARED = 4_000


class SimplestHitting:
    """The members of least weight that meet all sets of a list that only grows.

    Weights are asked for from below, so what is found is proved to be lightest.  ``weights`` are
    those of the members, by number; positive.
    """

    def __init__(self, weights: Sequence[int]) -> None:
        self._weights = np.array(weights, np.int64)
        self._sets: dict[bytes, Bools] = {}
        self._bound = 0

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
        while (found := _lightest(weights, clauses, self._bound)) is None:
            self._bound += 1
        return sorted(useful[found].tolist())


def undominated(inside: Bools, weights: Ints) -> Ints:
    """Members without which a lightest hitting set is left, in order.

    Left out is what is in no set, or only in those of one other member that is not heavier.

    ``inside`` says what is in which sets: (members, sets).
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
    with sat_solver("cadical153", [*_at_most(weights, bound), *clauses]) as solver:
        if not satisfiable(solver):
            return None
        return [var - 1 for var in solver.get_model() if 0 < var <= len(weights)]


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


#: Conflicts that the solver may spend on one partition.
_CONFLICTS = 100_000


@dataclass(frozen=True, slots=True)
class Merged:
    """A word for each class, by number.

    ``proved``: no partition of these classes into fewer words is a language for the problems.
    """

    words: tuple[int, ...]
    proved: bool


def merge_classes(
    count: int,
    classes: Sequence[Ints],
    known: Sequence[Iterable[Clause]],
    refuting: Callable[[int, Ints], Mapping[Clause, object]],
    progress: Callable[[str], None],
) -> Merged:
    """As few words as are found for ``count`` classes.

    ``classes`` are for each problem the class of each state; one word for each class is a language.
    ``known`` are for each problem clauses that every language satisfies; ``refuting(problem, words
    of states)`` gives clauses that these words violate, none if they are a language for it.
    """
    clauses = dict.fromkeys(
        _over_classes(clause, own)
        for own, some in zip(classes, known, strict=True)
        for clause in some
    )
    best, proved = tuple(range(count)), count < 2
    while not proved:
        size = len(set(best)) - 1
        problem = PartitionProblem(range(count), max(1, size))
        try:
            for clause in clauses:
                problem.separate_one(clause)
            found = _partition(problem, classes, clauses, refuting)
        except Undecided:
            break
        finally:
            problem.close()
        if found is None:
            proved = True
        else:
            best = tuple(found[k] for k in range(count))
            progress(f"merging words: {len(set(best))} suffice")
            proved = len(set(best)) == 1
    return Merged(best, proved)


def _partition(
    problem: PartitionProblem,
    classes: Sequence[Ints],
    clauses: dict[Clause, None],
    refuting: Callable[[int, Ints], Mapping[Clause, object]],
) -> dict[int, int] | None:
    """A partition of the classes that nothing refutes; None if there is none of this size."""
    while (found := problem.solve(_CONFLICTS)) is not None:
        for number, own in enumerate(classes):
            violated = refuting(number, np.array([found[k] for k in own.tolist()], np.int64))
            if violated:
                for clause in violated:
                    over = _over_classes(clause, own)
                    if over not in clauses:
                        clauses[over] = None
                        problem.separate_one(over)
                break
        else:
            return found
    return None


def _over_classes(clause: Clause, classes: Ints) -> Clause:
    pairs = ((int(classes[a]), int(classes[b])) for a, b in clause)
    return frozenset(pair(a, b) for a, b in pairs if a != b)
