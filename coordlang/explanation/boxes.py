# SPDX-License-Identifier: GPL-3.0-or-later
"""Boxes over multi-valued points: the prime implicants of a set of points against another.

A *box* allows a set of values for each variable; as a row of bits it has one column for each value
of each variable.  A box is *prime* for ``off`` points if it holds none of them and no value can be
allowed in addition.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from planners.joint.tables import Ints

Bits = NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class Points:
    """Points to hold (``on``) and to avoid (``off``).

    They are values of variables with ``sizes[v]`` values each.
    """

    sizes: tuple[int, ...]
    on: Ints
    off: Ints
    #: The first column of each variable.
    offset: Ints = field(init=False, repr=False)

    def __post_init__(self) -> None:
        sizes = np.array(self.sizes, np.int64)
        object.__setattr__(self, "offset", np.cumsum(sizes) - sizes)

    def one_hot(self, points: Ints) -> Bits:
        """Points with one column for each value of each variable."""
        bits = np.zeros((len(points), sum(self.sizes)), np.bool_)
        bits[np.arange(len(points))[:, None], points + self.offset] = True
        return bits

    def blocked(self, box: Bits, points: Ints) -> Bits:
        """In which variables each point lies outside a box."""
        return np.asarray(~box[points + self.offset])

    def inside(self, boxes: Bits, points: Ints) -> Bits:
        """Which points lie in which boxes: (boxes, points)."""
        held = np.ones((len(boxes), len(points)), np.bool_)
        columns = points + self.offset
        for v in range(len(self.sizes)):
            held &= boxes[:, columns[:, v]]
        return held

    def supercube(self, numbers: Sequence[int] | Ints) -> Bits:
        """The least box around some of the ``on`` points."""
        return np.asarray(self.one_hot(self.on[numbers]).any(axis=0))


def expand(points: Points, seed: Bits, wanted: Ints, order: Sequence[int] | None = None) -> Bits:
    """A prime box around the box ``seed``, which must hold no ``off`` point.

    Variables are opened one after the other, each to all values that keep the ``off`` points out:
    in the given order, or else first what takes in most of the ``wanted`` points (and then brings
    most of them nearest). O(variables² · points).
    """
    box = seed.copy()
    out_off = points.blocked(box, points.off)
    out_on = points.blocked(box, wanted)
    left = list(range(len(points.sizes))) if order is None else list(order)
    while left:
        critical = out_off.sum(axis=1) == 1
        tried = left if order is None else left[:1]
        opened = {v: _opened(points, box, v, critical & out_off[:, v]) for v in tried}
        chosen = tried[0] if len(tried) == 1 else _most(opened, out_on, wanted)
        start = points.offset[chosen]
        box[start : start + points.sizes[chosen]] = opened[chosen]
        out_off[:, chosen] &= ~opened[chosen][points.off[:, chosen]]
        out_on[:, chosen] &= ~opened[chosen][wanted[:, chosen]]
        left.remove(chosen)
    return box


def _opened(points: Points, box: Bits, variable: int, critical: NDArray[np.bool_]) -> Bits:
    """The values of a variable that can be allowed.

    Not those of ``off`` points that nothing else keeps out.

    Each ``off`` point has one value, so what can be allowed one by one can be allowed together.
    """
    free = np.ones(points.sizes[variable], np.bool_)
    free[points.off[critical, variable]] = False
    start = points.offset[variable]
    return free | box[start : start + points.sizes[variable]]


def _most(opened: Mapping[int, Bits], out: Bits, wanted: Ints) -> int:
    """The variable that takes in most points, those that miss several variables counted by halves.

    Open ones first.
    """
    near = np.exp2(-out.sum(axis=1, dtype=np.float64))

    def gain(v: int) -> tuple[float, bool, int]:
        return float(near[out[:, v] & opened[v][wanted[:, v]]].sum()), bool(opened[v].all()), -v

    return max(opened, key=gain)


def conflicting(points: Points, one: int, other: int) -> bool:
    """Whether no box without ``off`` points holds both of two ``on`` points."""
    a, b = points.on[one], points.on[other]
    return bool(((points.off == a) | (points.off == b)).all(axis=1).any())
