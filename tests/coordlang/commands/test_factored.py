# SPDX-License-Identifier: GPL-3.0-or-later
"""Factored files: as unified-planning writes them, and in every command."""

from __future__ import annotations

import json
import os
from functools import cache
from pathlib import Path
from typing import Any

import pytest

import coordlang as door
from coordlang.commands.main import COMMANDS
from tests.support.command import Command
from tests.support.domains import SHARED
from tests.support.hall import factored

UNIFIED = "ma-basic", "ma-loader", "ma_buttons"
DRIVERLOG = SHARED / "foreign" / "driverlog-factored"
NO_TASK = {"schema", "domains"}


@cache
def _examples() -> dict[str, Any]:
    from unified_planning.test.examples import multi_agent

    found: dict[str, Any] = multi_agent.get_example_problems()
    return found


def written(name: str, folder: Path, *, unfactored: bool = False) -> Path:
    """An example of unified-planning in its own writer's files."""
    from unified_planning.io import MAPDDLWriter

    writer = MAPDDLWriter(_examples()[name].problem, unfactored=unfactored)
    writer.write_ma_domain(str(folder))
    writer.write_ma_problem(str(folder))
    return folder


def unfactored_count(name: str, folder: Path) -> int:
    """Optimal plans of the same example in the writer's other form."""
    place = written(name, folder, unfactored=True)
    return door.plans(place / "domain.pddl", place / "problem.pddl").count


@pytest.mark.parametrize("name", ["ma-basic", "ma-loader"])
def test_files_of_unified_planning(name: str, coordlang: Command, tmp_path: Path) -> None:
    folder = written(name, tmp_path / "factored")
    assert all(file.endswith(("_domain.pddl", "_problem.pddl")) for file in os.listdir(folder))
    outcome = coordlang("plans", "--factored", folder, "--count")
    assert (outcome.code, int(outcome.out)) == (0, unfactored_count(name, tmp_path / "one"))


def test_an_action_of_several_robots_is_one(coordlang: Command, tmp_path: Path) -> None:
    """Its parameter is called ?robot1 and has the type robot1_type in one file, 2 in the other."""
    folder = written("ma-loader", tmp_path / "factored")
    loaded = door.load(factored=folder)
    assert [schema.name for schema in loaded.domain.schemas] == ["move", "load", "unload"]
    agents = [schema.parameters[0].types for schema in loaded.domain.schemas]
    assert agents == [("robot1_type", "robot2_type")] * 3
    assert loaded.model.robots == ("robot1", "robot2")


def _union(folder: Path, tmp_path: Path, coordlang: Command) -> None:
    one = tmp_path / "union"
    first = coordlang("inspect", "--factored", folder, "--write", one, "--json", "--states")
    assert first.code == 0
    files = one / "domain.pddl", one / "problem.pddl"
    assert coordlang("inspect", *files, "--json", "--states").out == first.out
    shown = [door.plans(*files), door.plans(factored=folder)]
    assert shown[0].count == shown[1].count
    assert shown[0].first(20) == shown[1].first(20)
    _one_language(folder, files, tmp_path, coordlang)


def _one_language(
    folder: Path, files: tuple[Path, Path], tmp_path: Path, coordlang: Command
) -> None:
    """A language built from either belongs to both, and is the same; one with the older hash too."""
    factored, union = tmp_path / "factored.json", tmp_path / "union.json"
    inseparable = (
        coordlang("build", "--factored", folder, "--method", "greedy", "-o", factored).code == 11
    )
    more = ("--remember-actions",) if inseparable else ()
    assert coordlang("build", "--factored", folder, *more, "-o", factored).code == 0
    assert coordlang("build", *files, *more, "-o", union).code == 0
    read = [json.loads(path.read_text()) for path in (factored, union)]
    for key in ("domain", "states", "words", "guarantee"):
        assert read[0][key] == read[1][key]
    for language in (factored, union):
        assert coordlang("verify", language, *files).code == 0
        assert coordlang("verify", language, "--factored", folder).code == 0
    older = read[0] | {"domain": {"name": read[0]["domain"]["name"]}}
    older["domain"]["sha256"] = door.load(factored=folder).domain.source.sha256
    factored.write_text(json.dumps(older))
    assert coordlang("verify", factored, "--factored", folder).code == 0
    assert coordlang("verify", factored, *files).code == 31


@pytest.mark.parametrize("name", UNIFIED)
def test_the_union_is_the_same_model(name: str, coordlang: Command, tmp_path: Path) -> None:
    _union(written(name, tmp_path / "factored"), tmp_path, coordlang)


def test_the_union_of_the_hall(coordlang: Command, tmp_path: Path) -> None:
    _union(factored(tmp_path / "hall"), tmp_path, coordlang)


@pytest.mark.foreign
@pytest.mark.skipif(not SHARED.is_dir(), reason=f"no inputs of others here: {SHARED}")
def test_the_union_of_driverlog(coordlang: Command, tmp_path: Path) -> None:
    _union(DRIVERLOG, tmp_path, coordlang)


@pytest.fixture(scope="module")
def loader(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path, str, Path]:
    """Folder, language, sentence and plan of two robots that carry a load."""
    place = tmp_path_factory.mktemp("loader")
    folder = written("ma-loader", place / "files")
    language, plan = place / "l.json", place / "plan"
    door.build(factored=folder, method="greedy").language.save(language)
    plans = door.plans(factored=folder)
    plan.write_text(plans.ipc(plans.first(1)[0]))
    return folder, language, door.say(language, plan=plan, factored=folder).sentence, plan


