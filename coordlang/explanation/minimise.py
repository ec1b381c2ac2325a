# SPDX-License-Identifier: GPL-3.0-or-later
"""The fewest boxes that hold some points and avoid others: two-level minimisation, multi-valued.

A *box* allows a set of values for each variable; as a row of bits it has one column for each value
of each variable.  It is *prime* for ``off`` points if it holds none of them and no value can be
allowed in addition.  The way of espresso (Rudell and Sangiovanni-Vincentelli 1987): expand points
to prime boxes and take an irredundant cover.  Where it is small enough, a SAT solver then looks for
a cover with one box less until it proves that there is none.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations
from math import comb

import numpy as np

from coordlang.vocabulary.sat import Undecided, satisfiable
from planners.joint.tables import Bools, Ints, unique_rows
from planners.search.sat import sat_solver
from planners.system.errors import CoordlangError

#: Literals in the question whether fewer boxes suffice, and conflicts until it is given up.
_LITERALS = 400_000
_CONFLICTS = 3_000
#: Sets of variables tried for the shortest box; beyond, one is built greedily.
_SUBSETS = 3_000
#: Points of which as many as possible are chosen that need boxes of their own.
_CLIQUE = 400


@dataclass(frozen=True)
class Points:
    """Points to hold (``on``) and to avoid (``off``), (points, variables).

    They are values of variables with ``sizes[v]`` values each.
    """

    sizes: tuple[int, ...]
    on: Ints
    off: Ints

    @cached_property
    def offset(self) -> Ints:
        """The first column of each variable."""
        sizes = np.array(self.sizes, np.int64)
        return np.cumsum(sizes) - sizes

    @cached_property
    def spans(self) -> list[slice]:
        """The columns of each variable."""
        return [slice(o, o + n) for o, n in zip(self.offset.tolist(), self.sizes, strict=True)]

    def blocked(self, box: Bools, points: Ints) -> Bools:
        """In which variables each point lies outside a box."""
        return np.asarray(~box[points + self.offset])

    def inside(self, boxes: Bools, points: Ints) -> Bools:
        """Which points lie in which boxes: (boxes, points)."""
        held = np.ones((len(boxes), len(points)), np.bool_)
        for columns in (points + self.offset).T:
            held &= boxes[:, columns]
        return held

    def supercube(self, numbers: Sequence[int] | Ints) -> Bools:
        """The least box around some of the ``on`` points."""
        box = np.zeros(sum(self.sizes), np.bool_)
        box[(self.on[numbers] + self.offset).reshape(-1)] = True
        return box


@dataclass(frozen=True, slots=True)
class Boxes:
    """Prime boxes that together hold all ``on`` points, the largest first.

    ``least[k]`` is the smallest box around the points that no earlier box holds: every box between
    ``least[k]`` and ``prime[k]`` does as well.  ``fewest``: it is proved that fewer boxes do not
    suffice.
    """

    prime: Bools
    least: Bools
    fewest: bool


def minimise(points: Points, quick: bool = False) -> Boxes:
    """The fewest prime boxes found that hold all ``on`` points and no ``off`` point.

    Each has few variables limited.  ``quick``: one pass, no proof.  Deterministic.  ``on`` and
    ``off`` must be disjoint.
    """
    if not len(points.on):
        none = np.zeros((0, sum(points.sizes)), np.bool_)
        return Boxes(none, none, True)
    boxes = _irredundant(points, _pass(points))
    fewest = False
    if not quick:
        needed = _apart(points, boxes)
        fewest = len(boxes) == len(needed)
        while not fewest and (smaller := _fewer(points, len(boxes) - 1, needed)) is not None:
            fewest = not len(smaller)
            boxes = boxes if fewest else smaller
    boxes = _shorten(points, boxes)
    held = points.inside(boxes, points.on)
    order = np.argsort(-held.sum(axis=1), kind="stable")
    first = np.argmax(held[order], axis=0)  # the first box that holds each point
    least = [points.supercube(np.flatnonzero(first == number)) for number in range(len(boxes))]
    return Boxes(boxes[order], np.array(least), fewest)


# ---- covers by expanding points


def expand(points: Points, seed: Bools, wanted: Ints) -> Bools:
    """A prime box around the box ``seed``, which must hold no ``off`` point.

    Variables are opened one after the other, each to all values that keep the ``off`` points out:
    first what takes in most of the ``wanted`` points (and then brings most of them nearest).
    O(variables² · points).
    """
    box = seed.copy()
    out_off = points.blocked(box, points.off)
    out_on = points.blocked(box, wanted)
    left = list(range(len(points.sizes)))
    while left:
        critical = out_off.sum(axis=1) == 1
        # An ``off`` point has one value: what can be allowed one by one can be allowed together.
        opened = {v: np.ones(points.sizes[v], np.bool_) for v in left}
        for v, allowed in opened.items():
            allowed[points.off[critical & out_off[:, v], v]] = False
            allowed |= box[points.spans[v]]
        chosen = _most(opened, out_on, wanted)
        box[points.spans[chosen]] = opened[chosen]
        out_off[:, chosen] &= ~opened[chosen][points.off[:, chosen]]
        out_on[:, chosen] &= ~opened[chosen][wanted[:, chosen]]
        left.remove(chosen)
    return box


def _most(opened: Mapping[int, Bools], out: Bools, wanted: Ints) -> int:
    """The variable that takes in most points, each other one that they miss counted by halves."""
    near = np.exp2(-out.sum(axis=1, dtype=np.float64))

    def gain(v: int) -> tuple[float, bool, int]:
        return float(near[out[:, v] & opened[v][wanted[:, v]]].sum()), bool(opened[v].all()), -v

    return max(opened, key=gain)


def _pass(points: Points) -> Bools:
    """Prime boxes that hold every ``on`` point, built greedily."""
    left = np.arange(len(points.on))
    found = []
    while len(left):
        found.append(expand(points, points.supercube(left[:1]), points.on[left]))
        left = left[~points.inside(found[-1][None, :], points.on[left])[0]]
    return np.array(found)


def _irredundant(points: Points, pool: Bools) -> Bools:
    """A cover from a pool: what takes in most first, then without what the others hold together."""
    held = points.inside(pool, points.on)
    limited = (~pool).sum(axis=1)
    left = np.ones(len(points.on), np.bool_)
    gain = held.sum(axis=1)
    chosen: list[int] = []
    while left.any():
        chosen.append(int(np.lexsort((limited, -gain))[0]))  # of equal gain the least limited
        taken = held[chosen[-1]] & left
        gain = gain - held[:, taken].sum(axis=1)
        left &= ~taken
    times = held[chosen].sum(axis=0)
    for number in reversed(chosen.copy()):
        if (times[held[number]] > 1).all():
            times -= held[number]
            chosen.remove(number)
    return np.asarray(pool[chosen])


# ---- fewer boxes, by SAT


def _apart(points: Points, boxes: Bools) -> list[int]:
    """``on`` points of which no box can hold two: that many boxes are needed."""

    def conflict(one: int, other: int) -> bool:
        a, b = points.on[one], points.on[other]
        return bool(((points.off == a) | (points.off == b)).all(axis=1).any())

    order = np.argsort(points.inside(boxes, points.on).sum(axis=0), kind="stable")
    found: list[int] = []
    for number in order[:: max(1, len(order) // _CLIQUE)].tolist():
        if len(found) == len(boxes):
            break
        if all(conflict(number, other) for other in found):
            found.append(number)
    return found


def _fewer(points: Points, number: int, needed: Sequence[int]) -> Bools | None:
    """Boxes, ``number`` of them; none if it is proved that none do, None if it is too much work."""
    if number * (len(points.on) + len(points.off)) * len(points.sizes) > _LITERALS:
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
    held = points.inside(boxes, points.on).any(axis=0).all()
    if points.inside(boxes, points.off).any() or not held:
        raise CoordlangError(
            "the boxes that Glucose found do not hold the points that they must hold",
            remedy="This is a defect of the solver, not of the input: please report it.",
        )
    return _irredundant(points, boxes)


def _box_clauses(points: Points, number: int, needed: Sequence[int]) -> Iterator[list[int]]:
    """Clauses: ``number`` boxes hold all ``on`` points and no ``off`` point.

    Variables: box t allows column c; box t holds the ``on`` point i.  No two of the ``needed``
    points are in one box, so that each can have a box of its own.
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


