# SPDX-License-Identifier: GPL-3.0-or-later
"""Factored files: as unified-planning writes them, and in every command."""

from __future__ import annotations

import json
import os
import re
from functools import cache
from itertools import islice
from pathlib import Path
from typing import Any

import pytest

import coordlang as door
from coordlang.commands.main import COMMANDS
from tests.coordlang.commands.conftest import Shell
from tests.support import thorough
from tests.support.domains import SHARED
from tests.support.hall import factored

UNIFIED = "ma-basic", "ma-loader", "ma_buttons"
NO_TASK = {"schema", "domains", "import"}


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


@pytest.mark.parametrize(
    "name",
    [
        "hall",
        UNIFIED[1],
        *thorough(*UNIFIED[::2]),
        pytest.param("driverlog", marks=[pytest.mark.foreign, pytest.mark.thorough]),
    ],
)
def test_the_union_is_the_same_model(name: str, shell: Shell, tmp_path: Path) -> None:
    """A language built from either belongs to both, and is the same; the older hash serves, too."""
    folder = tmp_path / "files"
    if name == "driverlog":
        folder = SHARED / "foreign" / "driverlog-factored"
    elif name == "hall":
        factored(folder)
    else:
        written(name, folder)
        other = written(name, tmp_path / "one", unfactored=True)
        plans = door.plans(other / "domain.pddl", other / "problem.pddl")
        assert plans.count == door.plans(factored=folder).count
    one = "union/domain.pddl union/problem.pddl"
    out = shell(f"inspect --factored {folder} --write union --json --states").out
    assert shell(f"inspect {one} --json --states").out == out
    shown = [door.plans(*one.split()), door.plans(factored=folder)]
    assert shown[0].count == shown[1].count
    assert [*islice(shown[0], 20)] == [*islice(shown[1], 20)]
    more = ""
    try:
        door.build(factored=folder, method="greedy")
    except door.Inseparable:
        more = "--remember-actions"
    shell(f"build --factored {folder} {more} --method greedy -o factored.json")
    shell(f"build {one} {more} --method greedy -o union.json")
    read = [json.loads(Path(f"{name}.json").read_text()) for name in ("factored", "union")]
    for key in ("domain", "states", "words", "guarantee"):
        assert read[0][key] == read[1][key]
    for language in ("factored.json", "union.json"):
        shell(f"verify {language} {one}")
        shell(f"verify {language} --factored {folder}")
    older = read[0] | {"domain": {"name": read[0]["domain"]["name"]}}
    older["domain"]["sha256"] = door.load(factored=folder).domain.source.sha256
    Path("older.json").write_text(json.dumps(older))
    shell(f"verify older.json --factored {folder}")
    shell(f"verify older.json {one}", 31)


@pytest.fixture(scope="module")
def loader(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path, str, Path]:
    """Folder, language, sentence and plan of two robots that carry a load."""
    place = tmp_path_factory.mktemp("loader")
    folder = written("ma-loader", place / "files")
    language, plan = place / "l.json", place / "plan"
    door.build(factored=folder, method="greedy").language.save(language)
    plans = door.plans(factored=folder)
    plan.write_text(plans.ipc(plans[0]))
    return folder, language, door.say(language, plan=plan, factored=folder).sentence, plan


def test_every_command(loader: tuple[Path, Path, str, Path], shell: Shell) -> None:
    folder, language, sentence, plan = loader
    points = {"l1": [0, 0], "l2": [1, 0], "l3": [2, 0]}
    Path("points.json").write_text(json.dumps({"coordinates": points}))
    spoken = f"{language} '{sentence}'"
    lines = {
        "lift": "lift --jobs 1 --complexity 4 -o lifted.json",
        "build": "build -o l.json",
        "ground": "ground lifted.json -o g.json --tasks own",
        "report": f"report {language} -o page.html",
        "simulate": f"simulate {language} --coordinates points.json",
        "tasks": "tasks --start '(a_pos robot1 ?)' -o tasks.json",
        "say": f"say {language} {plan}",
        **{name: f"{name} {spoken}" for name in ("plan", "understand", "choices", "export")},
        **{name: f"{name} {language}" for name in ("verify", "explain")},
        **{name: name for name in ("inspect", "plans", "check", "coordination")},
    }
    assert {*lines} == {*COMMANDS} - NO_TASK - {"robot"}
    for line in lines.values():
        shell(f"{line} --factored {folder}")
    shell(f"robot {language} --robot robot1 --factored {folder}", 2, "for joint steps")


