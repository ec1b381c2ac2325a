# SPDX-License-Identifier: GPL-3.0-or-later
"""Drawings of robots' paths on a grid map."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from itertools import groupby
from typing import TYPE_CHECKING, Any

from benchmarks.paper.grid import cell_position

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: For each robot a colour, distinguishable with every kind of colour vision, and by how much its
#: path is shifted from the middle of a cell.
_ROBOTS = {"r1": ("#0072B2", -0.13), "r2": ("#D55E00", 0.13)}


def draw_map(
    axes: Axes,
    cells: Collection[str],
    paths: Mapping[str, Sequence[str]],
    star: str | None,
    title: str,
) -> None:
    """Draw cells, each robot's path (a cell for each time from 0), and a star in one cell."""
    from matplotlib.patches import Rectangle

    for row, column in map(cell_position, sorted(cells)):
        corner = (column - 0.5, row - 0.5)
        axes.add_patch(Rectangle(corner, 1, 1, facecolor="#f4f4f4", edgecolor="#bbbbbb"))
    if star is not None:
        row, column = cell_position(star)
        axes.plot(column + 0.33, row - 0.3, "*", markersize=15, color="#E69F00", zorder=5)
    for robot, path in paths.items():
        _draw_path(axes, robot, path)
    axes.set_title(title, fontsize=10, loc="left")
    axes.set_aspect("equal")
    axes.autoscale_view()
    axes.invert_yaxis()
    axes.set_axis_off()


def _draw_path(axes: Axes, robot: str, path: Sequence[str]) -> None:
    """Draw a line from the robot's name to a hollow circle, with the times at each cell."""
    hue, shift = _ROBOTS[robot]
    points = [(column + shift, row + shift) for row, column in map(cell_position, path)]
    axes.plot(*zip(*points, strict=True), color=hue, linewidth=2, zorder=3)
    style: Any = {"fontsize": 7.5, "ha": "center", "va": "center", "zorder": 7}
    round_ = {"boxstyle": "circle", "edgecolor": hue}
    axes.annotate(robot, points[0], color="white", bbox={**round_, "facecolor": hue}, **style)
    for cell, times in _times(path).items():
        row, column = cell_position(cell)
        at, box = (column + 1.7 * shift, row + 2.8 * shift), {"facecolor": "#f4f4f4", "pad": 0.6}
        if cell == path[-1]:
            at, box = points[-1], {**round_, "facecolor": "white"}
        axes.annotate(", ".join(times), at, color=hue, bbox={"edgecolor": "none", **box}, **style)


def _times(path: Sequence[str]) -> dict[str, list[str]]:
    """The times at which a robot is at each of its cells: ``3``, or ``4–5`` where it waits."""
    found: dict[str, list[str]] = {}
    time = 0
    for cell, stay in groupby(path):
        last = time + len(list(stay)) - 1
        found.setdefault(cell, []).append(f"{time}" if last == time else f"{time}–{last}")
        time = last + 1
    return found
