# SPDX-License-Identifier: GPL-3.0-or-later
"""What robots of a building may not do in one step: come too near, or share a mutex group."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from statistics import fmean

from coordlang.sites.building import Lane, Place
from coordlang.sites.coordinates import Point

#: Metres that rounding may be wrong by.
_ROUNDING = 1e-9
#: Where a robot is in the course of a step, on one level: from one point to another.
Segment = tuple[Point, Point]


@dataclass(frozen=True, slots=True)
class Motion:
    """What one robot does in a step: it drives from a place to another one, or stays in one.

    ``on`` says by levels where it is meanwhile.
    """

    start: str
    end: str
    on: Mapping[str, Segment]
    groups: frozenset[str]


def staying(place: Place) -> Motion:
    """Standing in a place for a step."""
    return Motion(place.name, place.name, {place.level: (place.point, place.point)}, place.groups)


def motions(places: Mapping[str, Place], lanes: Iterable[Lane]) -> list[Motion]:
    """Driving along lanes; each of them once, whatever the graphs that have it."""
    groups: dict[tuple[str, str], frozenset[str]] = {}
    for lane in lanes:
        ends = lane.start, lane.end
        own = lane.groups | places[lane.start].groups | places[lane.end].groups
        groups[ends] = groups.get(ends, frozenset()) | own
    found = []
    for (start, end), those in groups.items():
        one, other = places[start], places[end]
        on = {each.level: (each.point, each.point) for each in (one, other)}  # a ride in a lift
        if one.level == other.level:
            on = {one.level: (one.point, other.point)}
        found.append(Motion(start, end, on, those))
    return found


def clash(one: Motion, other: Motion, clearance: float) -> bool:
    """Whether two robots may not do this in one step, for what they share or how near they come."""
    if one.groups & other.groups:
        return True
    levels = one.on.keys() & other.on.keys()
    return any(distance(one.on[k], other.on[k]) < clearance - _ROUNDING for k in levels)


def excluded(
    places: Iterable[Place], driving: Iterable[Motion], clearance: float
) -> tuple[list[tuple[str, Motion]], list[tuple[Motion, Motion]]]:
    """The places where nobody may stand while someone drives along a lane, and pairs of lanes.

    What the rules for every pair of robots forbid is left out: sharing a place, and swapping.
    """
    driving = list(driving)
    if not driving or (clearance <= 0 and not any(motion.groups for motion in driving)):
        return [], []
    near = _Near(driving, clearance)
    at = [(number, still) for still in map(staying, places) for number in near.of(still)]
    blocked = [
        (still.start, driving[number])
        for number, still in sorted(at, key=lambda pair: pair[0])
        if still.start not in (driving[number].start, driving[number].end)
        and clash(still, driving[number], clearance)
    ]
    return blocked, list(_pairs(driving, near, clearance))


def _pairs(
    driving: Sequence[Motion], near: _Near, clearance: float
) -> Iterator[tuple[Motion, Motion]]:
    for number, one in enumerate(driving):
        for other in (driving[k] for k in near.of(one) if k > number):
            is_swap = (one.start, one.end) == (other.end, other.start)
            is_known = is_swap or one.start == other.start or one.end == other.end
            if not is_known and clash(one, other, clearance):
                yield one, other


class _Near:
    """Motions by groups, and by the squares of the floor that they may be near to.

    Two motions that clash have one of them in common.
    """

    def __init__(self, motions: Sequence[Motion], clearance: float) -> None:
        lengths = [math.dist(*line) for motion in motions for line in motion.on.values()]
        self._around = clearance / 2 + _ROUNDING
        self._side = clearance + max(fmean(lengths), max(lengths) / 100) if clearance > 0 else 0.0
        self._there: dict[object, list[int]] = {}
        for number, motion in enumerate(motions):
            for key in self._keys(motion):
                self._there.setdefault(key, []).append(number)

    def of(self, motion: Motion) -> list[int]:
        """The numbers of the motions that may clash with one, sorted."""
        keys = self._keys(motion)
        return sorted({number for key in keys for number in self._there.get(key, ())})

    def _keys(self, motion: Motion) -> Iterator[object]:
        yield from motion.groups
        for level, line in motion.on.items() if self._side else ():
            spans = []
            for ends in zip(*line, strict=True):
                low, high = min(ends) - self._around, max(ends) + self._around
                spans.append(range(int(low // self._side), int(high // self._side) + 1))
            yield from product((level,), *spans)


def distance(one: Segment, other: Segment) -> float:
    """How near two robots come in a step, from and to these points.

    Lanes are as far apart as their nearest points, whatever the speeds of robots. Where one robot
    follows another into the place that this one leaves, both drive evenly through the step.
    """
    (a, b), (c, d) = one, other
    if a == d or b == c:
        return _from((0.0, 0.0), ((a[0] - c[0], a[1] - c[1]), (b[0] - d[0], b[1] - d[1])))
    if _sides(one, c, d) < 0 and _sides(other, a, b) < 0:
        return 0.0  # they cross
    return min(_from(a, other), _from(b, other), _from(c, one), _from(d, one))


def _from(point: Point, segment: Segment) -> float:
    (x, y), ((ax, ay), (bx, by)) = point, segment
    squared = (bx - ax) ** 2 + (by - ay) ** 2
    along = 0.0 if squared == 0 else ((x - ax) * (bx - ax) + (y - ay) * (by - ay)) / squared
    along = min(1.0, max(0.0, along))
    return math.hypot(ax + along * (bx - ax) - x, ay + along * (by - ay) - y)


def _sides(line: Segment, one: Point, other: Point) -> float:
    """Below 0 where two points are on different sides of a line."""
    (ax, ay), (bx, by) = line
    first, second = ((bx - ax) * (y - ay) - (by - ay) * (x - ax) for x, y in (one, other))
    return first * second
