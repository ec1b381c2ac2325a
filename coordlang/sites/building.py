# SPDX-License-Identifier: GPL-3.0-or-later
"""Buildings of Open-RMF as traffic editor writes them (``*.building.yaml``): places and lanes.

https://github.com/open-rmf/rmf_traffic_editor has the editor.
"""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import chain, combinations, groupby
from pathlib import Path
from statistics import fmean

from coordlang.sites.coordinates import Point
from coordlang.sites.yaml_file import Value, read_yaml
from planners.pddl.pddl_text import named_like
from planners.system.files import require_seen
from planners.system.messages import echoed

#: What is read of a level; other lists there (doors, floors, walls ..) are named as not used.
_READ = {"vertices", "lanes", "measurements", "fiducials"}
#: Parameters of vertices and lanes that would matter to a robot, and are named as not used, too.
_IGNORED = ("dock_name", "orientation", "speed_limit")
#: The parameter of the places in a lift.
_LIFT = "lift_cabin"
#: Metres between levels that are drawn side by side.
_BETWEEN = 5.0

#: The parameters of a vertex or lane, ``name: [type, value]``.
_Params = Mapping[str, Value]


@dataclass(frozen=True, slots=True)
class Place:
    """A vertex with lanes; vertices of a level at one point are one place.

    ``said`` is its name in the file, if it has one, and ``vertex`` says its level and the number of
    its vertex, ``L1:0``.  ``point`` is in metres on its ``level``, x to
    the right and y down.  ``groups`` are the mutex groups and the lift that it belongs to.
    """

    name: str
    said: str
    vertex: str
    level: str
    point: Point
    is_charger: bool
    is_parking: bool
    groups: frozenset[str]


@dataclass(frozen=True, slots=True)
class Lane:
    """A way from one place to another for the robots of a graph; or a ride in a lift."""

    graph: int
    start: str
    end: str
    groups: frozenset[str]


@dataclass(frozen=True, slots=True)
class Building:
    """The places and lanes of a building, by the names that they have in PDDL.

    ``spawning`` has the robots that start in it, and where.  ``unscaled`` are the levels without
    a measurement, where pixels are taken for metres; ``unused`` counts what is in the file besides.
    """

    path: str
    places: Mapping[str, Place]
    lanes: tuple[Lane, ...]
    spawning: Mapping[str, str]
    unscaled: tuple[str, ...]
    unused: Mapping[str, int]

    def coordinates(self) -> dict[str, Point]:
        """Where places are drawn, in metres: the levels side by side."""
        drawn: dict[str, Point] = {}
        shift = right = 0.0
        for _, on_level in groupby(self.places.values(), lambda place: place.level):
            places = list(on_level)
            if drawn:
                shift = right + _BETWEEN - min(place.point[0] for place in places)
            own = {p.name: (round(p.point[0] + shift, 3), round(p.point[1], 3)) for p in places}
            right = max(x for x, _ in own.values())
            drawn |= own
        return drawn


def pddl_name(text: str) -> str:
    """A name that PDDL has, too, as like a text as may be; empty if nothing is left.

    None of those of graphs: an object of two kinds is declared twice.
    """
    name = named_like(text)
    is_own = name[:1].isalpha() and not name.startswith("graph-")
    return name if not name or is_own else f"p-{name}"


def read_building(path: Path) -> Building:
    """Read a building; raises `BadInput`, with the line, for what is none, as `read_yaml` does."""
    root = read_yaml(path)
    content = root.mapping()
    named = content["levels"].mapping() if "levels" in content else {}
    levels = [_Level(name, value) for name, value in named.items()]
    vertices = [vertex for level in levels for vertex in level.used]
    if not vertices:
        remedy = "Expected 'levels:' with 'vertices:' and 'lanes:'; robots drive on nothing else."
        raise content.get("levels", root).wrong("this building has no lanes", remedy)
    unscaled = _set_scales(levels, content)
    spawning = _spawning(vertices)
    places = _places(vertices, {*spawning})
    lanes = [lane for level in levels for lane in level.driven()]
    return Building(
        str(path),
        places,
        tuple(dict.fromkeys([*lanes, *_rides(places, lanes)])),
        {robot: vertex.name for robot, vertex in spawning.items()},
        unscaled,
        dict(sum((level.unused() for level in levels), Counter[str]())),
    )


@dataclass(slots=True)
class _Vertex:
    """A vertex of a level, or all at one point: their first name, and the parameters of each.

    ``point`` is in units of the file until the scale of its level is known; then it has a ``name``.
    """

    level: str
    number: int
    point: Point
    value: Value
    said: str = ""
    params: list[_Params] = field(default_factory=list)
    name: str = ""

    def place(self) -> Place:
        is_charger, is_parking = (
            any(_flag(params, name) for params in self.params)
            for name in ("is_charger", "is_parking_spot")
        )
        groups = frozenset[str]().union(*map(_groups, self.params))
        names = self.name, self.said, f"{self.level}:{self.number}"
        return Place(*names, self.level, self.point, is_charger, is_parking, groups)

    def robots(self) -> list[str]:
        """The robots that start here, as the file calls them."""
        return [*filter(None, (_text(params, "spawn_robot_name") for params in self.params))]


