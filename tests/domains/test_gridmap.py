# SPDX-License-Identifier: GPL-3.0-or-later
"""Maps by size and from movingai files."""

from __future__ import annotations

from pathlib import Path

import pytest
from gridmap import open_grid, read_map, ring

from planners.system.errors import BadInput
from tests.support.domains import SHARED


def written(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "some.map"
    path.write_text(text, newline="")
    return path


def test_open_grid() -> None:
    grid = open_grid(2, 3)
    assert list(grid.cells) == ["c0-0", "c0-1", "c0-2", "c1-0", "c1-1", "c1-2"]
    assert grid.neighbours("c0-1") == ["c0-0", "c0-2", "c1-1"]
    assert len(grid.edges) == 7
    assert grid.distance("c0-0", "c1-2") == 3


@pytest.mark.parametrize(
    ("size", "cells"), [((2, 2), 4), ((2, 4), 8), ((4, 2), 8), ((3, 3), 8), ((3, 5), 12)]
)
def test_a_ring_is_one_cycle(size: tuple[int, int], cells: int) -> None:
    grid = ring(*size)
    assert len(grid.cells) == len(grid.edges) == cells
    tour = [next(iter(grid.cells))]
    while following := [c for c in grid.neighbours(tour[-1]) if c not in tour[-2:]]:
        if following[0] == tour[0]:
            break
        tour.append(following[0])
    assert len(tour) == cells
    assert all(len(grid.neighbours(cell)) == 2 for cell in grid.cells)
    assert all(grid.distance(a, b) == 1 for a, b in grid.edges)


def test_a_ring_needs_two_rows() -> None:
    with pytest.raises(ValueError, match="at least two"):
        ring(1, 5)


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
    ],
)
def test_what_is_wrong_with_a_map_and_where(
    tmp_path: Path, text: str, line: str, message: str
) -> None:
    path = written(tmp_path, text)
    with pytest.raises(BadInput, match=message) as caught:
        read_map(path)
    assert str(caught.value).startswith(str(path) + line)


def test_no_such_map(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match=r"none\.map: there is no such file"):
        read_map(tmp_path / "none.map")


def test_a_map_that_is_no_text(tmp_path: Path) -> None:
    (tmp_path / "some.map").write_bytes(b"height 1\nwidth 1\nmap\n\xff\n")
    with pytest.raises(BadInput, match=r"some\.map:4:1: this is no map: .*not ASCII"):
        read_map(tmp_path / "some.map")


@pytest.mark.foreign
def test_maps_that_others_wrote() -> None:
    if not SHARED.is_dir():
        pytest.skip(f"{SHARED} is not here")
    sizes = {
        path.stem: len(read_map(path).cells) for path in sorted((SHARED / "maps").glob("*.map"))
    }
    assert {
        name: sizes[name]
        for name in ("6x6", "empty-8-8", "tree", "loop-chain", "lacam-2x1", "corners")
    } == {"6x6": 36, "empty-8-8": 64, "tree": 7, "loop-chain": 9, "lacam-2x1": 2, "corners": 12}
    assert all(sizes.values())
