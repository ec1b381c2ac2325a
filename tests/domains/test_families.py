# SPDX-License-Identifier: GPL-3.0-or-later
"""Problems of any size: they are read, can be solved, and grow as they say."""

from __future__ import annotations

from random import Random

import families
import pytest
from gridmap import GridMap, path, rooms_and_corridors, two_rooms

from planners.loading import build
from planners.pddl import parse_problem, read_domain
from planners.pddl.sexpr import Source
from planners.search.optimal_plans import search
from tests.support.domains import DOMAINS


@pytest.mark.parametrize(
    ("folder", "text", "steps", "robots"),
    [
        ("handover", families.handover(2), 10, 2),
        ("handover", families.handover(3, 1), 7, 2),
        ("push-box", families.push_box(3), 1, 2),
        ("push-box", families.push_box(6), 3, 2),
        ("charger", families.charger(1), 3, 2),
        ("charger", families.charger(2), 4, 2),
        ("elevator", families.elevator(3), 6, 3),
        ("vans", families.vans(1), 4, 3),
        ("vans", families.vans(2), 5, 3),
    ],
)
def test_problems_are_read_and_solved(folder: str, text: str, steps: int, robots: int) -> None:
    domain = read_domain(DOMAINS / folder / "domain.pddl")
    loaded = build(domain, [parse_problem(Source("problem", text), domain)])
    assert len(loaded.model.robots) == robots
    space = search(loaded.model, loaded.tasks[0])
    assert space.cost_of(0)[0] == steps


def connected(grid: GridMap) -> bool:
    reached = todo = {next(iter(grid.cells))}
    while todo:
        todo = {near for cell in todo for near in grid.neighbours(cell)} - reached
        reached = reached | todo
    return len(reached) == len(grid.cells)


def test_paths_with_bays() -> None:
    assert list(path(3, [1]).cells) == ["c0-0", "c0-1", "c0-2", "c1-1"]
    grid = path(5, [1, 3])
    assert connected(grid)
    assert len(grid.cells) == 7
    assert len(grid.edges) == 6


def test_two_rooms() -> None:
    grid = two_rooms(2, 2, 3)
    assert connected(grid)
    assert grid.size == (2, 7)
    assert len(grid.cells) == 11
    assert grid.neighbours("c0-3") == ["c0-2", "c0-4"]


def test_random_rooms_are_connected_and_small() -> None:
    sizes = set()
    for seed in range(60):
        grid = rooms_and_corridors(Random(seed))
        assert connected(grid)
        assert 5 <= len(grid.cells) <= 12
        sizes.add(len(grid.cells))
        assert grid == rooms_and_corridors(Random(seed))
    assert len(sizes) > 5
