# SPDX-License-Identifier: GPL-3.0-or-later
"""The floor: where places lie in metres, the walls between cells, and a human who walks there.

x to the right, y up; the place drawn lowest and furthest left has the coordinates 0.  Where places
are the cells of a grid, there is a wall along every side of a cell that no link crosses.  Elsewhere
there are no walls.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Collection, Iterable, Mapping, Sequence
from random import Random

from coordlang.sites.coordinates import Point, from_names
from coordlang.sites.world import World
from planners.system.errors import BadInput, UsageError
from planners.system.messages import echoed

#: A wall: (x, y) of one end, (x, y) of the other, in metres.
Wall = tuple[float, float, float, float]

#: The greatest radius of a robot, as a share of the shortest link.  Robots that move at once come
#: as near as 0.707 of a link to each other: one leaves a place at a right angle to the one that
#: comes, which has the other one's flank before it meanwhile, and must neither touch it nor stop.
_MOST_RADIUS = 0.25

#: What stands for a place in ``Settings.human``: a place drawn for each run, or one to walk from.
_STANDING_SOMEWHERE, _WALKING = "random", "walking"
#: Metres a second that a human walks, for places one metre apart.
_SPEED = 0.5
#: The share of a cell within which a human has reached a place.
_REACHED = 0.05


class Floor:
    """Where the places and walls of a world are, and the pairs of places that moves link.

    ``longest`` and ``shortest`` are the lengths of such links, in metres; 0 and infinite without.
    ``known`` are coordinates of places, x to the right and y down, as a file of coordinates has
    them; where they are not all known, the names of the places have to say them (``c2-3``).
    ``cell`` is the length of one unit of them in metres.  Raises `BadInput` if the coordinates are
    not known.
    """

    def __init__(self, world: World, known: Mapping[str, Point], cell: float) -> None:
        links = tuple(sorted({link.ends for link in world.links}))
        points = _points(world.places, links, known)
        top = max((y for _, y in points.values()), default=0.0)
        left = min((x for x, _ in points.values()), default=0.0)
        self.points: dict[str, Point] = {
            name: ((x - left) * cell, (top - y) * cell) for name, (x, y) in points.items()
        }
        self.walls = _walls(points, links, cell)
        self.links = tuple(link.ends for link in world.links if link.moves)
        lengths = [math.dist(self.points[a], self.points[b]) for a, b in self.links]
        self.longest, self.shortest = max(lengths, default=0.0), min(lengths, default=math.inf)


def require_room(floor: Floor, radius: float) -> None:
    """Raise `UsageError` if robots of this radius, in metres, are too large for the floor."""
    most = _MOST_RADIUS * floor.shortest
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


def _walls(
    points: Mapping[str, Point], links: Sequence[tuple[str, str]], cell: float
) -> tuple[Wall, ...]:
    """The sides of the cells of a grid that no link crosses; none where places are no cells."""
    cells = {point: name for name, point in points.items()}
    if any(value != int(value) for point in cells for value in point):
        return ()
    if any(math.dist(points[a], points[b]) != 1 for a, b in links):
        return ()
    found = []
    for (is_upright, line), begins in _closed_sides(cells, links).items():
        ends = {begin + 2 for begin in begins}
        for begin, end in zip(sorted(begins - ends), sorted(ends - begins), strict=True):
            # Whole micrometres, so that equal lengths are equal numbers.
            at, low, high = (round(half * cell / 2, 6) for half in (line, begin, end))
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


class Human:
    """A human in a place, or walking from ``before`` to ``place``, and then on.

    ``wanted`` is a place, ``random`` or ``walking``; where no robot starts or ends, unless it is
    named.  Raises `UsageError` if there is no such place, a robot starts there, or none is left.
    """

    def __init__(
        self,
        wanted: str,
        floor: Floor,
        starts: Collection[str],
        goals: Collection[str],
        cell: float,
        random: Random,
    ) -> None:
        free = sorted(set(floor.points) - {*starts, *goals})
        named = wanted not in (_STANDING_SOMEWHERE, _WALKING)
        if named and (wanted in starts or wanted not in floor.points):
            why = "a robot starts in this place" if wanted in starts else "there is no such place"
            raise UsageError(
                f"--human {echoed(wanted)}: {why}",
                remedy=f"Say a place such as {min(floor.points)}, or {_STANDING_SOMEWHERE}, or "
                f"{_WALKING}.",
            )
        if not named and not free:
            raise UsageError(
                "there is no place for a human: robots start or end in all of them",
                remedy="Leave out --human.",
            )
        self.place = self.before = wanted if named else random.choice(free)
        self.walks = wanted == _WALKING
        self._floor, self._cell, self._random = floor, cell, random
        self._ways: dict[str, list[str]] = {name: [] for name in floor.points}
        for one, other in floor.links:
            self._ways[one].append(other)
            self._ways[other].append(one)

    def velocity(self, at: Point, robots: Sequence[Point], clearance: float) -> tuple[float, float]:
        """Return how the human walks, in metres a second to the right and up.

        The human turns back where a robot ahead is nearer than ``clearance``, from middle to
        middle, and stands still where that leads to another one.
        """
        if not self.walks:
            return 0.0, 0.0
        if self._meets(at, robots, clearance):
            self.place, self.before = self.before, self.place
            if self._meets(at, robots, clearance):
                return 0.0, 0.0
        target = self._floor.points[self.place]
        if math.dist(at, target) < _REACHED * self._cell and self._ways[self.place]:
            self.before = self.place
            self.place = self._random.choice(self._ways[self.place])
            target = self._floor.points[self.place]
        way = target[0] - at[0], target[1] - at[1]
        length = math.hypot(*way)
        speed = min(_SPEED * self._cell, 4 * length) / length if length else 0.0
        return way[0] * speed, way[1] * speed

    def _meets(self, at: Point, robots: Iterable[Point], clearance: float) -> bool:
        """Say whether a robot is near on the way ahead."""
        target = self._floor.points[self.place]
        way = target[0] - at[0], target[1] - at[1]
        return any(
            math.dist(at, robot) < clearance
            and (robot[0] - at[0]) * way[0] + (robot[1] - at[1]) * way[1] > 0
            for robot in robots
        )
