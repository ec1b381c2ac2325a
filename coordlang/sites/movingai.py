# SPDX-License-Identifier: GPL-3.0-or-later
"""Maps and scenarios of movingai.com -> problems of the shipped grid domain."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path

from coordlang.sites.shipped import shipped_domains
from planners.system.errors import BadInput, Position, UsageError
from planners.system.files import read_bytes
from planners.system.messages import echoed

#: The characters of a map: ground, ground, swamp | out of bounds, out of bounds, trees, water.
PASSABLE = ".GS"
BLOCKED = "@OTW"
_UNKNOWN = re.compile(f"[^{PASSABLE}{BLOCKED}]")
#: Characters of names that PDDL has in names, too.
_UNNAMED = re.compile(r"[^a-z0-9_-]+")
#: The columns of a scenario file.
_COLUMNS = "bucket, map, width, height, start x, start y, goal x, goal y, optimal length"

#: A cell: row and column, from 0.
Cell = tuple[int, int]


@dataclass(frozen=True, slots=True)
class MovingMap:
    """A map, row by row; a character of `PASSABLE` is a cell that robots can be in."""

    rows: tuple[str, ...]

    @property
    def height(self) -> int:
        """The number of rows."""
        return len(self.rows)

    @property
    def width(self) -> int:
        """The number of columns."""
        return len(self.rows[0])

    @property
    def passable(self) -> frozenset[Cell]:
        """All cells that robots can be in, which takes far more memory than the map."""
        return frozenset(cell for row in range(self.height) for cell in self.in_row(row))

    def in_row(self, row: int) -> Iterator[Cell]:
        """The cells of a row that robots can be in, from the left."""
        return ((row, at) for at, ground in enumerate(self.rows[row]) if ground in PASSABLE)

    def __contains__(self, cell: Cell) -> bool:
        row, column = cell
        inside = 0 <= row < self.height and 0 <= column < self.width
        return inside and self.rows[row][column] in PASSABLE

    def near(self, name: str) -> list[str]:
        """The up to four cells around a cell, by name: above, left, right, below."""
        row, column = map(int, name[1:].split("-"))
        around = ((row - 1, column), (row, column - 1), (row, column + 1), (row + 1, column))
        return [cell_name(cell) for cell in around if cell in self]


@dataclass(frozen=True, slots=True)
class Agent:
    """A line of a scenario: where one robot starts, and where it has to be."""

    start: Cell
    goal: Cell


def cell_name(cell: Cell) -> str:
    """Name a cell: ``c0-2`` is in the top row, third from the left."""
    return f"c{cell[0]}-{cell[1]}"


def read_map(path: Path) -> MovingMap:
    """Read a map in the format of movingai.com, with or without its ``type`` line.

    Raises
    ------
    BadInput
        For anything else, with the line.
    """
    rows, first = _map_rows(path, _lines(path, "map"))
    for row, text in enumerate(rows):
        if unknown := _UNKNOWN.search(text):
            raise BadInput(
                f"unknown character {unknown[0]!r} in the map",
                position=Position(str(path), first + row, unknown.start() + 1),
                remedy=f"Passable: {' '.join(PASSABLE)}; blocked: {' '.join(BLOCKED)}.",
            )
    if not any(character in row for row in rows for character in PASSABLE):
        raise BadInput(
            "this map has no passable cell",
            position=Position(str(path), first, 1),
            remedy=f"Passable: {' '.join(PASSABLE)}; blocked: {' '.join(BLOCKED)}.",
        )
    return MovingMap(tuple(rows))


def read_agents(path: Path, grid: MovingMap, agents: int) -> tuple[Agent, ...]:
    """Read the first lines of a scenario, one for each robot.

    Raises
    ------
    BadInput
        Too few lines, a line of another form, another map's size, a cell that is blocked or outside
        the map, and two robots with one start or one goal.
    """
    lines = [(n, text) for n, text in enumerate(_lines(path, "scenario"), 1) if text.strip()]
    if lines and lines[0][1].split()[0] == "version":
        lines = lines[1:]
    if len(lines) < agents:
        raise BadInput(
            f"this scenario has {len(lines):,} robots, and {agents:,} are asked for",
            position=Position(str(path)),
            remedy=f"Say --agents {len(lines)} or fewer."
            if lines
            else f"Expected a line for each robot: {_COLUMNS}.",
        )
    found: list[Agent] = []
    taken: dict[tuple[str, Cell], int] = {}
    for number, text in lines[:agents]:
        position = Position(str(path), number, 1)
        agent = _agent(text, grid, position)
        for what, cell in (("start", agent.start), ("goal", agent.goal)):
            before = taken.setdefault((what, cell), number)
            if before != number:
                raise BadInput(
                    f"two robots have the {what} {cell_name(cell)} (the other one: line {before})",
                    position=position,
                    remedy="No two robots can be in one cell: leave one of the lines out.",
                )
        found.append(agent)
    return tuple(found)


def planning_files(map_file: Path, scenario: Path, agents: int) -> dict[str, str]:
    """Write a map and the first robots of a scenario as PDDL: texts by the names of their files.

    ``domain.pddl`` is the shipped grid domain, the problem has the scenario's name and the number
    of robots, and ``coordinates.json`` says where the report draws the cells (x: column, y: row).

    Raises
    ------
    BadInput
        See `read_map` and `read_agents`.
    UsageError
        Fewer than one robot.
    """
    if agents < 1:
        raise UsageError(
            f"--agents {agents}: at least one robot is needed", remedy="Use --agents 2 or more."
        )
    grid = read_map(map_file)
    found = read_agents(scenario, grid, agents)
    stem = scenario.name.removesuffix(".scen")
    name = f"{_UNNAMED.sub('-', stem.lower()).strip('-')}-{agents}"
    cells = [list(map(cell_name, grid.in_row(row))) for row in range(grid.height)]
    text = grid_problem_text(
        name if name[:1].isalpha() else f"map-{name}",
        "grid",
        list(filter(None, cells)),
        grid.near,
        [cell_name(agent.start) for agent in found],
        [cell_name(agent.goal) for agent in found],
        written_by="coordlang domains --map",
    )
    places = (
        f'"{cell_name((row, column))}": [{column}, {row}]'
        for row in range(grid.height)
        for _, column in grid.in_row(row)
    )
    domain = shipped_domains() / "grid" / "domain.pddl"
    return {
        "domain.pddl": domain.read_text(encoding="utf-8"),
        f"{stem}-{agents}.pddl": text,
        "coordinates.json": f'{{"coordinates": {{{", ".join(places)}}}}}\n',
    }


def grid_problem_text(
    name: str,
    domain: str,
    rows: Sequence[Sequence[str]],
    neighbours: Callable[[str], Sequence[str]],
    starts: Sequence[str],
    goals: Sequence[str],
    *,
    written_by: str,
    declare_robots: bool = True,
) -> str:
    """Write a problem of the grid domain, in which robot number k is ``r{k+1}``.

    Parameters
    ----------
    rows
        The cells, row by row.
    neighbours
        Gives the cells that are adjacent to a cell, in the order in which they are written.
    declare_robots
        Whether the robots are objects of the problem; else they are constants of the domain.
    """
    robots = [f"r{number}" for number in range(1, len(starts) + 1)]
    listed = ["    " + " ".join(names) for names in rows]
    lines = [
        f"; Written by {written_by}.",
        f"(define (problem {name})",
        f"  (:domain {domain})",
        "  (:objects",
        *([f"    {' '.join(robots)} - robot"] if declare_robots else []),
        *listed[:-1],
        listed[-1] + " - cell",
        "  )",
        "  (:init",
        f"    {_positions(robots, starts)}",
        *filter(None, ("\n".join(_adjacent(names, neighbours)) for names in rows)),
        "  )",
        f"  (:goal (and {_positions(robots, goals)}))",
        ")",
    ]
    return "\n".join(lines) + "\n"


def _positions(robots: Iterable[str], cells: Iterable[str]) -> str:
    return " ".join(f"(at {robot} {cell})" for robot, cell in zip(robots, cells, strict=True))


def _adjacent(names: Iterable[str], neighbours: Callable[[str], Sequence[str]]) -> Iterator[str]:
    """A line of atoms for each cell that has neighbours."""
    for cell in names:
        if near := neighbours(cell):
            yield "    " + " ".join(f"(adjacent {cell} {other})" for other in near)


def in_rows(cells: Mapping[str, Cell]) -> list[list[str]]:
    """The names of cells, which come row by row, in a list for each row."""
    return [list(names) for _, names in groupby(cells, key=lambda name: cells[name][0])]


def _lines(path: Path, what: str) -> list[str]:
    data = read_bytes(path)
    for number, line in enumerate(data.splitlines(), start=1):
        if not line.isascii():
            raise BadInput(
                f"this is no {what}: a character that is not ASCII",
                position=Position(str(path), number, 1),
                remedy="Is it the right file, and not a packed one?",
            )
    return data.decode("ascii").splitlines()


def _map_rows(path: Path, lines: Sequence[str]) -> tuple[list[str], int]:
    """The rows of the map, checked against its header, and the number of the first one's line."""
    sizes: dict[str, int] = {}
    for number, line in enumerate(lines, start=1):
        match line.split():
            case [] | ["type", _]:
                continue
            case ["height" | "width" as key, value] if (
                key not in sizes and (size := _natural(value)) is not None and size > 0
            ):
                sizes[key] = size
            case ["map"] if len(sizes) == 2:
                rows = _checked_rows(path, lines, number, sizes["height"], sizes["width"])
                return rows, number + 1
            case _:
                raise BadInput(
                    f"unexpected {echoed(line)} in the header of a map",
                    position=Position(str(path), number, 1),
                    remedy="Expected 'height N' and 'width N' (once each, N from 1), then 'map'.",
                )
    raise BadInput(
        "this file has no line 'map'",
        position=Position(str(path), max(1, len(lines)), 1),
        remedy="Expected 'type octile', 'height N', 'width N', 'map', and then the rows.",
    )


