# SPDX-License-Identifier: GPL-3.0-or-later
"""The simulator: discs with two driven wheels between walls, by ir-sim, without a window.

ir-sim moves the robots, with noise on what their wheels are told, says which of them touch
something, and casts the rays of their lidars.  Robots that touch something stand still for the rest
of the run.
"""

from __future__ import annotations

import json
import math
import tempfile
from collections.abc import Mapping
from contextlib import redirect_stdout
from dataclasses import dataclass
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np

from coordlang.simulation.floor import Floor, outlines
from coordlang.simulation.robot import SPEED, TICK, TURN, Pose, Velocity
from planners.system.errors import UsageError
from planners.system.signals import postponed_signals

#: The name of walls: with a space, as no robot is called.
WALL = "the wall"
#: Beams of a lidar, and the angle that they cover, in radians.
_BEAMS, _ANGLE = 61, 2 * math.pi
#: What a lidar sees beside its robot's way within this many metres counts as in its way.
BESIDE = 0.02
#: Noise of the position that a robot believes in, in metres for each unit of ``Settings.noise``.
POSITION_NOISE = 0.1


@dataclass(frozen=True, slots=True)
class Settings:
    """How robots are built and keep step.

    ``radius`` is a robot's, in metres, as coordinates of places are.
    ``step`` is the way of a `coordlang.simulation.robot.Pace`.  ``noise`` is the standard deviation
    of what wheels do, as a share of what they are told, drawn anew in each tick; a tenth of it, in
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
