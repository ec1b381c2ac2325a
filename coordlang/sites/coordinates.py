# SPDX-License-Identifier: GPL-3.0-or-later
"""Coordinates of places, from a file or read from their names, and how near ways come."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated

import msgspec

from planners.system.errors import Position
from planners.system.files import FileFormat, doc, read_bytes
from planners.system.messages import echoed

Point = tuple[float, float]
#: Where a robot is in the course of a step, on one level: from one point to another.
Segment = tuple[Point, Point]

#: Coordinates are smaller than this; those of maps in metres reach 10 million.
_LARGEST = 1e8
#: Names that hold two numbers, and the text before the first one that says it is the column.
_PAIR = re.compile(
    r"(?P<stem>.*?)(?P<first>\d+)(?P<between>[^0-9]+)(?P<second>\d+)(?P<end>[^0-9]*)"
)
_COLUMN = re.compile(r"(^|[^a-z])(x|col|column)[-_]?$")


class CoordinatesFile(msgspec.Struct):
    """A file of coordinates.  Keys that are not listed here are ignored by readers."""

    coordinates: Annotated[
        dict[str, Point], doc("Place -> [x, y], x to the right and y down; no two alike.")
    ]


COORDINATES = FileFormat("coordinates", "file of coordinates", CoordinatesFile)


def read_coordinates(path: str | Path) -> dict[str, Point]:
    """Read a file of coordinates, ``{"coordinates": {"depot": [0, 0], "town": [1, 0]}}``.

    x to the right, y down; names are lower case in the result.  Raises `BadInput` for anything
    else, and if two places have the same coordinates.
    """
    position = Position(str(path))
    return checked(COORDINATES.decode(read_bytes(path), position).coordinates, position)


def checked(entries: Mapping[str, Point], position: Position) -> dict[str, Point]:
    """Coordinates by names in lower case.

    Raises `BadInput` if some are too large or no numbers, and if places or points are not
    different.
    """
    for name, point in entries.items():
        if not all(abs(value) < _LARGEST for value in point):
            what = f"the coordinates must be between {-_LARGEST:g} and {_LARGEST:g}"
            remedy = "Scale the coordinates: only their proportions are drawn."
            raise position.fail(f"{echoed(name)}: {what}", remedy)
    points = {name.lower(): point for name, point in entries.items()}
    if len(points) < len(entries):
        what = "a place occurs twice, in upper and in lower case"
        remedy = "PDDL does not distinguish them: of two entries one would be lost."
        raise position.fail(what, remedy)
    if len(set(points.values())) < len(points):
        raise position.fail("two places have the same coordinates", "Give each one of its own.")
    return points


def from_names(names: Sequence[str], links: Sequence[tuple[str, str]]) -> dict[str, Point] | None:
    """Read coordinates from names: ``c2-3`` is row 2, column 3; ``loc-x2-y3`` is column 2, row 3.

    None unless all names have one form with two numbers, all points differ, and most links join
    neighbours on the grid.
    """
    pairs = _numbers(names)
    if len(names) < 2 or len({*pairs}) < len(names) or max(map(max, pairs)) >= _LARGEST:
        return None
    points = dict(zip(names, pairs, strict=True))
    near = [math.dist(points[a], points[b]) < 1.5 for a, b in links]
    return points if sum(near) >= 0.8 * len(near) else None


def _numbers(names: Sequence[str]) -> list[Point]:
    """Column and row in each name; nothing unless all names have one form with two numbers."""
    matches = [match for match in map(_PAIR.fullmatch, names) if match is not None]
    forms = {(m["stem"], m["between"], m["end"]) for m in matches}
    if len(matches) < len(names) or len(forms) != 1:
        return []
    pairs = [(float(m["first"]), float(m["second"])) for m in matches]
    if _COLUMN.search(matches[0]["stem"].lower()):
        return pairs
    return [(column, row) for row, column in pairs]


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
