# SPDX-License-Identifier: GPL-3.0-or-later
"""Maps: cells and which of them are adjacent, made by size or read from a movingai file."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

from planners.errors import BadInput, Position

#: The characters of a movingai map: ground, ground, swamp | out of bounds, out of bounds, trees,
#: water.
PASSABLE = ".GS"
BLOCKED = "@OTW"

Cell = tuple[int, int]


@dataclass(frozen=True, slots=True)
class GridMap:
    """Cells with their (row, column), in the order in which they are listed, and pairs of adjacent
    cells.

    ``edges`` holds every pair once, the earlier cell first.  Cells that touch need not be adjacent:
    a wall is then between them.
    """

    cells: dict[str, Cell]
    edges: tuple[tuple[str, str], ...]

    @property
    def size(self) -> tuple[int, int]:
        """Rows and columns."""
        return 1 + max(row for row, _ in self.cells.values()), 1 + max(
            col for _, col in self.cells.values()
        )

    def neighbours(self, cell: str) -> list[str]:
        """The adjacent cells, in the order of the map."""
        near = {b for a, b in self.edges if a == cell} | {a for a, b in self.edges if b == cell}
        return [other for other in self.cells if other in near]

    def distance(self, a: str, b: str) -> int:
        """Manhattan distance, whatever stands between the cells."""
        (row, col), (other_row, other_col) = self.cells[a], self.cells[b]
        return abs(row - other_row) + abs(col - other_col)


def cell_name(cell: Cell) -> str:
    """``c0-2``: the cell in the top row, third from the left."""
    return "c{}-{}".format(*cell)


def open_grid(rows: int, columns: int) -> GridMap:
    """A full rectangle: every cell is adjacent to the up to four cells around it."""
    return _of({(row, col) for row in range(rows) for col in range(columns)})


def ring(rows: int, columns: int) -> GridMap:
    """The border cells of a rectangle, each adjacent to the next one along the border only.

    In a ring of two rows the cells above each other touch, and only those at the ends are adjacent.
    """
    if min(rows, columns) < 2:
        raise ValueError(f"a ring needs at least two rows and two columns, not {rows}x{columns}")
    tour = _clockwise(rows, columns)
    edges = {(min(a, b), max(a, b)) for a, b in pairwise([*tour, tour[0]])}
    return _of(set(tour), edges)


def three_cells() -> GridMap:
    """Three cells, every two of them adjacent (drawn as a triangle)."""
    cells = {"a": (0, 1), "b": (2, 0), "c": (2, 2)}
    return GridMap(cells, (("a", "b"), ("a", "c"), ("b", "c")))


def read_map(path: Path) -> GridMap:
    """A map in the format of movingai.com, with or without its ``type`` line; raises `BadInput`
    with the line.
    """
    try:
        lines = path.read_text(encoding="ascii").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise BadInput(f"cannot read this map ({error})", position=Position(str(path))) from error
    rows, first = _map_rows(path, lines)
    passable = set()
    for row, text in enumerate(rows):
        for col, character in enumerate(text):
            if character in PASSABLE:
                passable.add((row, col))
            elif character not in BLOCKED:
                raise BadInput(
                    f"unknown character {character!r} in the map",
                    position=Position(str(path), first + row, col + 1),
                    remedy=f"Passable: {' '.join(PASSABLE)}; blocked: {' '.join(BLOCKED)}.",
                )
    if not passable:
        raise BadInput("this map has no passable cell", position=Position(str(path)))
    return _of(passable)


def _map_rows(path: Path, lines: list[str]) -> tuple[list[str], int]:
    """The rows of the map, checked against its header, and the number of the first one's line."""
    sizes: dict[str, int] = {}
    for number, line in enumerate(lines, start=1):
        words = line.split()
        match words:
            case [] | ["type", _]:
                continue
            case ["height" | "width" as key, value] if (
                value.isdigit() and int(value) > 0 and key not in sizes
            ):
                sizes[key] = int(value)
            case ["map"] if len(sizes) == 2:
                return _checked_rows(
                    path, lines, number, sizes["height"], sizes["width"]
                ), number + 1
            case _:
                raise BadInput(
                    f"unexpected {line!r} in the header of a map",
                    position=Position(str(path), number, 1),
                    remedy="Expected 'height N' and 'width N' (once each, N from 1), then 'map'.",
                )
    raise BadInput(
        "this file has no line 'map'", position=Position(str(path), max(1, len(lines)), 1)
    )


def _checked_rows(path: Path, lines: list[str], header: int, height: int, width: int) -> list[str]:
    rows = [line.rstrip() for line in lines[header:]]
    while len(rows) > height and not rows[-1]:
        rows.pop()
    for number, row in enumerate(rows[:height], start=header + 1):
        if len(row) != width:
            raise BadInput(
                f"this row has {len(row)} cells where the header says {width}",
                position=Position(str(path), number, 1),
            )
    if len(rows) != height:
        position = Position(str(path), header + 1 + min(len(rows), height), 1)
        raise BadInput(
            f"the map has {len(rows)} rows where the header says {height}", position=position
        )
    return rows


def _clockwise(rows: int, columns: int) -> list[Cell]:
    """The border of a rectangle, once around from the top left cell."""
    top = [(0, col) for col in range(columns)]
    right = [(row, columns - 1) for row in range(1, rows)]
    bottom = [(rows - 1, col) for col in reversed(range(columns - 1))]
    left = [(row, 0) for row in reversed(range(1, rows - 1))]
    return [*top, *right, *bottom, *left]


def _of(passable: set[Cell], edges: set[tuple[Cell, Cell]] | None = None) -> GridMap:
    """The map of these cells in row-major order; without ``edges`` all cells that touch are
    adjacent.
    """
    if edges is None:
        steps = [
            ((row, col), near) for row, col in passable for near in ((row, col + 1), (row + 1, col))
        ]
        edges = {(a, b) for a, b in steps if b in passable}
    return GridMap(
        {cell_name(cell): cell for cell in sorted(passable)},
        tuple((cell_name(a), cell_name(b)) for a, b in sorted(edges)),
    )
