# SPDX-License-Identifier: GPL-3.0-or-later
"""Maps and scenarios of movingai.com -> problems of the shipped grid domain."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path

from coordlang.sites import shipped_domains
from planners.pddl.pddl_text import named_like
from planners.system.errors import BadInput, Position
from planners.system.files import read_bytes
from planners.system.messages import counted, echoed

#: The characters of a map: ground, ground, swamp | out of bounds, out of bounds, trees, water.
PASSABLE = ".GS"
BLOCKED = "@OTW"
_UNKNOWN = re.compile(f"[^{PASSABLE}{BLOCKED}]")
_CHARACTERS = f"Passable: {' '.join(PASSABLE)}; blocked: {' '.join(BLOCKED)}."
#: The columns of a scenario file.
_COLUMNS = "bucket, map, width, height, start x, start y, goal x, goal y, optimal length"

#: A cell: row and column, from 0.
Cell = tuple[int, int]
#: Where one robot starts, and where it has to be.
Agent = tuple[Cell, Cell]


@dataclass(frozen=True, slots=True)
class MovingMap:
    """A map: the cells that robots can be in, by name, row by row from the left."""

    height: int
    width: int
    cells: Mapping[str, Cell]

    def near(self, name: str) -> list[str]:
        """The up to four cells around a cell, by name: above, left, right, below."""
        row, column = self.cells[name]
        around = ((row - 1, column), (row, column - 1), (row, column + 1), (row + 1, column))
        return [other for other in map(cell_name, around) if other in self.cells]


def cell_name(cell: Cell) -> str:
    """Name a cell: ``c0-2`` is in the top row, third from the left."""
    return f"c{cell[0]}-{cell[1]}"


def read_map(path: Path) -> MovingMap:
    """Read a map in the format of movingai.com, with or without its ``type`` line.

    Raises `BadInput` for anything else, with the line.
    """
    lines = _lines(path, "map")
    height, width, header = _header(path, lines)
    rows = [line.rstrip() for line in lines[header:]]
    while len(rows) > height and not rows[-1]:
        rows.pop()
    for number, row in enumerate(rows[:height], start=header + 1):
        _check_row(path, number, row, width)
    if len(rows) != height:
        what = f"the map has {len(rows)} rows where the header says {height}"
        last = header + 1 + min(len(rows), height)
        raise _wrong(what, "Correct the header or the rows.", path, last)
    cells = {
        cell_name((row, column)): (row, column)
        for row, line in enumerate(rows)
        for column, ground in enumerate(line)
        if ground in PASSABLE
    }
    if not cells:
        raise _wrong("this map has no passable cell", _CHARACTERS, path, header + 1)
    return MovingMap(height, width, cells)


def _check_row(path: Path, number: int, row: str, width: int) -> None:
    if len(row) != width:
        what = f"this row has {len(row)} cells where the header says {width}"
        raise _wrong(what, "Correct the header or the rows.", path, number)
    if unknown := _UNKNOWN.search(row):
        what = f"unknown character {unknown[0]!r} in the map"
        raise _wrong(what, _CHARACTERS, path, number, unknown.start() + 1)


def read_agents(path: Path, grid: MovingMap, agents: int) -> tuple[Agent, ...]:
    """Read the first lines of a scenario, one for each robot.

    Raises `BadInput` for too few lines, a line of another form, another map's size, a cell that is
    blocked or outside the map, and two robots with one start or one goal.
    """
    lines = [(n, text) for n, text in enumerate(_lines(path, "scenario"), 1) if text.strip()]
    if lines and lines[0][1].split()[0] == "version":
        lines = lines[1:]
    if len(lines) < agents:
        fewer = f"Say --robots {len(lines)} or fewer."
        what = f"this scenario has {counted(len(lines), 'robot')}, and {agents:,} are asked for"
        raise _wrong(what, fewer if lines else f"Expected a line for each: {_COLUMNS}.", path)
    found: list[Agent] = []
    taken: dict[tuple[str, Cell], int] = {}
    for number, text in lines[:agents]:
        agent = _agent(path, number, text, grid)
        for what, cell in zip(("start", "goal"), agent, strict=True):
            before = taken.setdefault((what, cell), number)
            if before != number:
                said = (
                    f"two robots have the {what} {cell_name(cell)} (the other one: line {before})"
                )
                remedy = "No two robots can be in one cell: leave one of the lines out."
                raise _wrong(said, remedy, path, number)
        found.append(agent)
    return tuple(found)


def planning_files(map_file: Path, scenario: Path, agents: int) -> dict[str, str]:
    """Write a map and the first robots of a scenario as PDDL: texts by the names of their files.

    ``domain.pddl`` is the shipped grid domain, the problem has the scenario's name and the number
    of robots, and ``coordinates.json`` says where the report draws the cells (x: column, y: row).
    Raises `BadInput`, see `read_map` and `read_agents`.
    """
    grid = read_map(map_file)
    found = read_agents(scenario, grid, agents)
    stem = scenario.name.removesuffix(".scen")
    name = f"{named_like(stem)}-{agents}"
    text = grid_problem_text(
        name if name[:1].isalpha() else f"map-{name}",
        "grid",
        grid.cells,
        grid.near,
        [cell_name(start) for start, _ in found],
        [cell_name(goal) for _, goal in found],
        written_by="coordlang import",
    )
    coordinates = {name: cell[::-1] for name, cell in grid.cells.items()}
    domain = shipped_domains() / "grid" / "domain.pddl"
    return {
        "domain.pddl": domain.read_text(encoding="utf-8"),
        "problem.pddl": text,
        "coordinates.json": json.dumps({"coordinates": coordinates}) + "\n",
    }


def grid_problem_text(
    name: str,
    domain: str,
    cells: Mapping[str, Cell],
    neighbours: Callable[[str], Sequence[str]],
    starts: Sequence[str],
    goals: Sequence[str],
    *,
    written_by: str,
    declare_robots: bool = True,
) -> str:
    """Write a problem of the grid domain, in which robot number k is ``r{k+1}``.

    ``cells`` come row by row; ``neighbours`` gives those adjacent to a cell, in the order in which
    they are written.  Without ``declare_robots`` robots are constants of the domain.
    """
    robots = [f"r{number}" for number in range(1, len(starts) + 1)]
    rows = groupby(cells, key=lambda name: cells[name][0])
    listed = ["    " + " ".join(names) for _, names in rows]
    near = ((cell, neighbours(cell)) for cell in cells)
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
        *("    " + " ".join(f"(adjacent {c} {o})" for o in others) for c, others in near if others),
        "  )",
        f"  (:goal (and {_positions(robots, goals)}))",
        ")",
    ]
    return "\n".join(lines) + "\n"


def _positions(robots: Iterable[str], cells: Iterable[str]) -> str:
    return " ".join(f"(at {robot} {cell})" for robot, cell in zip(robots, cells, strict=True))


def _wrong(what: str, remedy: str, path: Path, line: int = 0, column: int = 1) -> BadInput:
    return Position(str(path), line, column).fail(what, remedy)


def _lines(path: Path, what: str) -> list[str]:
    data = read_bytes(path)
    for number, line in enumerate(data.splitlines(), start=1):
        if not line.isascii():
            said = f"this is no {what}: a character that is not ASCII"
            raise _wrong(said, "Is it the right file, and not a packed one?", path, number)
    return data.decode("ascii").splitlines()


def _header(path: Path, lines: Sequence[str]) -> tuple[int, int, int]:
    """The height and width of a map, and the number of its header's last line."""
    sizes: dict[str, int] = {}
    for number, line in enumerate(lines, start=1):
        match line.split():
            case ["map"] if len(sizes) == 2:
                return sizes["height"], sizes["width"], number
            case ["height" | "width" as key, text] if key not in sizes and (size := _natural(text)):
                sizes[key] = size
            case [] | ["type", _]:
                pass
            case _:
                what = f"unexpected {echoed(line)} in the header of a map"
                remedy = "Expected 'height N' and 'width N' (once each, N from 1), then 'map'."
                raise _wrong(what, remedy, path, number)
    expected = "Expected 'type octile', 'height N', 'width N', 'map', and then the rows."
    raise _wrong("this file has no line 'map'", expected, path, max(1, len(lines)))