class _Level:
    """A level while it is read: its vertices, and lanes from one to another."""

    def __init__(self, name: str, value: Value) -> None:
        require_seen(name, value.position, "level")
        self.name = name
        self.content = value.mapping()
        at: dict[Point, _Vertex] = {}
        self.vertices = [self._vertex(*each, at) for each in enumerate(self._list("vertices"))]
        self.lanes = [self._edge(each) for each in self._list("lanes")]
        numbers = {each.number for start, end, _ in self.lanes for each in (start, end)}
        #: The vertices with lanes, in the order of the file, and those without.
        self.used = [self.vertices[number] for number in sorted(numbers)]
        self.left = [vertex for vertex in at.values() if vertex.number not in numbers]

    def _list(self, key: str) -> Sequence[Value]:
        return self.content[key].list() if key in self.content else []

    def _vertex(self, number: int, value: Value, at: dict[Point, _Vertex]) -> _Vertex:
        x, y, _, said, *params = value.list(4)
        require_seen(said.text(), said.position)
        point = x.number(), y.number()
        vertex = at.setdefault(point, _Vertex(self.name, number, point, value))
        vertex.said = vertex.said or said.text()
        vertex.params.append(params[0].mapping() if params else {})
        return vertex

    def _edge(self, value: Value) -> tuple[_Vertex, _Vertex, _Params]:
        start, end, *params = value.list(2)
        ends = [self.vertices[each.index(len(self.vertices))] for each in (start, end)]
        if ends[0] is ends[1]:
            raise value.wrong("both ends are at one point", "Remove it, or move one of the ends.")
        return ends[0], ends[1], params[0].mapping() if params else {}

    def measured(self) -> float | None:
        """Metres for each unit: the mean of the measurements, None if there are none."""
        scales = []
        for value in self._list("measurements"):
            start, end, params = self._edge(value)
            distance = _param(params, "distance")
            metres = 0.0 if distance is None else distance.number()
            if metres <= 0:
                raise value.wrong("a measurement needs a distance above 0", "Correct its metres.")
            scales.append(metres / math.dist(start.point, end.point))
        return fmean(scales) if scales else None

    def fiducials(self) -> dict[str, Point]:
        """Name -> point, in units of the file."""
        found = [value.list(3) for value in self._list("fiducials")]
        return {name.text(): (x.number(), y.number()) for x, y, name, *_ in found}

    def set_scale(self, x_metres: float, y_metres: float, origin: Point = (0.0, 0.0)) -> None:
        """Turn the points of the vertices with lanes into metres."""
        for vertex in self.used:
            x, y = vertex.point
            vertex.point = (x - origin[0]) * x_metres, (y - origin[1]) * y_metres

    def driven(self) -> Iterator[Lane]:
        """The lanes in each direction in which robots drive."""
        for start, end, params in self.lanes:
            graph = _param(params, "graph_idx")
            number, groups = 0 if graph is None else graph.index(), _groups(params)
            yield Lane(number, start.name, end.name, groups)
            if _flag(params, "bidirectional"):
                yield Lane(number, end.name, start.name, groups)

    def unused(self) -> Counter[str]:
        """What is in the file and not read, by what it is called there."""
        found = Counter[str]()
        for key, value in self.content.items():
            if value.is_list and key not in _READ:
                found[key] = len(value.list())
        lanes = [params for _, _, params in self.lanes]
        for params in chain(lanes, *(vertex.params for vertex in self.used)):
            found.update(name for name in _IGNORED if _text(params, name) not in ("", "0"))
        found["robots off lanes"] = sum(bool(vertex.robots()) for vertex in self.left)
        return +found


def _param(params: _Params, name: str) -> Value | None:
    return params[name].list(2)[1] if name in params else None


def _text(params: _Params, name: str) -> str:
    found = _param(params, name)
    return "" if found is None else found.text()


def _flag(params: _Params, name: str) -> bool:
    found = _param(params, name)
    return found is not None and found.flag()


def _groups(params: _Params) -> frozenset[str]:
    said = {kind: _text(params, kind) for kind in ("mutex", _LIFT)}
    return frozenset(f"{kind} {name}" for kind, name in said.items() if name)