# ---- shorter boxes


def _shorten(points: Points, boxes: Bools) -> Bools:
    """Each box again, around the points that only it holds: few variables limited, then prime."""
    boxes = boxes.copy()
    for _ in range(2):
        held = points.inside(boxes, points.on)
        times = held.sum(axis=0)
        for number in np.argsort(held.sum(axis=1), kind="stable").tolist():
            own = np.flatnonzero(held[number] & (times == 1))
            if not len(own):
                continue
            least = points.supercube(own)
            candidate = expand(points, _freed(points, least), points.on)
            if _length(points, candidate, least) <= _length(points, boxes[number], least):
                boxes[number] = candidate
                times -= held[number]
                held[number] = points.inside(candidate[None, :], points.on)[0]
                times += held[number]
    return _irredundant(points, boxes)


def _length(points: Points, box: Bools, least: Bools) -> tuple[int, int]:
    """The variables limited, and the values mentioned, between the least box and this one."""
    said = [_said(least[span], box[span]) for span in points.spans]
    return sum(own > 0 for own in said), sum(said)


def _said(least: Bools, most: Bools) -> int:
    """Values that must be mentioned to limit a variable to something between two sets."""
    return 0 if most.all() else min(int(least.sum()), int((~most).sum()))


def _freed(points: Points, seed: Bools) -> Bools:
    """The box with as few variables limited as keep all ``off`` points out."""
    packed, _ = unique_rows(np.packbits(points.blocked(seed, points.off), axis=1))
    outside = np.unpackbits(packed, axis=1, count=len(points.sizes)).astype(np.bool_)
    kept = _hitting(outside, [_said(seed[span], seed[span]) for span in points.spans])
    box = np.ones_like(seed)
    for v in kept:
        box[points.spans[v]] = seed[points.spans[v]]
    return box


def _hitting(rows: Bools, weights: Sequence[int]) -> Sequence[int]:
    """Columns that hit every row: the fewest and lightest, or greedily where sets are many."""
    every = range(rows.shape[1])
    tried = 0
    for size in range(len(every) + 1):
        tried += comb(len(every), size)
        if tried > _SUBSETS:
            break
        hitting = [c for c in combinations(every, size) if rows[:, list(c)].any(axis=1).all()]
        if hitting:
            return min(hitting, key=lambda c: (sum(weights[v] for v in c), c))
    chosen: list[int] = []
    left = rows
    while len(left):  # next: the column in most rows that are not hit yet
        gain = left.sum(axis=0)
        chosen.append(min(every, key=lambda v: (-gain[v], weights[v], v)))
        left = left[~left[:, chosen[-1]]]
    for v in sorted(chosen, key=lambda v: -weights[v]):  # without superfluous ones
        others = sorted({*chosen} - {v})
        if rows[:, others].any(axis=1).all():
            chosen = others
    return chosen
