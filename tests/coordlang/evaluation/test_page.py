# SPDX-License-Identifier: GPL-3.0-or-later
"""docs/evaluation.md is what the results beside it say."""

from __future__ import annotations

import re
from pathlib import Path
from xml.etree import ElementTree

import pytest

from coordlang.evaluation.experiments.registry import RECIPES
from coordlang.evaluation.lab.identity import file_hash
from coordlang.evaluation.lab.page import page_text, sections, write_page
from coordlang.evaluation.lab.recipe import Settings
from coordlang.evaluation.lab.results import Line, Results, record_of
from coordlang.evaluation.material.paper import TABLE_1
from tests.support.domains import DOMAINS, ROOT

PAGE, FOLDER = ROOT / "docs" / "evaluation.md", ROOT / "docs" / "evaluation"


def all_lines() -> dict[str, list[Line]]:
    results = Results(FOLDER)
    return {name: list(results.lines(name).values()) for name in RECIPES}


def test_the_page_is_what_the_results_say() -> None:
    lines = all_lines()
    rendered = sections(
        RECIPES, {name: [record_of(line) for line in found] for name, found in lines.items()}
    )
    assert set(rendered) == set(RECIPES)
    text = page_text(
        RECIPES, [line for found in lines.values() for line in found], rendered, "evaluation"
    )
    assert PAGE.read_text() == text, (
        "run: coordlang evaluate all --results docs/evaluation --page docs/evaluation.md"
    )


def test_the_results_are_of_a_whole_run(tmp_path: Path) -> None:
    """Every piece of work with its default parameters, of the files as they are, and each
    experiment of one state of the code.
    """
    lines = all_lines()
    for name, recipe in RECIPES.items():
        wanted = [
            (unit.key, dict(unit.parameters)) for unit in recipe.units(Settings(DOMAINS, tmp_path))
        ]
        assert [(line["key"], line["parameters"]) for line in lines[name]] == wanted
        assert len({line["code"] for line in lines[name]}) == 1
    for line in (line for found in lines.values() for line in found):
        for file, digest in line["inputs"].items():
            assert file_hash(DOMAINS / file) == digest, (
                f"{file} has changed: run the evaluation again"
            )


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


@pytest.mark.parametrize(
    ("figure", "texts"),
    [
        ("communication-savings", ["paper 27.3", "communication saving (%)"]),
        ("flexibility", ["paper 12.1", "plans open to the listener"]),
        ("planning-cost", ["paper", "times fewer nodes"]),
        ("table1-words", ["paper (greedy)", "words"]),
    ],
)
def test_the_papers_values_are_drawn_in(figure: str, texts: list[str]) -> None:
    text = (FOLDER / f"{figure}.svg").read_text()
    assert all(wanted in text for wanted in texts)


def test_table_1_has_the_papers_tasks_and_states() -> None:
    of = {line["key"]: line["result"] for line in all_lines()["table1"]}
    for name, paper in TABLE_1.items():
        assert (of[f"{name}/greedy"]["tasks"], of[f"{name}/greedy"]["states"]) == (
            paper.tasks,
            paper.states,
        )
        words = [
            of[f"{name}/{column}"]["words"]
            for column in ("minimal", "separating", "least alpha", "greedy")
        ]
        assert words == sorted(words)
        assert all(
            of[f"{name}/{column}"]["verified"]
            for column in ("minimal", "separating", "least alpha", "greedy")
        )


def test_a_page_of_nothing_much(tmp_path: Path) -> None:
    """No results, no sections; a figure is drawn for those there are."""
    page = tmp_path / "page.md"
    assert write_page(RECIPES, Results(tmp_path), page) == (page,)
    assert "##" not in page.read_text()
    (tmp_path / "game.jsonl").write_bytes((FOLDER / "game.jsonl").read_bytes())
    assert [path.name for path in write_page(RECIPES, Results(tmp_path), page)] == [
        "page.md",
        "game.svg",
    ]
    first = (tmp_path / "game.svg").read_bytes()
    write_page(RECIPES, Results(tmp_path), page)
    assert (tmp_path / "game.svg").read_bytes() == first  # the same results, the same bytes
