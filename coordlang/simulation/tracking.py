# SPDX-License-Identifier: GPL-3.0-or-later
"""Tracking: from where a robot with two driven wheels believes to be, how fast its wheels turn.

Standard library only: a robot carries it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

#: Metres x, metres y, heading in radians (0: to the right, counterclockwise).
Pose = tuple[float, float, float]
#: Metres a second ahead, radians a second to the left.
Velocity = tuple[float, float]

STANDING: Velocity = (0.0, 0.0)

#: Gains in 1/s: velocity per metre or radian that is left.
_GAIN = 4.0
#: Headings are right within this, in radians, and places are reached within this share of the cell.
ALIGNED = 0.06
ARRIVED = 0.05
#: What turning and driving take longer than at full speed, in seconds: slowing down, and noise.
_SLACK = 0.8


@dataclass(frozen=True, slots=True)
class Drive:
    """A differential drive: its greatest speed (m/s) and rate of turning (rad/s)."""

    speed: float
    turn: float

    @property
    def turning(self) -> float:
        """Seconds in which every turn on the spot is done: half a turn, and some slack."""
        return math.pi / self.turn + _SLACK

    def driving(self, metres: float) -> float:
        """Seconds in which a way of this length is driven, with some slack."""
        return metres / self.speed + _SLACK

    def period(self, metres: float) -> float:
        """Seconds for a joint step whose longest way has this length: turn, then drive."""
        return self.turning + self.driving(metres)


def distance(pose: Pose, target: tuple[float, float]) -> float:
    """Metres to a point."""
    return math.hypot(target[0] - pose[0], target[1] - pose[1])


def bearing(pose: Pose, target: tuple[float, float]) -> float:
    """Radians to turn, from -pi to pi, until a point is straight ahead."""
    angle = math.atan2(target[1] - pose[1], target[0] - pose[0]) - pose[2]
    return math.remainder(angle, 2 * math.pi)


def turned(pose: Pose, target: tuple[float, float], drive: Drive) -> Velocity:
    """Turn on the spot towards a point."""
    return 0.0, _bounded(_GAIN * bearing(pose, target), drive.turn)


def driven(pose: Pose, target: tuple[float, float], drive: Drive) -> Velocity:
    """Drive towards a point, steering; slower where it is near or not straight ahead."""
    angle = bearing(pose, target)
    ahead = _GAIN * distance(pose, target) * max(0.0, math.cos(angle))
    return _bounded(ahead, drive.speed), _bounded(_GAIN * angle, drive.turn)


def _bounded(value: float, most: float) -> float:
    return max(-most, min(most, value))
