# SPDX-License-Identifier: GPL-3.0-or-later
"""Recipes of the paper's experiments and their runs: what is known is not run again, limits, interrupts."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest

from benchmarks.paper import communication, game, planning_cost, scenario, table1
from benchmarks.paper.__main__ import RECIPES, main
from benchmarks.paper.driving import counted, is_well
from benchmarks.paper.floors import FLOORS, tasks_of
from benchmarks.paper.grid import cell_position, entered_cells, task_cells
from benchmarks.paper.page import page_of
from benchmarks.paper.planning_cost import manhattan
from benchmarks.paper.recipe import Settings
from benchmarks.paper.reported import TABLE_1
from benchmarks.paper.runner import attempt, is_known, kept, run
from benchmarks.paper.suite import CORRIDOR, OTHERS, ROWS, WORLDS, language_for
from benchmarks.paper.task_choices import languages_in_tasks
from coordlang.execution.guided_search import ExpandedStates
from coordlang.simulation.record import EventRecord, RunRecord
from planners.joint.tables import Rows
from planners.loading import load
from planners.search.heuristics import HEURISTICS
from planners.search.plans import Plans
from planners.search.reachable import explore
from tests.support import naive
from tests.support.domains import DOMAINS, ROOT
from tests.support.task_languages import three_cells

GAME, COMMUNICATION = game.RECIPE, communication.RECIPE
QUICK = Settings(samples=2, quick=True)


def lines(folder: Path) -> dict[str, Any]:
    """The lines of a run, by key, without what depends on the clock and on the checkout."""
    found = map(json.loads, (folder / "game.jsonl").read_text().splitlines())
    clock = ("seconds", "cpu", "code")
    return {line["key"]: {k: v for k, v in line.items() if k not in clock} for line in found}


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The results of `game`, worked out in this process."""
    folder = tmp_path_factory.mktemp("finished")
    rows = kept(folder, GAME)
    for unit in GAME.units(QUICK):
        rows.keep(attempt(GAME, unit, QUICK))
    return folder


def test_a_line_says_what_it_was_made_with(finished: Path) -> None:
    found = lines(finished)
    assert set(found) == {unit.key for unit in GAME.units(QUICK)}
    for line in found.values():
        assert (line["status"], line["seed"], line["experiment"]) == ("done", 0, "game")
        assert set(line["versions"]) >= {"coordlang", "python", "numpy", "python-sat"}


@pytest.mark.thorough
def test_a_run_that_was_cut_off_goes_on(finished: Path, tmp_path: Path) -> None:
    """Two lines, in another order, and the third cut off in the middle, as a kill leaves it."""
    whole = (finished / "game.jsonl").read_text().splitlines(keepends=True)
    (tmp_path / "game.jsonl").write_text(whole[3] + whole[0] + whole[1][:50])
    run(GAME, QUICK, tmp_path, jobs=2)
    again = (tmp_path / "game.jsonl").read_text().splitlines(keepends=True)
    assert again[:2] == [whole[3], whole[0]]  # with their seconds: they were not run
    assert lines(tmp_path) == lines(finished)
    run(GAME, QUICK, tmp_path)
    assert (tmp_path / "game.jsonl").read_text() == "".join(again)


def test_limits_of_units(tmp_path: Path) -> None:
    short = replace(QUICK, limit=0.01)
    unit = COMMUNICATION.units(short)[0]
    rows = kept(tmp_path, COMMUNICATION)
    rows.keep(attempt(COMMUNICATION, unit, short))
    assert rows.rows[unit.key]["status"] == "out of time"
    assert is_known(unit, rows, short)
    assert not is_known(unit, rows, replace(short, limit=60))  # more time: tried again
    line = rows.rows[unit.key]
    for other in ({"status": "out of memory"}, {"status": "done", "result": {"absent": "a map"}}):
        rows.keep({**line, **other})
        assert not is_known(unit, rows, short)


