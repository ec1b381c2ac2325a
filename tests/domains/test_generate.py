# SPDX-License-Identifier: GPL-3.0-or-later
"""The generator: what is shipped is what it writes, the command, and problems of any size."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import families
import pytest
from generate import main

from planners.loading import load
from planners.search.optimal_plans import search
from tests.support.domains import DOMAINS
from tests.support.texts import model_of

#: The folders that the generator writes; the other worlds are written by hand.
MAPS = ("grid", "grid-joint", "three-cells", "t-map", "corridor")
#: What people write in them; everything else there comes from the generator.
BY_HAND = {
    "README.md",
    "generate.py",
    "gridmap.py",
    "picture.py",
    "grid/domain.pddl",
    "grid-joint/domain.pddl",
    "t-map/t-map.map",
    "t-map/t-map.scen",
    "corridor/corridor.map",
    "corridor/rooms.tasks.json",
    *(f"{folder}/README.md" for folder in MAPS),
}


def files(folder: Path) -> dict[str, bytes]:
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
        and not any(part.startswith((".", "__")) for part in path.relative_to(folder).parts)
    }


def test_the_shipped_files_are_what_the_generator_writes(tmp_path: Path) -> None:
    # In a process of its own with another hash seed: the order of sets must not show.
    command = [sys.executable, str(DOMAINS / "generate.py"), "all", "--into", str(tmp_path)]
    subprocess.run(command, check=True, env={**os.environ, "PYTHONHASHSEED": "77"})
    ours = {name: data for name, data in files(DOMAINS).items() if name.split("/")[0] in MAPS}
    shipped = {name: data for name, data in ours.items() if name not in BY_HAND}
    written = files(tmp_path)
    assert sorted(written) == sorted(shipped)
    assert [name for name in written if written[name] != shipped[name]] == []


@pytest.mark.parametrize(("style", "domain"), [("agents", "grid"), ("joint", "grid-joint")])
def test_one_problem_with_everything(tmp_path: Path, style: str, domain: str) -> None:
    problem, picture, tasks = (tmp_path / name for name in ("p.pddl", "p.svg", "t.json"))
    outputs = ["-o", str(problem), "--picture", str(picture), "--tasks", str(tasks)]
    assert main(["ring", "2x3", "--style", style, "--at-least", "3", *outputs]) == 0
    loaded = load(DOMAINS / domain / "domain.pddl", [problem])
    assert loaded.model.codec.decode(loaded.tasks[0].init) == ["(at r1 c0-0)", "(at r2 c1-2)"]
    assert ElementTree.parse(picture).getroot().tag.endswith("svg")
    # Only corners are 3 apart: 4 pairs for one robot, 5 * 5 places for the other; both far: 4 * 3.
    # 2 * 100 - 12.
    assert len(json.loads(tasks.read_text())["tasks"]) == 188


def test_a_problem_from_a_map_on_stdout(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    path = DOMAINS / "t-map" / "t-map.map"
    ends = ["--starts", "c0-1", "c1-0", "--goals", "c1-0", "c0-1"]
    assert main(["map", str(path), *ends, "--domain", "t-map"]) == 0
    assert capsys.readouterr().out == (DOMAINS / "t-map" / "problem.pddl").read_text()


@pytest.mark.parametrize(
    ("arguments", "code", "message"),
    [
        (["open", "2x2", "--robots", "5"], 2, "cannot place 5 robots on 4 cells"),
        (["open", "2x2", "--robots", "0"], 2, "cannot place 0 robots"),
        (["open", "2x2", "--starts", "c0-0"], 2, "2 robots need 2 start cells, not 1"),
        (["open", "2x2", "--starts", "c0-0", "c9-9"], 2, "no start cell 'c9-9'"),
        (["open", "2x2", "--goals", "c0-0", "c0-0"], 2, "the same goal cell"),
        (["open", "2x2", "--robots", "3", "--style", "joint"], 2, "for two robots"),
        (["map", "no/such.map"], 31, "no/such.map: there is no such file"),
        (["open", "2x2", "-o", "no/such/folder/p.pddl"], 31, "cannot write no/such/folder/p.pddl"),
    ],
)
def test_errors_of_the_command(
    capsys: pytest.CaptureFixture[str], arguments: list[str], code: int, message: str
) -> None:
    assert main(arguments) == code
    captured = capsys.readouterr()
    assert message in captured.err
    assert captured.out == ""


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
    loaded = model_of((DOMAINS / folder / "domain.pddl").read_text(), text)
    assert len(loaded.model.robots) == robots
    space = search(loaded.model, loaded.tasks[0])
    assert space.cost_of(0)[0] == steps