def _set_scales(levels: Sequence[_Level], content: Mapping[str, Value]) -> tuple[str, ...]:
    """Turn all points into metres; the names of the levels whose scale is not known."""
    system = content.get("coordinate_system")
    kind = "reference_image" if system is None else system.text()
    if system is None or kind == "reference_image":
        return _set_image_scales(levels, content.get("reference_level_name"))
    if kind not in ("cartesian_meters", "wgs84"):
        remedy = "Those that are read: reference_image, cartesian_meters, wgs84."
        raise system.wrong(f"the coordinate system {echoed(kind)} is not read", remedy)
    for level in levels:
        level.set_scale(*(_degrees(level.used) if kind == "wgs84" else (1.0, -1.0)))
    return ()


def _set_image_scales(levels: Sequence[_Level], named: Value | None) -> tuple[str, ...]:
    """Scale images as Open-RMF does; the levels whose scale is not known.

    The reference level has measurements.  Another one is as large as the fiducials say that both
    have; its own measurements count where there are fewer than two.
    """
    reference, by_name = levels[0], {level.name: level for level in levels}
    if named is not None:
        if (name := named.text()) not in by_name:
            raise named.wrong(f"there is no level {echoed(name)}", "Name one of the levels.")
        reference = by_name[name]
    known, marks = reference.measured(), reference.fiducials()
    unscaled = []
    for level in levels:
        size, scale = _size(level.fiducials(), marks), level.measured()
        if known is not None and size is not None:
            scale = known / size
        if scale is None:
            if level.used:
                unscaled.append(level.name)
            scale = 1.0
        level.set_scale(scale, scale)
    return tuple(unscaled)


def _size(own: Mapping[str, Point], marks: Mapping[str, Point]) -> float | None:
    """How many times as far apart as others fiducials are, None without two of the same names."""
    pairs = combinations([name for name in marks if name in own], 2)
    apart = [(math.dist(own[a], own[b]), math.dist(marks[a], marks[b])) for a, b in pairs]
    if not apart or not all(map(all, apart)):
        return None
    return fmean(here / there for here, there in apart)


def _degrees(vertices: Sequence[_Vertex]) -> tuple[float, float, Point]:
    """Metres for each degree of longitude, and of latitude (up), on WGS 84 there; the origin."""
    points = [vertex.point for vertex in vertices] or [(0.0, 0.0)]
    mean = math.radians(fmean(latitude for _, latitude in points))
    east = 111412.84 * math.cos(mean) - 93.5 * math.cos(3 * mean) + 0.118 * math.cos(5 * mean)
    north = 111132.92 - 559.82 * math.cos(2 * mean) + 1.175 * math.cos(4 * mean)
    return east, -north, (min(x for x, _ in points), max(y for _, y in points))


def _spawning(vertices: Iterable[_Vertex]) -> dict[str, _Vertex]:
    """The robots that start in the building, by their names in PDDL, and where."""
    found: dict[str, _Vertex] = {}
    for vertex in vertices:
        robots = vertex.robots()
        if len(robots) > 1:
            what = f"two robots start at one point: {echoed(robots[0])} and {echoed(robots[1])}"
            raise vertex.value.wrong(what, "Move one of them.")
        for robot in robots:
            require_seen(robot, vertex.value.position, "robot")
            name = pddl_name(robot)
            if not name or name in found:
                remedy = "Give each robot a name of its own, of letters; PDDL has no upper case."
                raise vertex.value.wrong(f"no name for a robot here: {echoed(robot)}", remedy)
            found[name] = vertex
    return found


def _places(vertices: Iterable[_Vertex], taken: set[str]) -> dict[str, Place]:
    """Name places as the file does, or, if that is none or taken, by level and vertex, too."""
    found: dict[str, Place] = {}
    for vertex in vertices:
        number = pddl_name(f"{vertex.level}-{vertex.number}") or f"p-{vertex.number}"
        vertex.name = pddl_name(vertex.said) or number
        while vertex.name in taken:
            vertex.name = f"{vertex.name}-{number}"
        taken.add(vertex.name)
        found[vertex.name] = vertex.place()
    return found


def _rides(places: Mapping[str, Place], lanes: Sequence[Lane]) -> Iterator[Lane]:
    """The rides of lifts: between its cabin's places on two levels, for each graph that has both.

    The places of a cabin are one group, so that one robot is in it.
    """
    graphs, inside = defaultdict[str, set[int]](set), defaultdict[str, list[Place]](list)
    for lane in lanes:
        graphs[lane.start].add(lane.graph)
        graphs[lane.end].add(lane.graph)
    lifts = [(p, g) for p in places.values() for g in sorted(p.groups) if g.startswith(_LIFT)]
    for place, lift in lifts:
        inside[lift].append(place)
    for one, lift in lifts:
        for other in inside[lift]:
            if one.level != other.level:
                for graph in sorted(graphs[one.name] & graphs[other.name]):
                    yield Lane(graph, one.name, other.name, frozenset({lift}))
