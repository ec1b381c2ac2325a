# SPDX-License-Identifier: GPL-3.0-or-later
"""Maps: cells and which of them are adjacent, made by size or read from a movingai file."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from random import Random

from coordlang.sites import movingai
from coordlang.sites.movingai import cell_name

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


def open_grid(rows: int, columns: int) -> GridMap:
    """A full rectangle: every cell is adjacent to the up to four cells around it."""
    return of_cells({(row, col) for row in range(rows) for col in range(columns)})


def ring(rows: int, columns: int) -> GridMap:
    """The border cells of a rectangle, each adjacent to the next one along the border only.

    In a ring of two rows the cells above each other touch, and only those at the ends are adjacent.
    """
    if min(rows, columns) < 2:
        raise ValueError(f"a ring needs at least two rows and two columns, not {rows}x{columns}")
    tour = _clockwise(rows, columns)
    edges = {(min(a, b), max(a, b)) for a, b in pairwise([*tour, tour[0]])}
    return of_cells(set(tour), edges)


def path(length: int, bays: Sequence[int]) -> GridMap:
    """Cells in a row, with a bay below those in the columns ``bays``."""
    return of_cells({(0, col) for col in range(length)} | {(1, col) for col in bays})


def two_rooms(rows: int, columns: int, corridor: int) -> GridMap:
    """Two rooms of equal size, joined by a corridor of so many cells along their first rows."""
    cells = {(row, col) for row in range(rows) for col in range(columns)}
    cells |= {(0, columns + k) for k in range(corridor)}
    return of_cells(
        cells | {(row, col + columns + corridor) for row, col in cells if col < columns}
    )


def rooms_and_corridors(random: Random, most: int = 12) -> GridMap:
    """Two or three rooms of up to 2x3 cells in a row, joined by corridors of one or two cells.

    Each room stands up or down by at most a cell.  At most ``most`` cells; maps that would have
    more are drawn again.
    """
    while True:
        cells: set[Cell] = set()
        column = 0
        for number in range(random.choice((2, 2, 3))):
            if number:
                length = random.randint(1, 2)
                cells |= {(1, column + k) for k in range(length)}
                column += length
            top, width = random.randint(0, 1), random.randint(1, 3)
            rows = range(top, top + 2) if random.random() < 0.7 else (1,)
            cells |= {(row, column + k) for row in rows for k in range(width)}
            column += width
        if 5 <= len(cells) <= most:
            return of_cells(cells)


def three_cells() -> GridMap:
    """Three cells, every two of them adjacent (drawn as a triangle)."""
    cells = {"a": (0, 1), "b": (2, 0), "c": (2, 2)}
    return GridMap(cells, (("a", "b"), ("a", "c"), ("b", "c")))


def read_map(path: Path) -> GridMap:
    """A map in the format of movingai.com, see `coordlang.sites.movingai.read_map`."""
    return of_cells(set(movingai.read_map(path).cells.values()))


def _clockwise(rows: int, columns: int) -> list[Cell]:
    """The border of a rectangle, once around from the top left cell."""
    top = [(0, col) for col in range(columns)]
    right = [(row, columns - 1) for row in range(1, rows)]
    bottom = [(rows - 1, col) for col in reversed(range(columns - 1))]
    left = [(row, 0) for row in reversed(range(1, rows - 1))]
    return [*top, *right, *bottom, *left]


def of_cells(passable: set[Cell], edges: set[tuple[Cell, Cell]] | None = None) -> GridMap:
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
