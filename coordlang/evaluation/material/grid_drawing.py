"""Robots' ways on a map of cells, drawn."""

from __future__ import annotations

import re
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: Cells are named by row and column, as in ``c1-3``.
_CELL = re.compile(r"[a-z]+(\d+)-(\d+)")
#: A colour for each robot, told apart with every kind of colour vision; and where in a cell its way
#: is drawn.
_ROBOTS = {"r1": ("#0072B2", -0.13), "r2": ("#D55E00", 0.13)}


@dataclass(frozen=True, slots=True)
class Path:
    """The cells of a robot, one for each time from 0."""

    robot: str
    cells: Sequence[str]


def place_of(text: str) -> str | None:
    """The cell that a subaction such as ``(move r1 c0-0 c0-1)`` leads to.

    None if its last argument is none.
    """
    last = text.strip("()").split()[-1]
    return last if _CELL.fullmatch(last) else None


def position(cell: str) -> tuple[int, int]:
    """Row and column."""
    match = _CELL.fullmatch(cell)
    if match is None:
        raise ValueError(f"{cell!r} is no cell such as c1-3")
    return int(match[1]), int(match[2])


def draw_map(
    axes: Axes, cells: Collection[str], paths: Sequence[Path], place: str | None, title: str
) -> None:
    """Cells, robots' ways with the times at each cell, and a place of interest (a star)."""
    from matplotlib.patches import Rectangle

    for cell in sorted(cells):
        row, column = position(cell)
        axes.add_patch(
            Rectangle(
                (column - 0.5, row - 0.5),
                1,
                1,
                facecolor="#f4f4f4",
                edgecolor="#bbbbbb",
                linewidth=0.8,
            )
        )
    if place is not None:
        row, column = position(place)
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
        hue, shift = _ROBOTS[path.robot]
        points = [(column + shift, row + shift) for row, column in map(position, path.cells)]
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
        _times(axes, path, hue, shift)
    axes.set_title(title, fontsize=10, loc="left")
    axes.set_aspect("equal")
    axes.autoscale_view()
    axes.invert_yaxis()
    axes.set_axis_off()


def _times(axes: Axes, path: Path, hue: str, shift: float) -> None:
    """At each cell the times at which the robot is there: ``3``, or ``4-5`` where it waits."""
    told: dict[str, list[str]] = {}
    time = 0
    for cell, stay in groupby(path.cells):
        length = len(list(stay))
        told.setdefault(cell, []).append(
            f"{time}" if length == 1 else f"{time}–{time + length - 1}"
        )
        time += length
    for cell, times in told.items():
        row, column = position(cell)
        last = cell == path.cells[-1]
        y = row + shift if last else row + (-0.34 if shift < 0 else 0.38)
        x = column + shift if last else column + (-0.22 if shift < 0 else 0.22)
        behind = {"facecolor": "white" if last else "#f4f4f4", "edgecolor": "none", "pad": 0.6}
        axes.annotate(
            ", ".join(times),
            (x, y),
            color=hue,
            fontsize=7.5,
            ha="center",
            va="center",
            zorder=7,
            bbox=behind,
        )