def _agent(path: Path, line: int, text: str, grid: MovingMap) -> Agent:
    """One line of a scenario; columns are parted by tabs, or by blanks."""
    words = text.split("\t") if "\t" in text else text.split()
    known = [n for word in words[2:8] if (n := _natural(word.strip())) is not None]
    if len(words) < 8 or len(known) < 6:
        expected = f"Expected {_COLUMNS}, parted by tabs, with whole numbers."
        raise _wrong(f"this is no line of a scenario: {echoed(text.strip())}", expected, path, line)
    width, height, start_x, start_y, goal_x, goal_y = known
    if (height, width) != (grid.height, grid.width):
        what = f"this line is for a map of width {width} and height {height}, not "
        remedy = "Give the map of this scenario, not scaled."
        raise _wrong(f"{what}{grid.width} and {grid.height}", remedy, path, line)
    agent = (start_y, start_x), (goal_y, goal_x)
    for which, cell in zip(("start", "goal"), agent, strict=True):
        if cell_name(cell) not in grid.cells:
            what = f"the {which} is no passable cell of the map: x {cell[1]}, y {cell[0]}"
            remedy = "x counts columns from the left and y rows from the top, both from 0."
            raise _wrong(what, remedy, path, line)
    return agent


def _natural(text: str) -> int | None:
    """A whole number that is not negative; None for anything else, and for endless ones."""
    return int(text) if text.isdecimal() and text.isascii() and len(text) <= 9 else None
