# SPDX-License-Identifier: GPL-3.0-or-later
"""A map with robots as a self-contained SVG picture.

Nothing is told by colour alone: robots and goals carry their names, goals are dashed rings.
"""

from __future__ import annotations

from collections.abc import Iterator
from xml.sax.saxutils import escape

from gridmap import Cell, GridMap

#: Okabe and Ito's palette: told apart with any kind of colour vision, and in grey.
COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9")
FLOOR, LINE, WALL, BLOCK, FAINT = "#ffffff", "#b8b8b8", "#1a1a1a", "#5f6670", "#6b6b6b"
CELL, MARGIN = 72, 12


def draw(grid: GridMap, title: str, starts: dict[str, str], goals: dict[str, str]) -> str:
    """The picture of a map with each robot's start (a disc) and goal (a dashed ring); both map
    robot -> cell.
    """
    rows, columns = grid.size
    width, height = columns * CELL + 2 * MARGIN, rows * CELL + 2 * MARGIN
    colour = {robot: COLOURS[number % len(COLOURS)] for number, robot in enumerate(starts)}
    told = "; ".join(
        f"{robot} starts in {starts[robot]} and goes to {goals[robot]}" for robot in starts
    )
    shapes = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" width="{width}" '
        f'height="{height}" '
        'role="img" font-family="Helvetica, Arial, sans-serif" text-anchor="middle">',
        f"<title>{escape(title)}</title>",
        f"<desc>{escape(told)}.</desc>",
        f'<rect width="{width}" height="{height}" rx="6" fill="{BLOCK}"/>',
        *_passages(grid),
        *(_floor(name, cell) for name, cell in grid.cells.items()),
        *_walls(grid),
        *(_goal(robot, grid.cells[cell], colour[robot]) for robot, cell in goals.items()),
        *(_robot(robot, grid.cells[cell], colour[robot]) for robot, cell in starts.items()),
        "</svg>",
    ]
    return "\n".join(shapes) + "\n"


def _corner(cell: Cell) -> tuple[int, int]:
    row, column = cell
    return MARGIN + column * CELL, MARGIN + row * CELL


def _centre(cell: Cell) -> tuple[int, int]:
    x, y = _corner(cell)
    return x + CELL // 2, y + CELL // 2


def _touch(grid: GridMap, a: str, b: str) -> bool:
    return grid.distance(a, b) == 1


def _floor(name: str, cell: Cell) -> str:
    x, y = _corner(cell)
    return (
        f'<rect x="{x}" y="{y}" width="{CELL}" height="{CELL}" fill="{FLOOR}" stroke="{LINE}"/>'
        f'<text x="{x + 4}" y="{y + 12}" font-size="10" text-anchor="start" '
        f'fill="{FAINT}">{escape(name)}</text>'
    )


def _walls(grid: GridMap) -> Iterator[str]:
    """A thick line between cells that touch and are not adjacent."""
    edges = set(grid.edges)
    names = list(grid.cells)
    for number, a in enumerate(names):
        for b in names[number + 1 :]:
            if not _touch(grid, a, b) or (a, b) in edges:
                continue
            x, y = _corner(grid.cells[b])
            across = grid.cells[a][0] == grid.cells[b][0]
            end = (x, y + CELL) if across else (x + CELL, y)
            yield _line((x, y), end, WALL, 6)


def _passages(grid: GridMap) -> Iterator[str]:
    """A corridor between adjacent cells that do not touch."""
    for a, b in grid.edges:
        if not _touch(grid, a, b):
            yield _line(_centre(grid.cells[a]), _centre(grid.cells[b]), FLOOR, 22)


def _line(a: tuple[int, int], b: tuple[int, int], colour: str, thickness: int) -> str:
    return (
        f'<line x1="{a[0]}" y1="{a[1]}" x2="{b[0]}" y2="{b[1]}" '
        f'stroke="{colour}" stroke-width="{thickness}" stroke-linecap="round"/>'
    )


def _goal(robot: str, cell: Cell, colour: str) -> str:
    x, y = _centre(cell)
    return (
        f'<circle cx="{x}" cy="{y}" r="20" fill="none" stroke="{colour}" stroke-width="3" '
        'stroke-dasharray="6 4"/>'
        f'<text x="{x + CELL // 2 - 4}" y="{y + CELL // 2 - 4}" font-size="11" font-weight="bold" '
        'text-anchor="end" '
        f'fill="{colour}">{escape(robot)} goal</text>'
    )


def _robot(robot: str, cell: Cell, colour: str) -> str:
    x, y = _centre(cell)
    return (
        f'<circle cx="{x}" cy="{y}" r="15" fill="{colour}"/>'
        f'<text x="{x}" y="{y + 5}" font-size="13" font-weight="bold" '
        f'fill="#ffffff">{escape(robot)}</text>'
    )
