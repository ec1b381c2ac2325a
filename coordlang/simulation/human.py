# SPDX-License-Identifier: GPL-3.0-or-later
"""A human on the floor, who stands in a place or walks from place to place at random."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from random import Random

from coordlang.simulation.floor import Floor
from coordlang.sites.coordinates import Point
from planners.system.errors import UsageError
from planners.system.messages import echoed

#: What stands for a place in ``Settings.human``: a place drawn for each run, or one to walk from.
STANDING_SOMEWHERE, WALKING = "random", "walking"

#: Metres a second, for places one metre apart.
_SPEED = 0.5
#: The share of a cell within which a place is reached.
_REACHED = 0.05


@dataclass(slots=True)
class Human:
    """A human: where in the world, and where to next.

    Attributes
    ----------
    place, before
        The place that the human stands in, or walks to, and the one where the way began.
    walks
        Whether the human walks.
    """

    place: str
    before: str
    walks: bool
    _floor: Floor
    _ways: Mapping[str, Sequence[str]]
    _cell: float
    _random: Random

    @classmethod
    def of(
        cls,
        wanted: str,
        floor: Floor,
        starts: Collection[str],
        goals: Collection[str],
        cell: float,
        random: Random,
    ) -> Human:
        """Put a human on the floor; where no robot starts or ends, unless the place is named.

        Raises
        ------
        UsageError
            If there is no such place, a robot starts there, or none is left.
        """
        places = sorted(set(floor.points) - {*starts, *goals})
        if wanted in (STANDING_SOMEWHERE, WALKING):
            if not places:
                raise UsageError(
                    "there is no place for a human: robots start or end in all of them",
                    remedy="Leave out --human.",
                )
            place = random.choice(places)
        elif wanted in starts:
            raise UsageError(
                f"--human {echoed(wanted)}: a robot starts in this place",
                remedy=f"Say another place, or {STANDING_SOMEWHERE}.",
            )
        elif wanted in floor.points:
            place = wanted
        else:
            raise UsageError(
                f"--human {echoed(wanted)}: there is no such place",
                remedy=f"Say a place such as {min(floor.points)}, or {STANDING_SOMEWHERE}, or "
                f"{WALKING}.",
            )
        ways: dict[str, list[str]] = {name: [] for name in floor.points}
        for one, other in floor.links:
            ways[one].append(other)
            ways[other].append(one)
        return cls(place, place, wanted == WALKING, floor, ways, cell, random)

    def velocity(self, at: Point, robots: Sequence[Point], clearance: float) -> tuple[float, float]:
        """Return how the human walks, in metres a second to the right and up.

        Parameters
        ----------
        at, robots
            Where the human and the robots are.
        clearance
            The human turns back where a robot ahead is nearer, from middle to middle, and stands
            still where that leads to another one.
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
