# SPDX-License-Identifier: GPL-3.0-or-later
"""What robots of a building may not do in one step: come too near, or share a mutex group."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from coordlang.sites.building import Building, Place
from coordlang.sites.coordinates import Point
from planners.joint.tables import Bools

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


def _driving(building: Building) -> list[Motion]:
    """Driving along lanes; each of them once, whatever the graphs that have it."""
    groups = defaultdict[tuple[str, str], frozenset[str]](frozenset)
    for lane in building.lanes:
        groups[lane.start, lane.end] |= lane.groups
    return [motion(building.places[a], building.places[b], own) for (a, b), own in groups.items()]


def motion(start: Place, end: Place, groups: frozenset[str] = frozenset()) -> Motion:
    """Driving along a lane, riding in a lift, or, from a place to itself, staying there."""
    on = {place.level: (place.point, place.point) for place in (start, end)}
    if start.level == end.level:
        on = {start.level: (start.point, end.point)}
    return Motion(start.name, end.name, on, groups | start.groups | end.groups)


def clash(one: Motion, other: Motion, clearance: float) -> bool:
    """Whether two robots may not do this in one step, for what they share or how near they come."""
    if one.groups & other.groups:
        return True
    levels = one.on.keys() & other.on.keys()
    return any(distance(one.on[k], other.on[k]) < clearance - _ROUNDING for k in levels)


def excluded(building: Building, clearance: float) -> list[tuple[Motion, Motion]]:
    """Driving along a lane, and what nobody may do meanwhile: drive along another one, or stay.

    What the rules for every pair of robots forbid is left out: sharing a place, and swapping.
    """
    driving = _driving(building)
    if not driving or (clearance <= 0 and not any(motion.groups for motion in driving)):
        return []
    motions = [*driving, *(motion(place, place) for place in building.places.values())]
    near = np.triu(_near(motions, clearance), 1)[: len(driving)]
    pairs = [(motions[first], motions[second]) for first, second in np.argwhere(near).tolist()]
    return [pair for pair in pairs if not _is_ruled_out(*pair) and clash(*pair, clearance)]


def _is_ruled_out(one: Motion, other: Motion) -> bool:
    is_swap = (one.start, one.end) == (other.end, other.start)
    return is_swap or one.start == other.start or one.end == other.end


def _near(motions: Sequence[Motion], clearance: float) -> Bools:
    """Which motions may clash with which: they have a group in common, or their boxes are near."""
    near = np.zeros((len(motions), len(motions)), np.bool_)
    for group in frozenset[str]().union(*(motion.groups for motion in motions)):
        inside = [group in motion.groups for motion in motions]
        near |= np.outer(inside, inside)
    for level in {level for motion in motions for level in motion.on}:
        there = [number for number, motion in enumerate(motions) if level in motion.on]
        ends = np.array([motions[number].on[level] for number in there])
        low, high = ends.min(axis=1), ends.max(axis=1) + clearance
        near[np.ix_(there, there)] |= ((low[:, None] <= high) & (low <= high[:, None])).all(axis=2)
    return near


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
