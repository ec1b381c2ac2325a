# SPDX-License-Identifier: GPL-3.0-or-later
"""Maps: cells and which of them are adjacent, made by size or read from a movingai file."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

from coordlang import movingai
from coordlang.movingai import cell_name

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
    """A map in the format of movingai.com, see `coordlang.movingai.read_map`."""
    return _of(set(movingai.read_map(path).passable))


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
