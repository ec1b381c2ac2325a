# SPDX-License-Identifier: GPL-3.0-or-later
"""The floor: where places lie in metres, and the walls between cells.

x to the right, y up; the place drawn lowest and furthest left has the coordinates 0.  Where places
are the cells of a grid, there is a wall along every side of a cell that no link crosses.  Elsewhere
there are no walls.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby

from coordlang.sites.coordinates import Point, from_names
from coordlang.sites.world import World
from planners.system.errors import BadInput, UsageError

#: A wall: (x, y) of one end, (x, y) of the other, in metres.
Wall = tuple[float, float, float, float]

#: The greatest radius of a robot, as a share of the shortest link.  Robots that move at once come
#: as near as 0.707 of a link to each other: one leaves a place at a right angle to the one that
#: comes, which has the other one's flank before it meanwhile, and must neither touch it nor stop.
MOST_RADIUS = 0.25


@dataclass(frozen=True, slots=True)
class Floor:
    """Places and walls in metres.

    Attributes
    ----------
    points
        Where the middle of each place is.
    walls
        Each from one point to another.
    links
        The pairs of places between which something moves.
    """

    points: Mapping[str, Point]
    walls: tuple[Wall, ...]
    links: tuple[tuple[str, str], ...]

    @property
    def longest(self) -> float:
        """The length of the longest link, in metres."""
        return max((math.dist(self.points[a], self.points[b]) for a, b in self.links), default=0.0)

    @property
    def shortest(self) -> float:
        """The length of the shortest link, in metres; infinite without links."""
        return min(
            (math.dist(self.points[a], self.points[b]) for a, b in self.links), default=math.inf
        )


def floor_of(world: World, known: Mapping[str, Point], cell: float) -> Floor:
    """Lay places out on a floor.

    Parameters
    ----------
    world
        The places of a domain, and their links.
    known
        Coordinates of places, x to the right and y down, as a file of coordinates has them; where
        they are not all known, the names of the places have to say them (``c2-3``).
    cell
        Metres for one unit of the coordinates.

    Raises
    ------
    BadInput
        If the coordinates of the places are not known.
    """
    links = tuple(sorted({link.ends for link in world.links}))
    points = _points(world.places, links, known)
    top = max((y for _, y in points.values()), default=0.0)
    left = min((x for x, _ in points.values()), default=0.0)
    metres = {name: ((x - left) * cell, (top - y) * cell) for name, (x, y) in points.items()}
    moves = tuple(link.ends for link in world.links if link.moves)
    return Floor(metres, _walls(points, metres, links, cell), moves)


def require_room(floor: Floor, radius: float) -> None:
    """Raise `UsageError` if robots of this radius, in metres, are too large for the floor."""
    most = MOST_RADIUS * floor.shortest
    if radius > most:
        raise UsageError(
            f"robots with a radius of {radius:g} m are too large for places {floor.shortest:g} m "
            "apart: they touch where one leaves a place at a right angle to the one that comes",
            remedy=f"Use a --radius of at most {most:g}, or a larger --cell.",
        )


def outlines(walls: Sequence[Wall]) -> list[list[Point]]:
    """Draw walls that touch at their ends without lifting the pen, every wall there and back.

    A simulator looks at each thing in each tick, so that a few long ones are cheaper than many.
    """
    ways: dict[Point, list[Point]] = {}
    for x1, y1, x2, y2 in walls:
        ways.setdefault((x1, y1), []).append((x2, y2))
        ways.setdefault((x2, y2), []).append((x1, y1))
    drawn: set[frozenset[Point]] = set()
    found = []
    for start in sorted(ways):
        line, path = [start], [start]
        while path:
            here = path[-1]
            left = [there for there in ways[here] if frozenset((here, there)) not in drawn]
            if left:
                drawn.add(frozenset((here, left[0])))
                path.append(left[0])
            else:
                path.pop()
            if path:
                line.append(path[-1])
        if len(line) > 1:
            found.append(line)
    return found


def _points(
    places: Sequence[str], links: Sequence[tuple[str, str]], known: Mapping[str, Point]
) -> Mapping[str, Point]:
    if not places:
        raise BadInput(
            "no action of this domain moves anything from place to place",
            remedy="Simulate a domain whose robots move between places.",
        )
    if all(name in known for name in places):
        return {name: known[name] for name in places}
    found = from_names(places, links)
    if found is None:
        missing = [name for name in places if name not in known]
        raise BadInput(
            f"where the places lie is not known: {', '.join(missing[:5])}"
            f"{' ..' if len(missing) > 5 else ''}",
            remedy="Give a file with --coordinates, or coordinates.json beside the problem "
            "(`coordlang schema coordinates`), or call places as cells are: c2-3.",
        )
    return found


def _walls(
    points: Mapping[str, Point],
    metres: Mapping[str, Point],
    links: Sequence[tuple[str, str]],
    cell: float,
) -> tuple[Wall, ...]:
    """The sides of the cells of a grid that no link crosses; none where places are no cells."""
    cells = {point: name for name, point in points.items()}
    if any(value != int(value) for point in cells for value in point):
        return ()
    if any(math.dist(points[a], points[b]) != 1 for a, b in links):
        return ()
    open_sides = {frozenset(ends) for ends in links}
    level: set[tuple[float, float]] = set()  # (y, x of the left end) in half cells, y up
    upright: set[tuple[float, float]] = set()
    for (column, row), name in cells.items():
        x, y = metres[name]
        for dx, dy in ((1, 0), (-1, 0), (0, 1), (0, -1)):
            other = cells.get((column + dx, row - dy))
            if other is not None and frozenset((name, other)) in open_sides:
                continue
            if dx:
                upright.add((_round(x + dx * cell / 2), _round(y - cell / 2)))
            else:
                level.add((_round(y + dy * cell / 2), _round(x - cell / 2)))
    found = [(start, y, end, y) for y, start, end in _runs(level, cell)]
    found += [(x, start, x, end) for x, start, end in _runs(upright, cell)]
    return tuple(sorted(found))


def _runs(sides: Iterable[tuple[float, float]], cell: float) -> list[tuple[float, float, float]]:
    """Sides on one line put together: (the line, the beginning, the end)."""
    found = []
    for line, group in groupby(sorted(sides), key=lambda side: side[0]):
        starts = [start for _, start in group]
        begin = starts[0]
        for start, following in zip(starts, [*starts[1:], None], strict=True):
            end = _round(start + cell)
            if following is None or abs(following - end) > cell / 100:
                found.append((line, begin, end))
                begin = following if following is not None else end
    return found


def _round(metres: float) -> float:
    """Whole micrometres, so that equal lengths are equal numbers."""
    return round(metres, 6)
