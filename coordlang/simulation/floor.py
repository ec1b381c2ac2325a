# SPDX-License-Identifier: GPL-3.0-or-later
"""The floor: where places lie in metres, and the walls between cells.

x to the right, y up; the place drawn lowest and furthest left has the coordinates 0.  Where places
are the cells of a grid, there is a wall along every side of a cell that no link crosses.  Elsewhere
there are no walls.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Mapping, Sequence

import numpy as np

from coordlang.sites.coordinates import Point, from_names
from coordlang.sites.world import World
from planners.system.errors import BadInput, UsageError

#: A wall: (x, y) of one end, (x, y) of the other, in metres.
Wall = tuple[float, float, float, float]

#: The greatest radius of a robot, as a share of the shortest link.  On grids robots that move at
#: once come as near as 0.707 of a link to each other: one leaves a place at a right angle to the
#: one that comes, which has its flank before it meanwhile, and must neither touch it nor stop.
MOST_RADIUS = 0.25


class Floor:
    """Where the places and walls of a world are.

    ``longest`` and ``shortest`` are the lengths of the links that moves use, in metres; 0 and
    infinite without.  ``known`` are coordinates of places, x to the right and y down, as a file of
    coordinates has them; where they are not all known, the names of the places have to say them
    (``c2-3``).  Raises `BadInput` if the coordinates are not known.
    """

    def __init__(self, world: World, known: Mapping[str, Point]) -> None:
        links = [link.ends for link in world.links]
        points = _points(world.places, links, known)
        top = max((y for _, y in points.values()), default=0.0)
        left = min((x for x, _ in points.values()), default=0.0)
        self.points = {name: (x - left, top - y) for name, (x, y) in points.items()}
        self.walls = _walls(points, links)
        moves = (link.ends for link in world.links if link.moves)
        lengths = [math.dist(self.points[a], self.points[b]) for a, b in moves]
        self.longest, self.shortest = max(lengths, default=0.0), min(lengths, default=math.inf)


def require_room(floor: Floor, radius: float) -> None:
    """Raise `UsageError` if robots of this radius, in metres, are too large for the floor."""
    most = MOST_RADIUS * floor.shortest
    if radius > most:
        raise UsageError(
            f"robots with a radius of {radius:g} m are too large for places {floor.shortest:g} m "
            "apart: they touch where one leaves a place at a right angle to the one that comes",
            remedy=f"Their radius may be {most:g} at most.",
        )


def outlines(walls: Sequence[Wall]) -> list[list[Point]]:
    """Draw walls that touch at their ends without lifting the pen, every wall there and back.

    A simulator looks at each thing in each tick, so that a few long ones are cheaper than many.
    """
    import networkx as nx

    graph = nx.DiGraph()
    for x1, y1, x2, y2 in sorted(walls):
        graph.add_edges_from([((x1, y1), (x2, y2)), ((x2, y2), (x1, y1))])
    found = []
    for ends in sorted(nx.weakly_connected_components(graph), key=min):
        circuit = nx.eulerian_circuit(graph.subgraph(ends), min(ends))
        found.append([min(ends), *(end for _, end in circuit)])
    return found


def _points(
    places: Sequence[str], links: Sequence[tuple[str, str]], known: Mapping[str, Point]
) -> Mapping[str, Point]:
    if not places:
        raise BadInput(
            "no action of this domain moves anything from place to place",
            remedy="Simulate a domain whose robots move between places.",
        )
    missing = [name for name in places if name not in known]
    found = from_names(places, links) if missing else {name: known[name] for name in places}
    if found is None:
        more = " .." if len(missing) > 5 else ""
        raise BadInput(
            f"where the places lie is not known: {', '.join(missing[:5])}{more}",
            remedy="Give a file with --coordinates, or coordinates.json beside the problem "
            "(`coordlang schema coordinates`), or call places as cells are: c2-3.",
        )
    return found


def _walls(points: Mapping[str, Point], links: Sequence[tuple[str, str]]) -> tuple[Wall, ...]:
    """The sides of the cells of a grid that no link crosses; none where places are no cells."""
    is_off_grid = (np.array([*points.values()]) % 1).any()
    if is_off_grid or any(math.dist(points[a], points[b]) != 1 for a, b in links):
        return ()
    cells, found = {point: name for name, point in points.items()}, []
    for (is_upright, line), begins in _closed_sides(cells, links).items():
        ends = {begin + 2 for begin in begins}
        for begin, end in zip(sorted(begins - ends), sorted(ends - begins), strict=True):
            # Whole micrometres, so that equal lengths are equal numbers.
            at, low, high = round(line / 2, 6), round(begin / 2, 6), round(end / 2, 6)
            found.append((at, low, at, high) if is_upright else (low, at, high, at))
    return tuple(sorted(found))


def _closed_sides(
    cells: Mapping[Point, str], links: Sequence[tuple[str, str]]
) -> dict[tuple[bool, float], set[float]]:
    """In half cells, y up: whether they are upright, and on which line -> where sides begin."""
    open_sides = {frozenset(ends) for ends in links}
    left, top = min(x for x, _ in cells), max(y for _, y in cells)
    sides: dict[tuple[bool, float], set[float]] = defaultdict(set)
    for (column, row), name in cells.items():
        x, y = 2 * (column - left), 2 * (top - row)
        for dx, dy in ((1, 0), (-1, 0), (0, 1), (0, -1)):
            other = cells.get((column + dx, row - dy))
            if other is None or frozenset((name, other)) not in open_sides:
                side, begin = ((True, x + dx), y - 1) if dx else ((False, y + dy), x - 1)
                sides[side].add(begin)
    return sides
