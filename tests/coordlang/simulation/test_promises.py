# SPDX-License-Identifier: GPL-3.0-or-later
"""Under a sentence nobody collides, waits in vain or comes late: many runs on many maps."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from coordlang.commands.building import build_language
from coordlang.execution.best_sentence import best_sentence
from coordlang.execution.task_language import language_in_task
from coordlang.language.candidates import from_problems
from coordlang.simulation.record import RunRecord
from coordlang.simulation.run import runs_of
from coordlang.simulation.simulator import Settings
from coordlang.simulation.team import Mission, mission
from coordlang.sites.movingai import planning_files, read_map
from planners.pddl import read_domain, read_problem
from tests.support.domains import SHARED
from tests.support.simulation import floor_for, mission_of

#: From row, column to row, column.
Ways = list[tuple[int, int, int, int]]


def on_map(map_file: Path, ways: Ways, folder: Path) -> Mission:
    """Robots on a map in movingai format, under the sentence that leaves most plans open."""
    grid = read_map(map_file)
    lines = [
        f"0\tm\t{grid.width}\t{grid.height}\t{column}\t{row}\t{last_column}\t{last_row}\t1"
        for row, column, last_row, last_column in ways
    ]
    scenario = folder / "ways.scen"
    scenario.write_text("\n".join(["version 1", *lines, ""]))
    for name, text in planning_files(map_file, scenario, len(ways)).items():
        (folder / name).write_text(text)
    domain = read_domain(folder / "domain.pddl")
    problem = read_problem(folder / f"ways-{len(ways)}.pddl", domain)
    language = build_language(from_problems(domain, [problem]), "greedy").language
    used = language_in_task(language, domain, problem)
    return mission(used, "sentence", best_sentence(used, ["most-plans"]).words)


def broken(of: Mission, settings: Settings, runs: int) -> list[RunRecord]:
    """The runs in which something went wrong."""
    floor = floor_for(of, settings)
    found = runs_of(of, floor, settings, runs)
    return [one for one in found if one.collisions or one.deadlock or one.late or not one.arrived]


@pytest.fixture(scope="module")
def ring(tmp_path_factory: pytest.TempPathFactory) -> Mission:
    """Four robots in a square, each of which takes the place of the next one in one step."""
    folder = tmp_path_factory.mktemp("ring")
    grid = folder / "ring.map"
    grid.write_text("type octile\nheight 2\nwidth 2\nmap\n..\n..\n")
    return on_map(grid, [(0, 0, 0, 1), (0, 1, 1, 1), (1, 1, 1, 0), (1, 0, 0, 0)], folder)


@pytest.mark.parametrize("step", ["clock", "barrier"])
def test_four_robots_of_the_greatest_radius_rotate(step: str, ring: Mission) -> None:
    """Each enters the place that another one leaves, at a right angle: as near as it gets."""
    assert broken(ring, Settings(step=step, radius=0.25), 4) == []


def test_robots_drive_off_together_however_far_each_has_to_turn(ring: Mission) -> None:
    settings = Settings(noise=0.0)
    for seed in range(3):
        [found] = runs_of(ring, floor_for(ring), settings, 1, seed)
        turns = {round(abs(poses[0][2] - poses[-1][2]), 1) for poses in found.poses.values()}
        assert len(turns) > 1
        left = {
            next(at for at, pose in enumerate(poses) if math.dist(pose[:2], poses[0][:2]) > 0.05)
            for poses in found.poses.values()
        }
        assert len(left) == 1, "they leave their places at one time"


@pytest.mark.thorough
@pytest.mark.parametrize("step", ["clock", "barrier"])
@pytest.mark.parametrize(
    "problem", ["t-map/problem", "corridor/problem", "grid/gwb7-3x5", "grid/three-robots-3x3"]
)
def test_shipped_maps(problem: str, step: str) -> None:
    assert broken(mission_of(*problem.split("/")), Settings(step=step), 20) == []


@pytest.mark.thorough
@pytest.mark.foreign
@pytest.mark.skipif(
    not SHARED.is_dir(), reason=f"the inputs that others wrote are not here: {SHARED}"
)
@pytest.mark.parametrize("step", ["clock", "barrier"])
@pytest.mark.parametrize(
    ("name", "ways"),
    [
        ("highways-8-8", [(3, 0, 3, 7), (3, 7, 3, 0)]),
        ("highways-8-8", [(3, 0, 3, 7), (3, 7, 3, 0), (0, 3, 7, 4)]),
        ("maze-11-11", [(1, 1, 4, 9), (4, 9, 1, 1)]),
    ],
)
def test_maps_of_others(name: str, ways: Ways, step: str, tmp_path: Path) -> None:
    found = on_map(SHARED / "mapf" / f"{name}.map", ways, tmp_path)
    assert broken(found, Settings(step=step), 10) == []
