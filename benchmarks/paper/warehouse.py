# SPDX-License-Identifier: GPL-3.0-or-later
"""Deliveries in a warehouse: which tasks they are, and where a human may stand.

The warehouse is a map with storage in the corners S1, S2 at its left end and dispatch in D1, D2 at
its right end.  Two robots start in random corners.  Robot i fetches at S_i and brings to D_i, or
the other way round.  That is two tasks, one after the other: to where they fetch, then to where
they bring; the second starts when both are done with the first.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import permutations, product

from benchmarks.paper.grid import destinations, placement
from benchmarks.paper.suite import World
from benchmarks.paper.task_choices import Disruption
from coordlang.language.listed import ListedTask
from planners.joint.model import JointModel

#: Warehouses: open maps and rings (border cells only), with their rows and columns.
WAREHOUSES = {
    "open 3x3": (World("open 3x3", "grid", "corners-3x3"), 3, 3),
    "open 4x4": (World("open 4x4", "grid", "corners-4x4"), 4, 4),
    "open 5x5": (World("open 5x5", "grid", "corners-5x5"), 5, 5),
    "ring 3x4": (World("ring 3x4", "grid", "gwb6-3x4"), 3, 4),
    "ring 3x5": (World("ring 3x5", "grid", "gwb7-3x5"), 3, 5),
    "ring 4x4": (World("ring 4x4", "grid", "gwb8-4x4"), 4, 4),
}
#: Where D1 is: opposite S1, so that the deliveries cross, or at the other end of the same side.
LAYOUTS = ("across", "along")
#: Corners as robot 1 and robot 2 stand in them.
Corners = tuple[str, str]


@dataclass(frozen=True, slots=True)
class Delivery:
    """Where the robots start, fetch and bring."""

    start: Corners
    fetch: Corners
    bring: Corners

    @property
    def legs(self) -> tuple[tuple[Corners, Corners], ...]:
        """The tasks, one after the other; only the second if the robots start where they fetch."""
        legs = (self.start, self.fetch), (self.fetch, self.bring)
        return tuple(leg for leg in legs if leg[0] != leg[1])


def deliveries(rows: int, columns: int, layout: str) -> tuple[Delivery, ...]:
    """Return all deliveries: 12 ways to start in two different corners, times 4 directions."""
    left, right = ["c0-0", f"c{rows - 1}-0"], [f"c0-{columns - 1}", f"c{rows - 1}-{columns - 1}"]
    if layout == "across":
        right.reverse()
    lanes = [((s, d), (d, s)) for s, d in zip(left, right, strict=True)]
    found = []
    for start in permutations([*left, *right], 2):
        for one, two in product(*lanes):
            found.append(Delivery(start, (one[0], two[0]), (one[1], two[1])))
    return tuple(found)


def listed_tasks(every: Sequence[Delivery]) -> tuple[ListedTask, ...]:
    """Return the candidate tasks: every leg of every delivery, once."""
    legs = sorted({leg for delivery in every for leg in delivery.legs})
    return tuple(ListedTask(placement(start), placement(goal)) for start, goal in legs)


def human_in(model: JointModel, cell: str) -> Disruption:
    """Return the disruption that no robot can enter a cell, where a human stands."""
    forbidden = [
        frozenset(label for label, to in enumerate(destinations(model, robot)) if to == cell)
        for robot in range(len(model.robots))
    ]
    return Disruption(cell, tuple(forbidden))
