# SPDX-License-Identifier: GPL-3.0-or-later
"""``coordlang simulate``: its output, its errors, and what is kept when it is stopped."""

from __future__ import annotations

import json
import os
import signal
import sys
from pathlib import Path
from typing import Any

import pytest

import coordlang.simulation.run as simulation_run
from coordlang.simulation.record import RunRecord, read_simulation
from tests.support.command import Command
from tests.support.domains import DOMAINS

T_MAP = (DOMAINS / "t-map" / "domain.pddl", DOMAINS / "t-map" / "problem.pddl")


@pytest.fixture(scope="module")
def language(tmp_path_factory: pytest.TempPathFactory) -> Path:
    import coordlang

    path = tmp_path_factory.mktemp("simulate") / "language.json"
    coordlang.build(*T_MAP, method="minimal").language.save(path)
    return path


def test_json_has_what_is_promised(language: Path, coordlang: Command, tmp_path: Path) -> None:
    record = tmp_path / "runs.json"
    outcome = coordlang(
        "simulate", language, *T_MAP, "--runs", "2", "--seed", "3", "--json", "-o", record
    )
    assert outcome.code == 0, outcome.err
    data = json.loads(outcome.out)
    assert [one["seed"] for one in data["runs"]] == [3, 4]
    for one in data["runs"]:
        assert (one["collisions"], one["deadlock"], one["late"], one["messages"]) == (
            0,
            False,
            0,
            0,
        )
        assert one["seconds"] > 0
    assert json.loads(record.read_text()) == data
    assert read_simulation(record).agreement == "sentence"


def test_a_summary_for_people(language: Path, coordlang: Command) -> None:
    outcome = coordlang("simulate", language, *T_MAP, "--step", "barrier")
    assert outcome.out == (
        "1 run: all arrived in 1, collisions in 0, deadlock in 0, late in 0; 8 messages\n"
    )


@pytest.mark.parametrize(
    ("arguments", "code", "message"),
    [
        (("--without", "--plan"), 2, "exclude each other"),
        (("--sentence", "w9"), 31, "is no word of this language"),
        (("--radius", "0.4"), 2, "too large"),
        (("--radius", "0.05"), 2, "pass through each other unseen"),
        (("--cell", "0.3"), 2, "too small"),
        (("--cell", "-1"), 2, "above 0"),
        (("--human", "nowhere"), 2, "there is no such place"),
        (("--human", "random", "--no-lidar"), 2, "no robot sees"),
        (("--visit", "r1"), 2, "expected ROBOT:STEP:PLACE"),
        (("--visit", "r1:0:nowhere"), 2, "no atom says"),
        (("--noise", "nan"), 2, "expected a share"),
        (("--time-limit", "0.01"), 23, "time limit"),
    ],
)
def test_errors(
    arguments: tuple[str, ...], code: int, message: str, language: Path, coordlang: Command
) -> None:
    outcome = coordlang("simulate", language, *T_MAP, *arguments)
    assert outcome.code == code
    assert message in outcome.err


def test_a_time_limit_keeps_the_runs_that_are_done(language: Path, coordlang: Command) -> None:
    coordlang("simulate", language, *T_MAP)  # everything is loaded
    outcome = coordlang(
        "simulate", language, *T_MAP, "--runs", "1000", "--time-limit", "2", "--json"
    )
    assert outcome.code == 3
    assert 0 < len(json.loads(outcome.out)["runs"]) < 1000
    assert "of 1000 done" in outcome.err


def test_a_limit_while_the_world_is_made_is_no_line_on_stdout(
    language: Path, coordlang: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    from irsim.env import env_base

    class Ringing(env_base.EnvConfig):  # type: ignore[misc]
        """The alarm rings while the file is read, where ir-sim prints what is raised."""

        worlds = 0

        def __init__(self, *arguments: object, **keywords: object) -> None:
            Ringing.worlds += 1
            if Ringing.worlds == 3:
                os.kill(os.getpid(), signal.SIGALRM)
            super().__init__(*arguments, **keywords)

    monkeypatch.setattr(env_base, "EnvConfig", Ringing)
    outcome = coordlang(
        "simulate", language, *T_MAP, "--runs", "9", "--time-limit", "600", "--json"
    )
    assert outcome.code == 3
    assert len(json.loads(outcome.out)["runs"]) == 2


def test_an_interrupt_keeps_the_runs_that_are_done(
    language: Path, coordlang: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run = simulation_run.run

    def interrupted(*arguments: Any) -> RunRecord:
        if arguments[3] == 2:
            raise KeyboardInterrupt
        return run(*arguments)

    monkeypatch.setattr(simulation_run, "run", interrupted)
    record = tmp_path / "runs.json"
    outcome = coordlang("simulate", language, *T_MAP, "--runs", "9", "-o", record)
    assert outcome.code == 130
    assert "interrupted; 2 runs of 9 done" in outcome.err
    assert [one.seed for one in read_simulation(record).runs] == [0, 1]


def test_a_record_is_drawn_again(language: Path, coordlang: Command, tmp_path: Path) -> None:
    record, sheet, again = (tmp_path / name for name in ("runs.json", "sheet.png", "again.png"))
    options = ("--runs", "2", "--shown", "1", "-o", record, "-o", sheet)
    assert coordlang("simulate", language, *T_MAP, *options).code == 0
    replayed = coordlang("simulate", "--replay", record, "--shown", "1", "-o", again, "--json")
    assert replayed.code == 0
    assert json.loads(replayed.out) == json.loads(record.read_text())
    assert again.read_bytes() == sheet.read_bytes()
    assert coordlang("simulate", "--replay", record, "--shown", "5", "-o", again).code == 2
    assert again.read_bytes() == sheet.read_bytes()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("language.json",), "expected LANGUAGE DOMAIN PROBLEM"),
        (("--replay", "runs.json", "language.json"), "--replay RECORD alone"),
        (("--replay", "runs.json", "-o", "run.txt"), "End the name in .json, .gif, .mp4, .png"),
        (("--replay", "runs.json", "-o", "no/run.gif"), "cannot be written"),
        (("--replay", "runs.json", "-o", "a.gif", "-o", "a.gif"), "name the same file"),
    ],
)
def test_usage(arguments: tuple[str, ...], message: str, coordlang: Command) -> None:
    outcome = coordlang("simulate", *arguments)
    assert outcome.code == 2
    assert message in outcome.err


def test_places_need_coordinates(coordlang: Command, tmp_path: Path) -> None:
    files = (DOMAINS / "three-cells" / "domain.pddl", DOMAINS / "three-cells" / "problem.pddl")
    language = tmp_path / "language.json"
    assert coordlang("build", *files, "--method", "greedy", "-o", language).code == 0
    outcome = coordlang("simulate", language, *files)
    assert outcome.code == 31
    assert "--coordinates" in outcome.err
    points = tmp_path / "points.json"
    points.write_text('{"coordinates": {"a": [0, 0], "b": [1, 0], "c": [0.5, 0.87]}}')
    assert coordlang("simulate", language, *files, "--coordinates", points).code == 0


def test_without_the_extra_it_says_what_to_install(
    language: Path, coordlang: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in [name for name in sys.modules if name.split(".")[0] == "irsim"]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "irsim", None)
    outcome = coordlang("simulate", language, *T_MAP)
    assert outcome.code == 2
    assert "pip install 'coordlang[sim]'" in outcome.err
