# SPDX-License-Identifier: GPL-3.0-or-later
"""The floor: where cells lie, and walls along the sides that nobody crosses."""

from __future__ import annotations

from itertools import pairwise

import pytest

from coordlang.simulation.floor import Floor, outlines, require_room
from coordlang.sites.world import Link, World
from planners.system.errors import BadInput, UsageError
from tests.support.simulation import floor_for, mission_of


def world(places: tuple[str, ...], *links: tuple[str, str]) -> World:
    return World((), places, tuple(Link(ends, True) for ends in links), {})


T = world(("c0-1", "c1-0", "c1-1", "c1-2"), ("c0-1", "c1-1"), ("c1-0", "c1-1"), ("c1-1", "c1-2"))


def test_rows_go_down_and_metres_go_up() -> None:
    floor = Floor(T, {}, 2.0)
    assert floor.points == {"c0-1": (2, 2), "c1-0": (0, 0), "c1-1": (2, 0), "c1-2": (4, 0)}
    assert (floor.shortest, floor.longest) == (2, 2)


def test_walls_are_all_sides_that_no_link_crosses() -> None:
    """Of the four cells of the T-map 16 sides, less two for each of three links."""
    floor = Floor(T, {}, 1.0)
    lengths = [abs(x2 - x1) + abs(y2 - y1) for x1, y1, x2, y2 in floor.walls]
    assert sum(lengths) == 16 - 2 * 3
    assert (-0.5, -0.5, 2.5, -0.5) in floor.walls, "the lower sides of three cells are one wall"


def test_neighbours_without_a_link_have_a_wall_between_them() -> None:
    ring = world(("c0-0", "c0-1", "c1-0", "c1-1"), ("c0-0", "c0-1"), ("c1-0", "c1-1"))
    assert (-0.5, 0.5, 1.5, 0.5) in Floor(ring, {}, 1.0).walls


def test_places_that_are_no_cells_have_no_walls() -> None:
    towns = world(("depot", "town"), ("depot", "town"))
    floor = Floor(towns, {"depot": (0, 0), "town": (1.5, 2)}, 2.0)
    assert floor.points == {"depot": (0, 4), "town": (3, 0)}
    assert floor.walls == ()


def test_places_without_coordinates_are_an_error() -> None:
    towns = world(("depot", "town"), ("depot", "town"))
    with pytest.raises(BadInput, match=r"not known: depot, town(.|\n)*--coordinates"):
        Floor(towns, {}, 1.0)


@pytest.mark.parametrize("folder", ["t-map", "corridor"])
def test_outlines_draw_every_wall_and_nothing_else(folder: str) -> None:
    walls = floor_for(mission_of(folder)).walls
    lines = outlines(walls)
    assert len(lines) == 1, "the walls around one floor are connected"
    drawn = {frozenset(pair) for line in lines for pair in pairwise(line)}
    assert drawn == {frozenset((wall[:2], wall[2:])) for wall in walls}


def test_robots_that_are_too_large_are_an_error() -> None:
    floor = floor_for(mission_of("t-map"))
    require_room(floor, 0.25)
    with pytest.raises(UsageError, match=r"--radius of at most 0\.25"):
        require_room(floor, 0.26)
