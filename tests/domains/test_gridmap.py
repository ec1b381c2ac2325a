# SPDX-License-Identifier: GPL-3.0-or-later
"""Maps by size, at random and from movingai files."""

from __future__ import annotations

from pathlib import Path

import pytest
from gridmap import GridMap, open_grid, path, read_map, ring

from planners.system.errors import BadInput


def written(tmp_path: Path, text: str) -> Path:
    file = tmp_path / "some.map"
    file.write_text(text, newline="")
    return file


def connected(grid: GridMap) -> bool:
    reached = todo = {next(iter(grid.cells))}
    while todo:
        todo = {near for cell in todo for near in grid.neighbours(cell)} - reached
        reached = reached | todo
    return len(reached) == len(grid.cells)


@pytest.mark.parametrize(
    ("grid", "cells", "edges", "cell", "near"),
    [
        (open_grid(2, 3), 6, 7, "c0-1", ["c0-0", "c0-2", "c1-1"]),
        (path(3, [1]), 4, 3, "c0-1", ["c0-0", "c0-2", "c1-1"]),
        (path(5, [1, 3]), 7, 6, "c1-3", ["c0-3"]),
    ],
)
def test_maps_by_size(grid: GridMap, cells: int, edges: int, cell: str, near: list[str]) -> None:
    assert connected(grid)
    assert (len(grid.cells), len(grid.edges)) == (cells, edges)
    assert grid.neighbours(cell) == near


@pytest.mark.parametrize(
    ("size", "cells"), [((2, 2), 4), ((2, 4), 8), ((4, 2), 8), ((3, 3), 8), ((3, 5), 12)]
)
def test_a_ring_is_one_cycle(size: tuple[int, int], cells: int) -> None:
    grid = ring(*size)
    assert len(grid.cells) == len(grid.edges) == cells
    assert connected(grid)
    assert all(len(grid.neighbours(cell)) == 2 for cell in grid.cells)
    assert all(grid.distance(a, b) == 1 for a, b in grid.edges)


@pytest.mark.parametrize(
    "text",
    [
        "type octile\nheight 2\nwidth 3\nmap\n.@G\nST.\n",
        "height 2\nwidth 3\nmap\n.OG\nSW.",
        "type octile\r\nheight 2\r\nwidth 3\r\nmap\r\n.@G\r\nST.\r\n",
        "width 3\nheight 2\nmap\n.@G\nS@.\n\n\n",
    ],
    ids=["movingai", "no type, no last newline", "windows", "other order, blank lines"],
)
def test_read_map(tmp_path: Path, text: str) -> None:
    grid = read_map(written(tmp_path, text))
    assert list(grid.cells) == ["c0-0", "c0-2", "c1-0", "c1-2"]
    assert grid.edges == (("c0-0", "c1-0"), ("c0-2", "c1-2"))


@pytest.mark.parametrize(
    ("text", "line", "message"),
    [
        ("type octile\nheight 2\nwidth 2\nmap\n..\n.x\n", ":6:2:", "unknown character 'x'"),
        ("height 2\nwidth 2\nmap\n..\n...\n", ":5:1:", "has 3 cells where the header says 2"),
        ("height 2\nwidth 2\nmap\n..\n", ":5:1:", "has 1 rows where the header says 2"),
        ("height 2\nwidth 2\nmap\n..\n..\n..\n", ":6:1:", "has 3 rows where the header says 2"),
        ("height two\nwidth 2\nmap\n..\n", ":1:1:", "unexpected 'height two'"),
        ("height 0\nwidth 2\nmap\n", ":1:1:", "unexpected 'height 0'"),
        ("height 2\nheight 2\nmap\n..\n..\n", ":2:1:", "unexpected 'height 2'"),
        ("height 2\nmap\n..\n..\n", ":2:1:", "unexpected 'map'"),
        ("height 2\nwidth 2\n", ":2:1:", "no line 'map'"),
        ("", ":1:1:", "no line 'map'"),
        ("height 1\nwidth 2\nmap\n@T\n", ":", "no passable cell"),
        ("height 1\nwidth 1\nmap\n\u00ff\n", ":4:1:", "this is no map: .*not ASCII"),
        (None, ":", "there is no such file"),
    ],
)
def test_what_is_wrong_with_a_map_and_where(
    tmp_path: Path, text: str | None, line: str, message: str
) -> None:
    file = tmp_path / "none.map" if text is None else written(tmp_path, text)
    with pytest.raises(BadInput, match=message) as caught:
        read_map(file)
    assert str(caught.value).startswith(str(file) + line)
