# SPDX-License-Identifier: GPL-3.0-or-later
"""The fewest boxes that hold some points and avoid others.

Two-level minimisation with multi-valued variables.

The way of espresso (Rudell and Sangiovanni-Vincentelli 1987): expand points to prime boxes, take an
irredundant cover, reduce and expand again.  Where it is small enough, a SAT solver then looks for a
cover with one box less until it proves that there is none.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations
from math import comb
from random import Random

import numpy as np
from numpy.typing import NDArray

from coordlang.explanation.boxes import Bits, Points, conflicting, expand
from coordlang.vocabulary.sat import Undecided, satisfiable
from planners.search.sat import sat_solver
from planners.system.errors import CoordlangError

#: Array elements looked at in expansions; decides how many passes are made.
_WORK = 300_000_000
_PASSES = 12
#: Literals in the question whether fewer boxes suffice, and conflicts until it is given up.
_LITERALS = 400_000
_CONFLICTS = 3_000
#: Sets of variables tried for the shortest box; beyond, one is built greedily.
_SUBSETS = 3_000
_CLIQUE = 400


@dataclass(frozen=True, slots=True)
class Boxes:
    """Prime boxes that together hold all ``on`` points, the largest first.

    ``least[k]`` is the smallest box around the points that no earlier box holds: every box between
    ``least[k]`` and ``prime[k]`` does as well.  ``fewest``: it is proved that fewer boxes do not
    suffice.
    """

    prime: Bits
    least: Bits
    fewest: bool


def minimise(points: Points, quick: bool = False) -> Boxes:
    """The fewest prime boxes found that hold all ``on`` points and no ``off`` point.

    Each has few variables limited.

    ``quick``: one pass, no proof.  Deterministic.  ``on`` and ``off`` must be disjoint.
    """
    width = sum(points.sizes)
    if not len(points.on):
        return Boxes(np.zeros((0, width), np.bool_), np.zeros((0, width), np.bool_), True)
    if not len(points.off):
        return Boxes(
            np.ones((1, width), np.bool_),
            points.supercube(np.arange(len(points.on)))[None, :],
            True,
        )
    boxes = _irredundant(points, np.array(_pass(points, None)))
    if quick:
        return _least(points, _shorten(points, boxes), False)
    needed = _apart(points, boxes)
    boxes = _search(points, boxes, len(needed))
    fewest = len(boxes) == len(needed)
    while not fewest:
        smaller = _fewer(points, len(boxes) - 1, needed)
        if smaller is None:
            break
        fewest = not len(smaller)
        if not fewest:
            boxes = smaller
    return _least(points, _shorten(points, boxes), fewest)


def _search(points: Points, best: Bits, bound: int) -> Bits:
    """Passes with other orders of points and variables; the best cover out of all their primes."""
    pool = {box.tobytes(): box for box in best}
    work = 0
    for number in range(1, _PASSES):
        if len(best) <= bound or work > _WORK:
            break
        fresh = _pass(points, Random(number))
        pool |= {box.tobytes(): box for box in fresh}
        best = min(best, _irredundant(points, np.array(list(pool.values()))), key=_rank)
        work += len(fresh) * len(points.sizes) ** 2 * (len(points.off) + len(points.on))
    return best


def _rank(boxes: Bits) -> tuple[int, int]:
    return len(boxes), int((~boxes).sum())


def _pass(points: Points, random: Random | None) -> list[Bits]:
    """Prime boxes that hold every ``on`` point.

    Greedy ones, or some in random orders of the variables.
    """
    left = np.arange(len(points.on))
    if random:
        order = list(range(len(left)))
        random.shuffle(order)
        left = left[order]
    found = []
    while len(left):
        seed = points.supercube(left[:1])
        variables = None
        if random and random.random() < 0.5:
            variables = list(range(len(points.sizes)))
            random.shuffle(variables)
        box = expand(points, seed, points.on[left], variables)
        found.append(box)
        left = left[~points.inside(box[None, :], points.on[left])[0]]
    return found


def _irredundant(points: Points, pool: Bits) -> Bits:
    """A cover from a pool: what takes in most first, then without what the others hold together."""
    held = points.inside(pool, points.on)
    limited = (~pool).sum(axis=1)
    left = np.ones(len(points.on), np.bool_)
    gain = held.sum(axis=1)
    chosen: list[int] = []
    while left.any():
        best = np.flatnonzero(gain == gain.max())
        chosen.append(int(best[np.argmin(limited[best])]))
        taken = held[chosen[-1]] & left
        gain = gain - held[:, taken].sum(axis=1)
        left &= ~taken
    times = held[chosen].sum(axis=0)
    for number in reversed(chosen.copy()):
        if (times[held[number]] > 1).all():
            times -= held[number]
            chosen.remove(number)
    return np.asarray(pool[chosen])


def _apart(points: Points, boxes: Bits) -> list[int]:
    """``on`` points of which no box can hold two: that many boxes are needed."""
    times = points.inside(boxes, points.on).sum(axis=0)
    order = np.argsort(times, kind="stable")
    step = max(1, len(order) // _CLIQUE)
    found: list[int] = []
    for number in order[::step].tolist():
        if len(found) == len(boxes):
            break
        if all(conflicting(points, number, other) for other in found):
            found.append(number)
    return found


def _fewer(points: Points, number: int, needed: Sequence[int]) -> Bits | None:
    """Boxes, ``number`` of them.

    An empty table if it is proved that there are none; None if that was too much work.

    Variables of the SAT problem: box t allows column c; box t holds the ``on`` point i.
    """
    size = number * (len(points.on) + len(points.off)) * len(points.sizes)
    if size > _LITERALS:
        return None
    width = sum(points.sizes)
    with sat_solver("glucose4", _box_clauses(points, number, needed)) as solver:
        try:
            answer = satisfiable(solver, conflicts=_CONFLICTS)
        except Undecided:
            return None
        if not answer:
            return np.zeros((0, width), np.bool_)
        model = np.array(solver.get_model()[: number * (width + len(points.on))]) > 0
    holds = model[number * width :].reshape(number, len(points.on))
    seeds = [points.supercube(np.flatnonzero(row)) for row in holds if row.any()]
    boxes = np.array([expand(points, seed, points.on) for seed in seeds])
    if (
        points.inside(boxes, points.off).any()
        or not points.inside(boxes, points.on).any(axis=0).all()
    ):
        raise CoordlangError(
            "the boxes that Glucose found do not hold the points that they must hold",
            remedy="This is a defect of the solver, not of the input: please report it.",
        )
    return _irredundant(points, boxes)


def _box_clauses(points: Points, number: int, needed: Sequence[int]) -> Iterator[list[int]]:
    """Clauses: ``number`` boxes hold all ``on`` points and no ``off`` point.

    No two of the ``needed`` points are in one box, so that each can have a box of its own.
    """
    width = sum(points.sizes)
    on = (points.on + points.offset + 1).tolist()
    off = (points.off + points.offset + 1).tolist()

    def holds(box: int, point: int) -> int:
        return number * width + box * len(on) + point + 1

    for box in range(number):
        shift = box * width
        for columns in off:
            yield [-(shift + column) for column in columns]
        for point, columns in enumerate(on):
            for column in columns:
                yield [-holds(box, point), shift + column]
    for point in range(len(on)):
        yield [holds(box, point) for box in range(number)]
    for box, point in enumerate(needed):
        yield [holds(box, point)]


def _shorten(points: Points, boxes: Bits) -> Bits:
    """Each box again, around the points that only it holds.

    Few variables limited, then prime again.
    """
    boxes = boxes.copy()
    for _ in range(2):
        held = points.inside(boxes, points.on)
        times = held.sum(axis=0)
        for number in np.argsort(held.sum(axis=1), kind="stable").tolist():
            own = held[number] & (times == 1)
            if not own.any():
                continue
            seed = _freed(points, points.supercube(np.flatnonzero(own)))
            candidate = expand(points, seed, points.on)
            if _length(points, candidate, own) <= _length(points, boxes[number], own):
                boxes[number] = candidate
                times -= held[number]
                held[number] = points.inside(candidate[None, :], points.on)[0]
                times += held[number]
    return _irredundant(points, boxes)


def _length(points: Points, box: Bits, own: NDArray[np.bool_]) -> tuple[int, int]:
    least = points.supercube(np.flatnonzero(own))
    parts = [
        _said(least[start : start + size], box[start : start + size])
        for start, size in zip(points.offset.tolist(), points.sizes, strict=True)
    ]
    return sum(p > 0 for p in parts), sum(parts)


def _said(least: Bits, most: Bits) -> int:
    """Values that must be mentioned to limit a variable to something between two sets."""
    return 0 if most.all() else min(int(least.sum()), int((~most).sum()))


def _freed(points: Points, seed: Bits) -> Bits:
    """The box with as few variables limited as keep all ``off`` points out.

    In total or (many variables) greedily.
    """
    packed = np.unique(np.packbits(points.blocked(seed, points.off), axis=1), axis=0)
    outside = np.unpackbits(packed, axis=1, count=len(points.sizes)).astype(np.bool_)
    kept = _hitting(
        outside,
        [
            _said(seed[s : s + n], seed[s : s + n])
            for s, n in zip(points.offset.tolist(), points.sizes, strict=True)
        ],
    )
    box = seed.copy()
    for v, (start, size) in enumerate(zip(points.offset.tolist(), points.sizes, strict=True)):
        if v not in kept:
            box[start : start + size] = True
    return box


def _hitting(rows: NDArray[np.bool_], weights: Sequence[int]) -> set[int]:
    """Columns of which every row has one.

    The fewest, and of these the least weight; greedily if there are too many sets to try.
    """
    count = rows.shape[1]
    tried = 0
    for size in range(count + 1):
        tried += comb(count, size)
        if tried > _SUBSETS:
            return _hitting_greedily(rows, weights)
        hitting = [
            c for c in combinations(range(count), size) if rows[:, list(c)].any(axis=1).all()
        ]
        if hitting:
            return set(min(hitting, key=lambda c: (sum(weights[v] for v in c), c)))
    return _hitting_greedily(rows, weights)


def _hitting_greedily(rows: NDArray[np.bool_], weights: Sequence[int]) -> set[int]:
    """Always next: the column in most rows that are not hit yet; then without superfluous ones."""
    count = rows.shape[1]
    chosen: list[int] = []
    left = rows
    while len(left):
        gain = left.sum(axis=0)
        chosen.append(int(np.lexsort((np.arange(count), np.array(weights), -gain))[0]))
        left = left[~left[:, chosen[-1]]]
    for v in sorted(chosen, key=lambda v: -weights[v]):
        others = [c for c in chosen if c != v]
        if rows[:, others].any(axis=1).all():
            chosen = others
    return set(chosen)


def _least(points: Points, boxes: Bits, fewest: bool) -> Boxes:
    held = points.inside(boxes, points.on)
    order = np.argsort(-held.sum(axis=1), kind="stable")
    prime, held = boxes[order], held[order]
    first = np.argmax(held, axis=0)  # the first box that holds each point
    least = [points.supercube(np.flatnonzero(first == number)) for number in range(len(prime))]
    return Boxes(prime, np.array(least), fewest)
