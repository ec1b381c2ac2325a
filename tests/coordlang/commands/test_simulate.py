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

import coordlang
from coordlang.simulation.record import read_simulation
from coordlang.simulation.simulator import Simulator
from tests.coordlang.commands.conftest import FILES, Shell
from tests.support.command import Outcome


@pytest.fixture
def simulate(language: Path, shell: Shell) -> Shell:
    """The command with a language of the T."""

    def call(line: str, code: int = 0, *said: str) -> Outcome:
        return shell(f"simulate {language} T-MAP {line}", code, *said)

    return call


def test_json_has_what_is_promised(simulate: Shell) -> None:
    data = json.loads(simulate("--runs 2 --seed 3 --json -o runs.json").out)
    assert [one["seed"] for one in data["runs"]] == [3, 4]
    for one in data["runs"]:
        counts = (one["collisions"], one["deadlock"], one["late"], one["messages"])
        assert counts == (0, False, 0, 0)
        assert one["seconds"] > 0
    assert json.loads(Path("runs.json").read_text()) == data
    assert read_simulation("runs.json").agreement == "sentence"
    assert simulate("--step barrier").out == (
        "1 run: all arrived in 1, collisions in 0, deadlock in 0, late in 0; 8 messages\n"
    )


@pytest.mark.parametrize(
    ("line", "code", "message"),
    [
        ("--without --plan", 2, "exclude each other"),
        ("--sentence w9", 31, "is no word of this language"),
        ("--prefer visit:r1", 2, "expected visit:ROBOT:STEP:PLACE"),
        ("--prefer visit:r1:0:nowhere", 2, "no atom says"),
        ("--prefer nothing", 2, "there is no such preference"),
        ("--prefer shortest --sentence w0", 2, "chooses a sentence"),
        ("--prefer first:r1 --plan", 2, "chooses a sentence"),
        ("--noise nan", 2, "expected a share"),
        ("--time-limit 0.01", 23, "time limit"),
    ],
)
def test_errors(line: str, code: int, message: str, simulate: Shell) -> None:
    simulate(line, code, message)


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("language.json", "expected LANGUAGE DOMAIN PROBLEM"),
        ("--replay runs.json language.json", "--replay RECORD alone"),
        ("--replay runs.json -o run.txt", "End the name in .json, .gif, .mp4, .png"),
        ("--replay runs.json -o no/run.gif", "cannot be written"),
        ("--replay runs.json -o a.gif -o a.gif", "name the same file"),
    ],
)
def test_usage(line: str, message: str, shell: Shell) -> None:
    shell(f"simulate {line}", 2, message)


@pytest.mark.thorough
def test_a_time_limit_keeps_the_runs_that_are_done(simulate: Shell) -> None:
    simulate("")  # everything is loaded
    outcome = simulate("--runs 1000 --time-limit 1 --json", 3, "of 1000 done")
    assert 0 < len(json.loads(outcome.out)["runs"]) < 1000


def test_a_limit_while_the_world_is_made_is_no_line_on_stdout(
    simulate: Shell, monkeypatch: pytest.MonkeyPatch
) -> None:
    simulate("")  # ir-sim is loaded as the command does it
    from irsim.env import env_base
    from loguru import logger

    class Ringing(env_base.EnvConfig):  # type: ignore[misc]
        """The alarm rings while the file is read, where ir-sim prints what is raised."""

        worlds = 0

        def __init__(self, *arguments: object, **keywords: object) -> None:
            Ringing.worlds += 1
            if Ringing.worlds == 3:
                os.kill(os.getpid(), signal.SIGALRM)
            super().__init__(*arguments, **keywords)

    monkeypatch.setattr(env_base, "EnvConfig", Ringing)
    outcome = simulate("--runs 9 --time-limit 600 --json", 3)
    assert len(json.loads(outcome.out)["runs"]) == 2
    sinks = logger._core.handlers  # type: ignore[attr-defined]
    assert not sinks, "the collector would remove it, perhaps while the next world adds one"


def test_an_interrupt_keeps_the_runs_that_are_done(
    simulate: Shell, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(*arguments: Any) -> object:
        if arguments[3] == 2:
            raise KeyboardInterrupt
        return Simulator(*arguments)

    monkeypatch.setattr("coordlang.simulation.run.Simulator", interrupted)
    simulate("--runs 9 -o runs.json", 130, "interrupted; 2 runs of 9 done")
    assert [one.seed for one in read_simulation("runs.json").runs] == [0, 1]


def test_a_record_is_drawn_again(simulate: Shell, shell: Shell) -> None:
    """And the same seed gives the same run."""
    simulate("--runs 2 -o runs.json")
    simulate("--seed 1 -o sheet.png")
    out = shell("simulate --replay runs.json --seed 1 -o again.png --json").out
    assert json.loads(out) == json.loads(Path("runs.json").read_text())
    sheet = Path("sheet.png").read_bytes()
    assert Path("again.png").read_bytes() == sheet
    shell("simulate --replay runs.json --seed 5 -o again.png", 2, "there is no run with seed 5")
    assert Path("again.png").read_bytes() == sheet


def test_wishes_choose_the_sentence(simulate: Shell, language: Path) -> None:
    best = coordlang.plan(language, *FILES["T-MAP"], prefer="first:r1").sentence
    data = json.loads(simulate("--prefer first:r1 --json").out)
    assert data["sentence"] == best != json.loads(simulate("--json").out)["sentence"]


def test_robots_are_as_large_as_the_places_allow(shell: Shell) -> None:
    shell("build CELLS --method greedy -o language.json")
    for apart, radius in ((0.8, 0.2), (0.5, 0.125)):
        places = {"a": [0, 0], "b": [apart, 0], "c": [apart / 2, apart]}
        Path("points.json").write_text(json.dumps({"coordinates": places}))
        shell("simulate language.json CELLS --coordinates points.json -o run.json")
        assert read_simulation("run.json").radius == pytest.approx(radius)
    Path("points.json").write_text(Path("points.json").read_text().replace("0.5", "0.2"))
    shell("simulate language.json CELLS --coordinates points.json", 2, "too small")


def test_without_the_extra_it_says_what_to_install(
    simulate: Shell, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in [name for name in sys.modules if name.split(".")[0] == "irsim"]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "irsim", None)
    simulate("", 2, "pip install 'coordlang[sim]'")
