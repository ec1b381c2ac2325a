# SPDX-License-Identifier: GPL-3.0-or-later
"""Recipes of the paper's experiments and their runs: what is known is not run again, limits, interrupts."""

from __future__ import annotations

import json
import re
from collections import defaultdict
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest

import coordlang
from benchmarks import frame
from benchmarks.frame import KeptRows, asked_for, run_python
from benchmarks.paper import communication, game, table1
from benchmarks.paper.__main__ import RECIPES, main
from benchmarks.paper.disruptions import Trial, warehouse_trials
from benchmarks.paper.floors import FLOORS, tasks_of
from benchmarks.paper.page import page_of
from benchmarks.paper.recipe import Settings
from benchmarks.paper.reported import TABLE_1
from benchmarks.paper.runner import attempt, is_known, kept, run
from benchmarks.paper.suite import OTHERS, ROWS, language_for
from benchmarks.paper.task_choices import sentence_of
from benchmarks.paper.warehouse import WAREHOUSES, deliveries, listed_tasks
from planners.search.plans import Plans
from tests.support import naive
from tests.support.domains import ROOT

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
        said = [pair for element in ElementTree.fromstring(data).iter() for pair in element.items()]
        assert all(value.startswith("#") for key, value in said if key.endswith("href"))


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


@pytest.mark.thorough
def test_a_sentence_may_succeed_of_which_no_plan_does() -> None:
    """What the robots choose is an optimal plan, but may have another sentence."""
    world, rows, columns = WAREHOUSES["open 3x3"]
    every = deliveries(rows, columns, "across")
    trials = warehouse_trials(*language_for(world, "minimal", 0, listed_tasks(every)), every)
    used, said = trials.languages[15], defaultdict(list)
    for plan in Plans.of(used.space, 15):
        parts = zip(zip(*plan, strict=True), trials.disruptions[3].forbidden, strict=True)
        said[sentence_of(used, plan)].append([own.isdisjoint(part) for part, own in parts])
    good = [len(spared) for spared in said.values() if all(map(any, zip(*spared, strict=True)))]
    exact = replace(trials, trials=(Trial((15,), 3),)).exact()
    assert (exact or {})["sentence"] == round(sum(good) / sum(map(len, said.values())), 6)


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


# ---- what benchmarks share

NAMES = ("depot/pfile1", "depot/pfile13", "depot/pfile3", "taxi/p01")


@pytest.mark.parametrize(
    ("given", "rows"),
    [
        *(([], NAMES), (["depot/pfile1"], NAMES[:1]), (["depot/pfile"], NAMES[:3])),
        *((["depot/pfile3", "depot/pfile1"], NAMES[:3:2]), (["depot/pfile1", "depot"], NAMES[:3])),
        *((["taxi", "depot/pfile1"], NAMES[::3]), (["rovers"], ())),
    ],
)
def test_a_name_is_that_row_and_a_beginning_is_every_row_it_begins(
    given: list[str], rows: tuple[str, ...]
) -> None:
    assert asked_for(NAMES, given) == [*rows]


def test_what_is_missing_is_said(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    assert frame.project(tmp_path) == coordlang.__version__
    asked_for(NAMES, ["rovers", "taxi"])
    assert capsys.readouterr().err == "no row is called rovers, or begins so\n"
    monkeypatch.setattr(frame, "SHARED", tmp_path)
    with pytest.raises(SystemExit, match="codmap is missing"):
        frame.shared("codmap")
    with pytest.raises(SystemExit, match="there is no folder"):
        KeptRows(tmp_path / "none" / "rows.jsonl")


def test_rows_are_measured_once_and_a_line_that_was_cut_off_again(tmp_path: Path) -> None:
    path, measured = tmp_path / "rows.jsonl", []

    def measure(name: str) -> dict[str, object]:
        measured.append(name)
        return {"row": name, "n": len(measured)}

    kept = KeptRows(path)
    assert [kept.get(name, lambda: measure("a"))["n"] for name in "aa"] == [1, 1]
    kept.get("b", lambda: measure("b"))
    whole = path.read_text()
    path.write_text(whole[:-5])
    again = KeptRows(path)
    assert list(again.rows) == ["a"]
    again.get("b", lambda: {"row": "b", "n": 2})
    assert path.read_text() == whole
    assert KeptRows(path).rows == kept.rows


@pytest.mark.thorough
def test_processes_end_at_their_limits() -> None:
    done = run_python(("-c", "print('{\"n\": 1}')"))
    assert (done.data, done.code) == ({"n": 1}, 0)
    assert run_python(("-c", "while True: pass"), cpu=1).why == "no time"
    assert run_python(("-c", "import time; time.sleep(60)"), most=0.2).why == "no time"
    assert run_python(("-c", "bytearray(9 << 30)"), cpu=60).why == "no memory"
