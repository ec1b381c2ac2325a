# SPDX-License-Identifier: GPL-3.0-or-later
"""A plan of a task in the form that PlanViz, the viewer of multi-agent path finding, shows.

PlanViz (MAPF-Competition/PlanViz) reads a map in movingai format and a JSON file with each agent's
start and moves, in the form of the League of Robot Runners with the action model ``MAPF``.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise

from coordlang.execution.task_language import TaskLanguage
from coordlang.report.layout import place_layout
from coordlang.sites.coordinates import Point
from coordlang.sites.world import World, find_world
from planners.search.plans import Plans
from planners.system.errors import UsageError

#: A cell: row and column, from 0.
Cell = tuple[int, int]

#: (rows, columns) that a robot moves in one step -> the letter for it.  Rows grow downwards, and in
#: this format U adds a row and D takes one away.
_MOVES = {(0, 0): "W", (0, 1): "R", (0, -1): "L", (1, 0): "U", (-1, 0): "D"}


@dataclass(frozen=True, slots=True)
class PlanVizFiles:
    """The text of a plan in JSON, and that of the map on which it is shown."""

    plan: str
    map: str


def planviz(task_language: TaskLanguage, known: Mapping[str, Point] | None = None) -> PlanVizFiles:
    """Write the first optimal plan of a task for PlanViz; ``known`` are coordinates from a file.

    Raises `UsageError` if the robots are not always in cells of a grid, or move to others than the
    neighbours.
    """
    space = task_language.space
    plans = Plans.of(space, task_language.task)
    codec = space.model.codec
    states = [codec.decode(space.rows[state]) for state in plans.states(plans.unrank(0))]
    world = find_world(space.model, states)
    cells = _cells(world, known)
    robots = space.model.robots
    paths = [
        [cell for state in states if (cell := cells.get(world.located(state).get(robot, "")))]
        for robot in robots
    ]
    letters = [
        [_MOVES.get((row - r, column - c), "") for (r, c), (row, column) in pairwise(path)]
        for path in paths
    ]
    lost = any(
        len(path) < len(states) or not all(own) for path, own in zip(paths, letters, strict=True)
    )
    if not cells or lost:
        raise UsageError(
            "--planviz: the robots do not move from cell to cell of a grid",
            remedy="Leave it out, or give --coordinates whole numbers as [column, row].",
        )
    moves = [",".join(own or ["W"]) for own in letters]
    steps = len(states) - 1
    data = {
        "actionModel": "MAPF",
        "AllValid": "Yes",
        "teamSize": len(robots),
        "start": [[*path[0], "N/A"] for path in paths],
        "numTaskFinished": len(robots),
        "sumOfCost": steps * len(robots),
        "makespan": steps,
        "actualPaths": moves,
        "plannerPaths": moves,
        "plannerTimes": [],
        "errors": [],
        "events": [
            [[robot, 0, "assigned"], [robot, steps, "finished"]] for robot in range(len(robots))
        ],
        "tasks": [[robot, *path[-1]] for robot, path in enumerate(paths)],
    }
    passable = set(cells.values())
    height, width = (max(cell[k] for cell in passable) + 1 for k in (0, 1))
    rows = [
        "".join("." if (row, column) in passable else "@" for column in range(width))
        for row in range(height)
    ]
    lines = ["type octile", f"height {height}", f"width {width}", "map", *rows]
    return PlanVizFiles(json.dumps(data) + "\n", "\n".join(lines) + "\n")


def _cells(world: World, known: Mapping[str, Point] | None) -> dict[str, Cell]:
    """The row and column of each place, the least ones being 0; none if it is no grid."""
    if not world.places:
        return {}
    layout = place_layout(world.places, [link.ends for link in world.links], known)
    if not layout.is_grid:
        return {}
    left = min(x for x, _ in layout.points.values())
    top = min(y for _, y in layout.points.values())
    return {place: (int(y - top), int(x - left)) for place, (x, y) in layout.points.items()}