def test_command(finished: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "game.jsonl").write_bytes((finished / "game.jsonl").read_bytes())
    common = ["--quick", "--samples", "2", "--results", str(tmp_path)]
    main(["game", *common])
    written = sorted(path.name for path in tmp_path.iterdir())
    assert written == ["evaluation.md", "game.jsonl", "game.svg"]
    page = (tmp_path / "evaluation.md").read_text()
    assert "| plan |" in page
    assert "![Proposals until accepted" in page
    with pytest.raises(SystemExit) as caught:
        main(["everything"])
    assert caught.value.code == 2
    assert "invalid choice: 'everything'" in capsys.readouterr().err


def record(**changed: Any) -> RunRecord:
    """A run that ended well, but for what is changed."""
    usual: dict[str, Any] = {
        "seed": 0,
        "collisions": 0,
        "deadlock": False,
        "late": 0,
        "messages": 3,
        "seconds": 10.0,
        "arrived": True,
        "mixes": True,
        "subplans": {},
        "steps": [],
        "events": [
            EventRecord(9.0, "stopped", ["r1"]),
            EventRecord(10.0, "arrived", ["r1"], steps={"r1": 4}, places={"r1": ["c0-0", "c0-1"]}),
        ],
        "poses": {},
        "nearest": 0.7,
    }
    return RunRecord(**usual | changed)


def test_how_runs_end_is_counted() -> None:
    found = [
        record(),
        record(late=2, nearest=0.6),
        record(arrived=False, deadlock=True, mixes=False, seconds=20.0),
        record(arrived=False, collisions=2, nearest=0.38),
    ]
    assert [is_well(run) for run in found] == [True, False, False, False]
    once = dict.fromkeys(("well", "collisions", "deadlocks", "late"), 1)
    rest = {"late_steps": 2, "messages": 12, "seconds": 50.0, "nearest": 0.38}
    assert counted(found) == {"runs": 4, **once, **rest, "mixes": 3, "agree": 2}


def test_tasks_of_floors_require_coordination() -> None:
    language, tasks = tasks_of(FLOORS["T-map, 2 robots"], 0)
    assert (len(language.words), len(tasks)) == (3, 12)
    plans = [[*Plans.of(used.space, used.task)] for used in tasks]
    assert all(any(naive.failing(own, 2)) for own in plans)


PAGE, FOLDER = ROOT / "docs" / "evaluation.md", ROOT / "docs" / "evaluation"
WHOLE = Settings(limit=180)


def test_the_page_is_what_the_results_say() -> None:
    text, sections = page_of(RECIPES, WHOLE, FOLDER, "evaluation")
    assert set(sections) == {recipe.name for recipe in RECIPES}
    assert PAGE.read_text() == text, (
        "run: python -m benchmarks.paper all --results docs/evaluation --page docs/evaluation.md"
    )


def test_the_results_are_of_a_whole_run() -> None:
    """Every unit with its default parameters, and each experiment of one state of the code."""
    for recipe in RECIPES:
        rows = kept(FOLDER, recipe)
        units = recipe.units(WHOLE)
        assert [unit.key for unit in units if not is_known(unit, rows, WHOLE)] == []
        assert set(rows.rows) == {unit.key for unit in units}
        assert len({line["code"] for line in rows.rows.values()}) == 1


def test_figures_are_small_and_self_contained() -> None:
    shown = re.findall(r"!\[[^]]+\]\(evaluation/([\w-]+\.svg)\)", PAGE.read_text())
    assert sorted(shown) == sorted(path.name for path in FOLDER.glob("*.svg"))
    assert len(shown) >= 8
    for name in shown:
        data = (FOLDER / name).read_bytes()
        assert len(data) < 300_000
        root = ElementTree.fromstring(data)
        outside = [
            value
            for element in root.iter()
            for key, value in element.attrib.items()
            if key.endswith("href") and not value.startswith("#")
        ]
        assert not outside


def test_table_1_has_the_papers_tasks_and_states() -> None:
    of = {key: line["result"] for key, line in kept(FOLDER, table1.RECIPE).rows.items()}
    for name, paper in TABLE_1.items():
        columns = ("minimal", "separating", "least alpha", "greedy")
        found = [of[f"{name}/{column}"] for column in columns]
        assert (found[-1]["tasks"], found[-1]["states"]) == (paper.tasks, paper.states)
        words = [result["words"] for result in found]
        assert words == sorted(words)
        assert all(result["verified"] for result in found)