def _checked_rows(
    path: Path, lines: Sequence[str], header: int, height: int, width: int
) -> list[str]:
    rows = [line.rstrip() for line in lines[header:]]
    while len(rows) > height and not rows[-1]:
        rows.pop()
    remedy = "Correct the header or the rows."
    for number, row in enumerate(rows[:height], start=header + 1):
        if len(row) != width:
            raise BadInput(
                f"this row has {len(row)} cells where the header says {width}",
                position=Position(str(path), number, 1),
                remedy=remedy,
            )
    if len(rows) != height:
        raise BadInput(
            f"the map has {len(rows)} rows where the header says {height}",
            position=Position(str(path), header + 1 + min(len(rows), height), 1),
            remedy=remedy,
        )
    return rows


def _agent(text: str, grid: MovingMap, position: Position) -> Agent:
    """One line of a scenario; columns are parted by tabs, or by blanks."""
    words = text.split("\t") if "\t" in text else text.split()
    numbers = [_natural(word.strip()) for word in words[2:8]]
    known = [number for number in numbers if number is not None]
    if len(words) < 8 or len(known) < 6:
        raise BadInput(
            f"this is no line of a scenario: {echoed(text.strip())}",
            position=position,
            remedy=f"Expected {_COLUMNS}, parted by tabs, with whole numbers.",
        )
    width, height, start_x, start_y, goal_x, goal_y = known
    if (height, width) != (grid.height, grid.width):
        raise BadInput(
            f"this line is for a map of width {width} and height {height}, not "
            f"{grid.width} and {grid.height}",
            position=position,
            remedy="Give --map the map of this scenario, not scaled.",
        )
    agent = Agent((start_y, start_x), (goal_y, goal_x))
    for what, cell in (("start", agent.start), ("goal", agent.goal)):
        if cell not in grid:
            raise BadInput(
                f"the {what} is no passable cell of the map: x {cell[1]}, y {cell[0]}",
                position=position,
                remedy="x counts columns from the left and y rows from the top, both from 0.",
            )
    return agent


def _natural(text: str) -> int | None:
    """A whole number that is not negative; None for anything else, and for endless ones."""
    return int(text) if text.isdecimal() and text.isascii() and len(text) <= 9 else None