@pytest.mark.parametrize("name", ["say", "understand", "choices", "export"])
@pytest.mark.parametrize("files", ["", "d.pddl p.pddl w0"])
def test_what_stands_behind_the_files_is_needed(name: str, files: str, shell: Shell) -> None:
    said = "--factored DIR without DOMAIN PROBLEM"
    shell(f"{name} l.json {files} --factored DIR", 2, said)


def test_functions(loader: tuple[Path, Path, str, Path], tmp_path: Path) -> None:
    folder, language, sentence, plan = loader
    assert door.choices(language, factored=folder, sentence=sentence).covered
    with pytest.raises(door.UsageError, match="--factored names all files"):
        door.say(language, "d.pddl", "p.pddl", plan, factored=folder)
    for call in (door.understand, door.choices, door.export):
        with pytest.raises(door.UsageError, match="expected a sentence"):
            call(language, factored=folder)
    with pytest.raises(door.UsageError, match="expected a plan"):
        door.say(language, factored=folder)


def test_both_names_of_one_robot(shell: Shell) -> None:
    folder = factored(Path("hall"))
    (folder / "r1_domain.pddl").write_text((folder / "domain-r1.pddl").read_text())
    said = "two domain files of robot 'r1': domain-r1.pddl and r1_domain.pddl"
    shell("inspect --factored hall", 31, said)


def test_an_action_that_differs_in_more(shell: Shell, tmp_path: Path) -> None:
    written("ma-loader", tmp_path / "files")
    file = Path("files/robot2_domain.pddl")
    file.write_text(file.read_text().replace("   (is_connected ?l_from ?l_to)\n", ""))
    shell(
        "inspect --factored files",
        31,
        "action 'move' differs between the robots' files in more than",
        "robot2_domain.pddl:12:2",
        f"The other one is at files{os.sep}robot1_domain.pddl:12:2",
    )


@pytest.mark.parametrize("of_r2", ["(at ? ?x)", "(exists (?r - robot) (at ?r ?x))"])
def test_names_of_variables(of_r2: str, shell: Shell) -> None:
    """Variables of one character are told from the agent; what inner ones are called is free."""
    is_inner, own = "exists" in of_r2, {"r2": of_r2}
    own["r1"] = "(exists (?o - robot) (at ?o ?x))" if is_inner else "(at ?r ?x)"
    for path in factored(Path("hall")).glob("domain-*"):
        text = re.sub("go-r.", "go", path.read_text()).replace("(go ?o", "(go ?o ?o")
        text = text.replace("?x ?y - room)\n", "? - robot ?x ?y - room)\n")
        path.write_text(text.replace("(at ?r ?x) (", f"{own[path.stem[-2:]]} ("))
    said = [] if is_inner else ["action 'go' differs between the robots' files in more than"]
    shell("inspect --factored hall", 0 if is_inner else 31, *said)


def test_no_robot_gets_an_action_that_its_own_file_lacks(shell: Shell, tmp_path: Path) -> None:
    """Robots of one type, of which only the first may load."""
    for path in written("ma-loader", tmp_path / "files").iterdir():
        text = path.read_text().replace("robot1_type robot2_type - ag", "kind - ag")
        text = text.replace("robot1_type", "kind").replace("robot2_type", "kind")
        other = {"robot1": "robot2", "robot2": "robot1"}[path.name[:6]]
        text = text.replace(f"   {other} - kind\n", "")
        if path.name == "robot2_domain.pddl":
            text = text.replace("(:action load", "(:action take")
        path.write_text(text)
    said = "action 'load' is for agents such as 'robot2', whose own domain"
    shell("inspect --factored files", 31, said)
    for own, types in (("a", "b - a a"), ("b", "b")):  # only the first file says: b is an a
        head, action = f"(define (domain d) (:types {types})", f"(:action {own} :parameters"
        Path(f"domain-{own}.pddl").write_text(f"{head} {action} (?r - {own})))")
        head = f"(define (problem p) (:domain d) (:objects {own} - {own})"
        Path(f"problem-{own}.pddl").write_text(f"{head} (:goal (and)))")
    shell("inspect --factored .", 31, "action 'a' is for agents such as 'b', whose own domain")
