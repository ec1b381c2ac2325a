# SPDX-License-Identifier: GPL-3.0-or-later
"""docs/evaluation.md is what the results beside it say."""

from __future__ import annotations

import re
from xml.etree import ElementTree

from benchmarks.paper import table1
from benchmarks.paper.__main__ import RECIPES
from benchmarks.paper.page import page_of
from benchmarks.paper.recipe import Settings
from benchmarks.paper.reported import TABLE_1
from benchmarks.paper.runner import is_known, kept
from tests.support.domains import ROOT

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