@pytest.mark.parametrize("name", sorted(set(COMMANDS) - NO_TASK - {"lift"}))
def test_every_command(
    name: str, loader: tuple[Path, Path, str, Path], coordlang: Command, tmp_path: Path
) -> None:
    folder, language, sentence, plan = loader
    points = tmp_path / "points.json"
    before: dict[str, tuple[object, ...]] = {
        "say": (language, plan),
        "ground": (tmp_path / "lifted.json",),
        "plan": (language, sentence),
        **dict.fromkeys(("understand", "choices", "export"), (language, sentence)),
        **dict.fromkeys(("verify", "explain", "report", "simulate"), (language,)),
    }
    output = {
        "build": ("-o", tmp_path / "l.json"),
        "ground": ("-o", tmp_path / "l.json", "--tasks", "own"),
        "report": ("-o", tmp_path / "page.html"),
        "simulate": ("--coordinates", points),
        "tasks": ("--start", "(a_pos robot1 ?)", "-o", tmp_path / "tasks.json"),
    }
    points.write_text('{"coordinates": {"l1": [0, 0], "l2": [1, 0], "l3": [2, 0]}}')
    if name == "ground":
        lift = ("lift", "--factored", folder, "--jobs", 1, "-o", tmp_path / "lifted.json")
        assert coordlang(*lift).code == 0
    arguments = (*before.get(name, ()), "--factored", folder, *output.get(name, ()))
    outcome = coordlang(name, *arguments)
    assert outcome.code == 0, outcome.err


@pytest.mark.parametrize("name", ["say", "understand", "choices", "export"])
def test_what_stands_behind_the_files_is_needed(name: str, coordlang: Command) -> None:
    outcome = coordlang(name, "l.json", "--factored", "DIR")
    assert (outcome.code, "--factored DIR without DOMAIN PROBLEM" in outcome.err) == (2, True)
    outcome = coordlang(name, "l.json", "d.pddl", "p.pddl", "w0", "--factored", "DIR")
    assert (outcome.code, "--factored DIR without DOMAIN PROBLEM" in outcome.err) == (2, True)


def test_functions(loader: tuple[Path, Path, str, Path], tmp_path: Path) -> None:
    folder, language, sentence, plan = loader
    assert door.understand(language, factored=folder, sentence=sentence).sentence == sentence
    assert door.plan(language, factored=folder, sentence=sentence).sentence == sentence
    assert door.plan(language, factored=folder, prefer="shortest").covered
    assert door.choices(language, factored=folder, sentence=sentence, check=True).covered
    assert door.export(language, factored=folder, sentence=sentence).covered
    assert door.explain(language, factored=folder).covered
    assert door.verify(language, factored=folder)
    with pytest.raises(door.UsageError, match="--factored names all files"):
        door.say(language, "d.pddl", "p.pddl", plan, factored=folder)
    for call in (door.understand, door.choices, door.export):
        with pytest.raises(door.UsageError, match="expected a sentence"):
            call(language, factored=folder)
    with pytest.raises(door.UsageError, match="expected a plan"):
        door.say(language, factored=folder)


def test_both_names_of_one_robot(coordlang: Command, tmp_path: Path) -> None:
    folder = factored(tmp_path / "hall")
    (folder / "r1_domain.pddl").write_text((folder / "domain-r1.pddl").read_text())
    outcome = coordlang("inspect", "--factored", folder)
    assert outcome.code == 31
    assert "two domain files of robot 'r1': domain-r1.pddl and r1_domain.pddl" in outcome.err


def test_an_action_that_differs_in_more(coordlang: Command, tmp_path: Path) -> None:
    folder = written("ma-loader", tmp_path / "factored")
    file = folder / "robot2_domain.pddl"
    file.write_text(file.read_text().replace("   (is_connected ?l_from ?l_to)\n", ""))
    outcome = coordlang("inspect", "--factored", folder)
    assert outcome.code == 31
    assert "action 'move' differs between the robots' files in more than" in outcome.err
    assert "robot2_domain.pddl:12:2" in outcome.err
    assert f"The other one is at {folder}{os.sep}robot1_domain.pddl:12:2" in outcome.err


def test_no_robot_gets_an_action_that_its_own_file_lacks(
    coordlang: Command, tmp_path: Path
) -> None:
    """Robots of one type, of which only the first may load."""
    folder = written("ma-loader", tmp_path / "factored")
    for path in folder.iterdir():
        text = path.read_text().replace("robot1_type robot2_type - ag", "kind - ag")
        text = text.replace("robot1_type", "kind").replace("robot2_type", "kind")
        own, other = path.name[:6], {"robot1": "robot2", "robot2": "robot1"}[path.name[:6]]
        text = text.replace(f"   {other} - kind\n", "")
        if path.name == "robot2_domain.pddl":
            text = text.replace("(:action load", "(:action take")
        path.write_text(text)
        assert own in text
    outcome = coordlang("inspect", "--factored", folder)
    assert outcome.code == 31
    assert "action 'load' is for agents such as 'robot2', whose own domain" in outcome.err


def test_write_beside_inputs(coordlang: Command, t_map: tuple[Path, Path], tmp_path: Path) -> None:
    outcome = coordlang("inspect", *t_map, "--write", t_map[0].parent)
    assert (outcome.code, "would overwrite an input file" in outcome.err) == (2, True)
    outcome = coordlang("inspect", *t_map, "--write", tmp_path / "new", "--json")
    assert (outcome.code, json.loads(outcome.out)["robots"]) == (0, ["r1", "r2"])
    again = coordlang("inspect", tmp_path / "new/domain.pddl", tmp_path / "new/problem.pddl")
    assert again.out == coordlang("inspect", *t_map).out
