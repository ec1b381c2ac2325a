# SPDX-License-Identifier: GPL-3.0-or-later
"""Plans for PlanViz, read back as its decoder reads them."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import coordlang as door
from coordlang.report.planviz import planviz
from planners.system.errors import UsageError
from tests.support.command import Command
from tests.support.domains import DOMAINS
from tests.support.task_languages import shipped

#: So that the page is made quickly.
ONE = ("--tasks-shown", "1")
#: What a letter does to (row, column) in PlanViz' action model MAPF.
LETTERS = {"W": (0, 0), "R": (0, 1), "L": (0, -1), "U": (1, 0), "D": (-1, 0)}


@pytest.mark.parametrize("name", ["grid/corners-4x4", "corridor/problem", "t-map/problem"])
def test_the_robots_are_where_the_plan_has_them(name: str) -> None:
    _, used = shipped(name)
    found = planviz(used)
    data = json.loads(found.plan)
    folder, _, stem = name.partition("/")
    plan = door.plans(DOMAINS / folder / "domain.pddl", DOMAINS / folder / f"{stem}.pddl")[0]
    assert data["makespan"] == len(plan)
    kind, height, width, word, *rows = found.map.splitlines()
    assert (kind, word) == ("type octile", "map")
    assert (height, width) == (f"height {len(rows)}", f"width {len(rows[0])}")
    for robot, (row, column, heading) in enumerate(data["start"]):
        assert heading == "N/A"
        moves = data["actualPaths"][robot].split(",")
        assert len(moves) == len(plan)
        for letter, step in zip(moves, plan, strict=True):
            before = row, column
            row, column = row + LETTERS[letter][0], column + LETTERS[letter][1]
            assert rows[row][column] == "."
            text = step[robot]
            cells = [] if text is None else text.strip("()").split()[-2:]
            expected = [tuple(map(int, cell[1:].split("-"))) for cell in cells] or [before, before]
            assert [before, (row, column)] == expected
        assert data["tasks"][robot] == [robot, row, column]


def test_where_robots_are_not_on_a_grid() -> None:
    _, used = shipped("vans/two-each")
    with pytest.raises(UsageError, match="cell to cell"):
        planviz(used)


def test_command(coordlang: Command, language: Path, tmp_path: Path) -> None:
    files = DOMAINS / "t-map" / "domain.pddl", DOMAINS / "t-map" / "problem.pddl"
    page = tmp_path / "page.html"
    assert coordlang("report", language, *files, "-o", page, "--planviz", *ONE).code == 0
    assert json.loads((tmp_path / "page.planviz.json").read_text())["teamSize"] == 2
    assert (tmp_path / "page.planviz.map").read_text().splitlines()[4:] == ["@.@", "..."]
    assert coordlang("report", language, *files, "-o", "-", "--planviz").code == 2
