# SPDX-License-Identifier: GPL-3.0-or-later
"""The simulator: discs with two driven wheels on a floor with walls, by ir-sim, without a window.

On the floor x is to the right, y up; the place drawn lowest and furthest left has the coordinates
0.  Where places are the cells of a grid, there is a wall along every side of a cell that no link
crosses.  Elsewhere there are no walls.

ir-sim moves the robots, with noise on what their wheels are told, says which of them touch
something, and casts the rays of their lidars.  Robots that touch something stand still for the rest
of the run.
"""

from __future__ import annotations

import json
import math
import tempfile
from collections import defaultdict
from collections.abc import Mapping, Sequence
from contextlib import redirect_stdout
from dataclasses import dataclass
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np

from coordlang.simulation.robot import SPEED, TICK, TURN, Pose, Velocity
from coordlang.sites.coordinates import Point, from_names
from coordlang.sites.world import World
from planners.system.errors import BadInput, UsageError
from planners.system.signals import postponed_signals

#: A wall: (x, y) of one end, (x, y) of the other, in metres.
Wall = tuple[float, float, float, float]

#: The greatest radius of a robot, as a share of the shortest link.  On grids robots that move at
#: once come as near as 0.707 of a link to each other: one leaves a place at a right angle to the
#: one that comes, which has its flank before it meanwhile, and must neither touch it nor stop.
MOST_RADIUS = 0.25
#: The name of walls: with a space, as no robot is called.
WALL = "the wall"
#: Beams of a lidar, and the angle that they cover, in radians.
_BEAMS, _ANGLE = 61, 2 * math.pi
#: What a lidar sees beside its robot's way within this many metres counts as in its way.
BESIDE = 0.02
#: Noise of the position that a robot believes in, in metres for each unit of ``Settings.noise``.
POSITION_NOISE = 0.1


# ---- the floor


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

    def require_room(self, radius: float) -> None:
        """Raise `UsageError` if robots of this radius, in metres, are too large."""
        most = MOST_RADIUS * self.shortest
        if radius > most:
            raise UsageError(
                f"robots with a radius of {radius:g} m are too large for places {self.shortest:g} "
                "m apart: they touch where one leaves a place at a right angle to the one that "
                "comes",
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


# ---- robots on it


@dataclass(frozen=True, slots=True)
class Settings:
    """How robots are built and keep step.

    ``radius`` is a robot's, in metres, as coordinates of places are.
    ``step`` is a way of `coordlang.simulation.robot.Robot`.  ``noise`` is the standard deviation of
    what wheels do, as a share of what they are told, drawn anew in each tick; a tenth of it, in
    metres and in radians, is that of where a robot believes to be.  ``lidar``: robots stop before
    what a lidar sees straight ahead.
    """

    radius: float = 0.2
    step: str = "clock"
    noise: float = 0.1
    lidar: bool = True

    def __post_init__(self) -> None:
        """Raise `UsageError` for what no robot can be built with."""
        if self.radius < SPEED * TICK:
            raise UsageError(
                f"robots with a radius of {self.radius:g} m are too small: in a tick they drive "
                f"{SPEED * TICK:g} m, so that two could pass through each other unseen",
                remedy="Write coordinates with places further apart, in metres.",
            )
        if not 0 <= self.noise <= 1:
            raise UsageError(
                f"--noise {self.noise:g}: expected a share from 0 to 1",
                remedy="Say 0 for wheels that do what they are told.",
            )


def require_simulator() -> Any:
    """The class of ir-sim's worlds; raises `UsageError` if ir-sim is not installed."""
    import matplotlib

    backend = matplotlib.get_backend()
    try:
        with redirect_stdout(StringIO()):  # it says there which windows it cannot open
            from irsim.env.env_base import EnvBase
    except ImportError:
        raise UsageError(
            "simulating needs the package ir-sim, which is not installed",
            remedy="Install it: pip install 'coordlang[sim]'.",
        ) from None
    matplotlib.use(backend)  # importing it chooses another one
    return EnvBase


class Simulator:
    """A world with robots, which time passes in tick by tick.

    ``poses`` are those at the start, ``seed`` is that of the noise on the wheels.
    """

    def __init__(
        self, floor: Floor, poses: Mapping[str, Pose], settings: Settings, seed: int
    ) -> None:
        self._settings = settings
        self._environment = _environment(_world(floor, poses, settings), seed)
        self._robots = {robot.name: robot for robot in self._environment.robot_list}
        for robot in self._robots.values():
            robot.sensors = []  # lidars are asked for, not cast in every tick

    def tick(self, velocities: Mapping[str, Velocity]) -> None:
        """Let a tick pass in which the wheels are told these velocities."""
        self._environment.step({name: list(velocity) for name, velocity in velocities.items()})

    def pose(self, robot: str) -> Pose:
        """Where a robot is, exactly."""
        x, y, heading = self._robots[robot].state[:3, 0].tolist()
        return x, y, heading

    def ahead(self, robot: str) -> float:
        """How far ahead of a robot's middle its lidar sees something in its way."""
        own = self._robots[robot]
        own.lidar.step(own.state[0:3])
        scan = own.lidar.get_scan()
        hits = np.asarray(scan["valid"], np.bool_)
        length, angle = scan["ranges"][hits], own.lidar.angle_list[hits]
        ahead, beside = length * np.cos(angle), np.abs(length * np.sin(angle))
        in_way = (beside < self._settings.radius + BESIDE) & (ahead > 0)
        return float(ahead[in_way].min(initial=math.inf))

    def touching(self) -> set[tuple[str, str]]:
        """The pairs that touch, in order: robots by name, and ``the wall``."""
        found = set()
        for name, robot in self._robots.items():
            for other in robot.collision_obj:
                what = WALL if other.name.startswith(WALL) else other.name
                found.add((min(name, what), max(name, what)))
        return found


def _environment(world: dict[str, Any], seed: int) -> Any:
    """ir-sim's world; it reads one from a file only."""
    simulator = require_simulator()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "world.yaml")
        path.write_text(json.dumps(world))  # which is YAML, too
        with postponed_signals():  # it would print a limit's error as one of its own
            environment = simulator(str(path), headless=True, log_level="CRITICAL", seed=seed)
            # It logs nothing from here on.  Left to the garbage collector, that may come while the
            # next world begins to log, and both wait for the other's lock for ever.
            environment.logger.close()
    return environment


def _world(floor: Floor, poses: Mapping[str, Pose], settings: Settings) -> dict[str, Any]:
    spread = settings.noise**2
    lidar = {"type": "lidar2d", "range_max": 2, "angle_range": _ANGLE, "number": _BEAMS}
    robots = [
        {
            "name": name,
            "kinematics": {
                "name": "diff",
                "noise": settings.noise > 0,
                "alpha": [spread, 0, spread, spread],
            },
            "shape": {"name": "circle", "radius": settings.radius},
            "state": list(pose),
            "vel_max": [SPEED, TURN],
            "vel_min": [-SPEED, -TURN],
            "sensors": [lidar],
        }
        for name, pose in poses.items()
    ]
    walls = [
        {
            "name": f"{WALL} {number}",
            "shape": {"name": "linestring", "vertices": [list(point) for point in outline]},
            "state": [0, 0, 0],
        }
        for number, outline in enumerate(outlines(floor.walls))
    ]
    world = {"step_time": TICK, "collision_mode": "stop"}
    return {"world": world, "robot": robots, "obstacle": walls}
