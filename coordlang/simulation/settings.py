# SPDX-License-Identifier: GPL-3.0-or-later
"""What a run is made with: sizes, speeds, noise, and the way to keep step."""

from __future__ import annotations

import math
from dataclasses import dataclass

from coordlang.simulation.pace import PACES
from coordlang.simulation.tracking import Drive
from planners.system.errors import UsageError

#: Noise of the position that a robot believes in, in metres for each unit of ``Settings.noise``.
POSITION_NOISE = 0.1


@dataclass(frozen=True, slots=True)
class Settings:
    """How robots are built and keep step.

    Attributes
    ----------
    step
        The way to keep step: ``clock``, ``barrier`` or ``word``.
    cell
        Metres for one unit of the coordinates of places.
    radius
        The radius of a robot, in metres.
    speed, turn
        Its greatest speed (m/s) and rate of turning (rad/s).
    noise
        The standard deviation of what wheels do, as a share of what they are told, drawn anew in
        each tick; a tenth of it, in metres and in radians, is that of where a robot believes to be.
    lidar
        Whether robots stop before what a lidar sees straight ahead.
    human
        The place of a human that nobody but a lidar knows of, ``random`` for a place drawn for each
        run, ``walking`` for one who walks about; None for nobody.
    tick
        Seconds between two looks at sensors and commands to wheels.
    """

    step: str = "clock"
    cell: float = 1.0
    radius: float = 0.2
    speed: float = 1.0
    turn: float = 3.0
    noise: float = 0.1
    lidar: bool = True
    human: str | None = None
    tick: float = 0.1

    def __post_init__(self) -> None:
        """Raise `UsageError` for what no robot can be built with."""
        if self.step not in PACES:
            raise UsageError(
                f"--step {self.step}: there is no such way to keep step",
                remedy=f"Say {', '.join(PACES[:-1])} or {PACES[-1]}.",
            )
        for name in ("cell", "radius", "speed", "turn", "tick"):
            value = getattr(self, name)
            if not 0 < value < math.inf:
                raise UsageError(
                    f"{name} {value:g}: expected a length, speed or time above 0",
                    remedy="Leave it out for the usual value.",
                )
        if self.radius < self.speed * self.tick:
            raise UsageError(
                f"robots with a radius of {self.radius:g} m are too small: in a tick they drive "
                f"{self.speed * self.tick:g} m, so that two could pass through each other unseen",
                remedy="Use a larger --radius, and a larger --cell where it does not fit.",
            )
        if not 0 <= self.noise <= 1:
            raise UsageError(
                f"--noise {self.noise:g}: expected a share from 0 to 1",
                remedy="Say 0 for wheels that do what they are told.",
            )

        if self.human is not None and not self.lidar:
            raise UsageError(
                "--human: without a lidar no robot sees a human", remedy="Leave out --no-lidar."
            )

    @property
    def drive(self) -> Drive:
        """The robots' wheels."""
        return Drive(self.speed, self.turn)

    @property
    def clearance(self) -> float:
        """How near to its middle a robot lets come what is straight ahead, in metres."""
        return self.radius + 0.03 * self.cell

    @property
    def reaction(self) -> float:
        """Seconds in which a robot would come as near as that to what is ahead.

        Three ticks: two robots that come head on take at most two thirds of what is between them
        in a tick, and so never touch.
        """
        return 3 * self.tick

    def period(self, longest: float) -> float:
        """Seconds that a joint step takes whose longest way has this length: whole ticks."""
        return round(math.ceil(self.drive.period(longest) / self.tick) * self.tick, 6)
