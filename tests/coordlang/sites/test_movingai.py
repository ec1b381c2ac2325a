# SPDX-License-Identifier: GPL-3.0-or-later
"""Maps and scenarios of movingai.com as problems of the grid domain; what is wrong with them."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from coordlang.sites.coordinates import read_coordinates
from coordlang.sites.movingai import planning_files, read_agents, read_map
from planners.loading import PlanningInstance, load
from planners.search.optimal_plans import search
from planners.search.plans import Plans
from planners.system.errors import BadInput
from tests.support.command import Command
from tests.support.domains import DOMAINS, SHARED

MAP = "type octile\nheight 3\nwidth 4\nmap\n.@..\n....\n.@.T\n"
LINE = "3\tsome.map\t4\t3\t{}\t2.41421356\n"


def files(folder: Path, agents: list[str], head: str = "version 1\n") -> tuple[Path, Path]:
    """A map, and a scenario with robots ``start x, start y, goal x, goal y``."""
    grid, scenario = folder / "some.map", folder / "some.scen"
    grid.write_text(MAP)
    lines = [LINE.format("\t".join(agent.split())) for agent in agents]
    scenario.write_text(head + "".join(lines))
    return grid, scenario


def loaded(folder: Path, texts: dict[str, str]) -> PlanningInstance:
    for name, text in texts.items():
        (folder / name).write_text(text)
    return load(folder / "domain.pddl", [folder / "problem.pddl"])


def test_columns_are_x_and_rows_are_y(tmp_path: Path) -> None:
    grid, scenario = files(tmp_path, ["0 2 2 0", "3 0 0 0", "0 0 3 0"])
    assert read_agents(scenario, read_map(grid), 2) == (((2, 0), (0, 2)), ((0, 3), (0, 0)))
    texts = planning_files(grid, scenario, 2)
    assert sorted(texts) == ["coordinates.json", "domain.pddl", "problem.pddl"]
    assert texts["domain.pddl"] == (DOMAINS / "grid" / "domain.pddl").read_text()
    model = loaded(tmp_path, texts)
    assert model.problems[0].name == "some-2"
    assert model.team.robots == ("r1", "r2")
    assert [str(atom.args) for atom in sorted(model.problems[0].init, key=str)][-2:] == [
        "('r1', 'c2-0')",
        "('r2', 'c0-3')",
    ]
    assert len(model.model.statics) == 18  # nine pairs of cells that touch
    points = read_coordinates(tmp_path / "coordinates.json")
    assert points == {
        f"c{row}-{column}": (column, row)
        for row, column in [(0, 0), (0, 2), (0, 3), (1, 0), (1, 1), (1, 2), (1, 3), (2, 0), (2, 2)]
    }


def test_the_t_map_is_the_shipped_one(tmp_path: Path) -> None:
    folder = DOMAINS / "t-map"
    own = loaded(tmp_path, planning_files(folder / "t-map.map", folder / "t-map.scen", 2))
    shipped = load(folder / "domain.pddl", [folder / "problem.pddl"])
    assert own.problems[0].init == shipped.problems[0].init
    counts = [Plans.of(search(one.model, one.tasks[0])).count for one in (own, shipped)]
    assert counts[0] == counts[1] > 0


@pytest.mark.parametrize("head", ["version 1.0\n\n", "", "version 1\r\n"])
def test_heads_and_blanks(tmp_path: Path, head: str) -> None:
    grid, scenario = files(tmp_path, ["0 2 2 0"], head)
    scenario.write_text(scenario.read_text().replace("\t", "  "))
    assert len(read_agents(scenario, read_map(grid), 1)) == 1


def test_a_name_that_pddl_does_not_have(tmp_path: Path) -> None:
    grid, scenario = files(tmp_path, ["0 2 2 0"])
    named = scenario.rename(tmp_path / "32 Rooms (a).scen")
    texts = planning_files(grid, named, 1)
    assert "(problem map-32-rooms-a-1)" in texts["problem.pddl"]
    loaded(tmp_path, texts)


@pytest.mark.parametrize(
    ("agents", "change", "line", "message"),
    [
        (["0 0 1 1"], ("", ""), "", "this scenario has 1 robot, and 2 are asked for"),
        ([], ("", ""), "", "this scenario has 0 robots"),
        (["0 0 1 1", "1 0 2 2"], ("", ""), ":3:1:", "the start is no passable cell .* x 1, y 0"),
        (["0 0 1 1", "2 2 3 2"], ("", ""), ":3:1:", "the goal is no passable cell .* x 3, y 2"),
        (["0 0 1 1", "2 2 3 3"], ("", ""), ":3:1:", "the goal is no passable cell .* x 3, y 3"),
        (["0 0 1 1", "0 0 2 2"], ("", ""), ":3:1:", "have the start c0-0 .*line 2"),
        (["0 0 1 1", "2 2 1 1"], ("", ""), ":3:1:", "have the goal c1-1 .*line 2"),
        (["0 0 1 1", "2 2 0 0"], ("\t4\t3\t0", "\t8\t6\t0"), ":2:1:", "width 8 and height 6"),
        (["0 0 1 1", "2 2 0 0"], ("\t2\t2\t", "\t2\t-2\t"), ":3:1:", "no line of a scenario"),
        (["0 0 1 1", "2 2 0"], ("", ""), ":3:1:", "no line of a scenario"),
        (["0 0 1 1", "2 2 0 x"], ("", ""), ":3:1:", "no line of a scenario"),
        (["0 0 1 1", "2 2 0 0"], ("some.map", "sóme.map"), ":2:1:", "not ASCII"),
    ],
)
def test_what_is_wrong_with_a_scenario_and_where(
    tmp_path: Path, agents: list[str], change: tuple[str, str], line: str, message: str
) -> None:
    grid, scenario = files(tmp_path, agents)
    scenario.write_text(scenario.read_text().replace(*change), encoding="utf-8")
    with pytest.raises(BadInput, match=message) as caught:
        planning_files(grid, scenario, 2)
    assert str(caught.value).startswith(str(scenario) + line)
    assert caught.value.remedy


def test_command(coordlang: Command, tmp_path: Path) -> None:
    grid, scenario = files(tmp_path, ["0 2 2 0", "3 0 0 0"])
    arguments = ["import", grid, scenario, "--robots", 2]
    outcome = coordlang(*arguments, "-o", tmp_path / "new" / "folder", "--json")
    assert outcome.code == 0
    assert json.loads(outcome.out) == {
        "folder": str(tmp_path / "new" / "folder"),
        "files": ["coordinates.json", "domain.pddl", "problem.pddl"],
        "robots": ["r1", "r2"],
        "unused": {},
    }
    for folder in (tmp_path / "new" / "folder", tmp_path, tmp_path):  # the same again
        assert coordlang(*arguments, "-o", folder).code == 0
    (tmp_path / "new" / "folder" / "domain.pddl").write_text("mine")
    outcome = coordlang(*arguments, "-o", tmp_path / "new" / "folder")
    assert (outcome.code, "says something else" in outcome.err) == (2, True)
    assert (tmp_path / "new" / "folder" / "domain.pddl").read_text() == "mine"
    to = ("-o", tmp_path / "x")
    for robots in (["--robots", "r1,r2"], ["--robots", 0], []):
        assert coordlang("import", grid, scenario, *robots, *to).code == 2
    for more in (["--task", "r1:c0-0"], ["--clearance", 1], [grid]):
        assert coordlang(*arguments, *more, *to).code == 2
    assert coordlang(*arguments).code == coordlang("import", grid, "--robots", 2, *to).code == 2
    (tmp_path / "swapped").mkdir()
    assert coordlang("import", scenario, grid, "--robots", 2, "-o", tmp_path / "swapped").code == 0
    scenario.write_text("version 1\nnothing\n")
    outcome = coordlang(*arguments, "-o", tmp_path / "x")
    assert (outcome.code, not (tmp_path / "x").exists()) == (31, True)


@pytest.mark.foreign
def test_maps_of_others_are_read(tmp_path: Path) -> None:
    maps = sorted([*SHARED.glob("mapf/*.map"), *SHARED.glob("maps/*.map")])
    assert len(maps) >= 12
    for path in maps:
        grid = read_map(path)
        row, column = next(iter(grid.cells.values()))
        scenario = tmp_path / "own.scen"
        line = f"0 m {grid.width} {grid.height} {column} {row} {column} {row} 0\n"
        scenario.write_text(line)
        assert f"(at r1 c{row}-{column})" in planning_files(path, scenario, 1)["problem.pddl"]
    given = SHARED / "mapf" / "random-32-32-10-random-1.scen"
    grid = read_map(given.with_name("random-32-32-10.map"))
    assert len(read_agents(given, grid, 400)) == 400