# ---- the recipes

THOROUGH = pytest.mark.thorough


@pytest.mark.parametrize(
    "name",
    [
        name if name in ("GW1", "GW2", "GWB5", "GWB6") else pytest.param(name, marks=THOROUGH)
        for name in TABLE_1
    ],
)
def test_rows_are_the_papers(name: str) -> None:
    candidates = WORLDS[name].candidates()
    assert (candidates.count, candidates.states) == (TABLE_1[name].tasks, TABLE_1[name].states)


def test_units_have_names_of_their_own() -> None:
    assert [world.name for world in ROWS] == list(TABLE_1)
    whole = Settings()
    for settings in (Settings(quick=True), whole):
        for recipe in RECIPES:
            units = recipe.units(settings)
            assert len({unit.key for unit in units}) == len(units)
            assert {unit.experiment for unit in units} == {recipe.name}
    # Each on grids and on worlds that are none.
    for recipe in RECIPES:
        worlds = {u.parameters.get("world", u.key.split("/")[0]) for u in recipe.units(whole)}
        assert 0 < len(worlds & {w.name for w in OTHERS}) < len(worlds)


def test_expansions_on_three_cells() -> None:
    """By hand: the start, then a state after one step; from all but one of them the goal is a step
    away, and comes up next.
    """
    one = three_cells()
    terrain = ExpandedStates(one.model, one.partition)
    assert planning_cost.expansions(one, HEURISTICS["blind"], terrain) == (2, 2, 2)
    assert planning_cost.expansions(one, HEURISTICS["relaxed"], terrain) == (2, 2, 2)


def test_the_papers_bound_is_the_farthest_robots_distance() -> None:
    loaded = load(DOMAINS / "grid" / "domain.pddl", [DOMAINS / "grid" / "gwb5-3x3.pddl"])
    goal = loaded.tasks[0].goal
    space = explore(loaded.model, loaded.tasks[0].init[None, :])

    def cells(row: Rows) -> dict[str, tuple[int, int]]:
        atoms = (loaded.model.codec.facts.atoms[f] for f in loaded.model.codec.true_facts(row))
        return {atom.args[0]: cell_position(atom.args[1]) for atom in atoms}

    (ends,) = (cells(row) for row in space.rows if loaded.model.holds(goal, row[None, :])[0])
    for row, bound in zip(space.rows, manhattan(loaded.model, goal, ())(space.rows), strict=True):
        away = [abs(x - ends[r][0]) + abs(y - ends[r][1]) for r, (x, y) in cells(row).items()]
        assert bound == max(away)


def test_the_detour_is_optimal_and_nobody_else_moves_otherwise() -> None:
    candidates, language = language_for(CORRIDOR, "greedy", 0, scenario.trading_rooms())
    assert candidates.count == 36 * 36
    one = next(
        s
        for s in languages_in_tasks(language, candidates)
        if task_cells(s.space, s.task) == (scenario.START, scenario.GOAL)
    )
    found = scenario.detour(one)
    way, (agreed, other) = found["detour"], found["agreed"]
    assert scenario.PLACE in way
    assert scenario.PLACE not in agreed
    assert found["optimal"] is True
    for r1, r2 in ((agreed, other), (way, other)):
        assert (r1[0], r2[0], r1[-1], r2[-1]) == (*scenario.START, *scenario.GOAL)
        assert len(r1) == len(r2) == len(agreed)
        assert all(a != b for a, b in zip(r1, r2, strict=True))  # never in one cell
    # All parts of robot 1 through the place, by listing the plans.
    wanted = {n for n, cell in enumerate(entered_cells(one.model, 0)) if cell == scenario.PLACE}
    parts = {tuple(step[0] for step in plan) for plan in Plans.of(one.space, one.task)}
    assert found["parts"] == sum(bool(wanted & set(part)) for part in parts)
    assert 0 < found["ways"] <= found["parts_that_fit"] <= found["parts"]
