# SPDX-License-Identifier: GPL-3.0-or-later
"""Drawings of robots' paths on a grid map."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import TYPE_CHECKING

from coordlang.evaluation.material.grid import cell_position

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: For each robot a colour, distinguishable with every kind of colour vision, and by how much its
#: path is shifted from the middle of a cell.
_ROBOTS = {"r1": ("#0072B2", -0.13), "r2": ("#D55E00", 0.13)}
_CELL_COLOUR = "#f4f4f4"


@dataclass(frozen=True, slots=True)
class RobotPath:
    """The cells of a robot, one for each time from 0."""

    robot: str
    cells: Sequence[str]


def draw_map(
    axes: Axes, cells: Collection[str], paths: Sequence[RobotPath], star: str | None, title: str
) -> None:
    """Draw cells, robots' paths with the times at each cell, and a star in one cell."""
    for cell in sorted(cells):
        _draw_cell(axes, cell)
    if star is not None:
        row, column = cell_position(star)
        axes.plot(
            column + 0.33,
            row - 0.3,
            marker="*",
            markersize=15,
            color="#E69F00",
            markeredgecolor="#7a5200",
            zorder=5,
        )
    for path in paths:
        _draw_path(axes, path)
        _draw_times(axes, path)
    axes.set_title(title, fontsize=10, loc="left")
    axes.set_aspect("equal")
    axes.autoscale_view()
    axes.invert_yaxis()
    axes.set_axis_off()


def _draw_cell(axes: Axes, cell: str) -> None:
    from matplotlib.patches import Rectangle

    row, column = cell_position(cell)
    square = Rectangle(
        (column - 0.5, row - 0.5),
        1,
        1,
        facecolor=_CELL_COLOUR,
        edgecolor="#bbbbbb",
        linewidth=0.8,
    )
    axes.add_patch(square)


def _draw_path(axes: Axes, path: RobotPath) -> None:
    """Draw a line from a filled circle with the robot's name to a hollow one."""
    hue, shift = _ROBOTS[path.robot]
    points = [(column + shift, row + shift) for row, column in map(cell_position, path.cells)]
    x, y = [p[0] for p in points], [p[1] for p in points]
    axes.plot(x, y, color=hue, linewidth=2, zorder=3)
    axes.plot(x[:1], y[:1], marker="o", markersize=13, color=hue, linestyle="none", zorder=4)
    axes.annotate(
        path.robot,
        (x[0], y[0]),
        color="white",
        fontsize=7.5,
        ha="center",
        va="center",
        zorder=6,
    )
    axes.plot(
        x[-1:],
        y[-1:],
        marker="o",
        markersize=13,
        color="white",
        markeredgecolor=hue,
        markeredgewidth=2,
        linestyle="none",
        zorder=4,
    )


def _draw_times(axes: Axes, path: RobotPath) -> None:
    """Write the times at which the robot is at each cell: ``3``, or ``4-5`` where it waits."""
    hue, shift = _ROBOTS[path.robot]
    for cell, times in _times(path.cells).items():
        row, column = cell_position(cell)
        if cell == path.cells[-1]:
            x, y, behind = column + shift, row + shift, "white"
        elif shift < 0:
            x, y, behind = column - 0.22, row - 0.34, _CELL_COLOUR
        else:
            x, y, behind = column + 0.22, row + 0.38, _CELL_COLOUR
        axes.annotate(
            ", ".join(times),
            (x, y),
            color=hue,
            fontsize=7.5,
            ha="center",
            va="center",
            zorder=7,
            bbox={"facecolor": behind, "edgecolor": "none", "pad": 0.6},
        )


def _times(cells: Sequence[str]) -> dict[str, list[str]]:
    """The times at which a robot is at each of its cells."""
    found: dict[str, list[str]] = {}
    time = 0
    for cell, stay in groupby(cells):
        last = time + len(list(stay)) - 1
        found.setdefault(cell, []).append(f"{time}" if last == time else f"{time}–{last}")
        time = last + 1
    return found
