# SPDX-License-Identifier: GPL-3.0-or-later
"""With --json an error is one JSON object on stdout, and its text stands on stderr as ever."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import jsonschema
import pytest

from coordlang.commands.failure import wants_json
from coordlang.commands.schema import json_schema
from planners.system.errors import OutOfTime
from tests.support.command import Command, Outcome

T_MAP = Path(__file__).resolve().parents[3] / "domains" / "t-map"


def error(outcome: Outcome) -> dict[str, Any]:
    assert outcome.out.count("\n") == 1
    data = json.loads(outcome.out)
    jsonschema.validate(data, json_schema())
    found: dict[str, Any] = data["error"]
    assert found["exit_code"] == outcome.code
    return found


def test_bad_input(coordlang: Command, t_map: tuple[Path, Path], tmp_path: Path) -> None:
    problem = tmp_path / "p.pddl"
    problem.write_text(t_map[1].read_text().replace("(:goal (and", "(:goal (und"))
    outcome = coordlang("plans", t_map[0], problem, "--json")
    found = error(outcome)
    assert (outcome.code, found["position"]["file"]) == (31, str(problem))
    place = found["position"]
    assert outcome.err == (
        f"coordlang: {place['file']}:{place['line']}:{place['column']}: {found['message']}\n"
        f"  {found['remedy']}\n"
    )
    without = coordlang("plans", t_map[0], problem)
    assert (without.out, without.err, without.code) == ("", outcome.err, outcome.code)


@pytest.mark.parametrize(
    "arguments", [("inspect",), ("plans", "--count"), ("check",), ("coordination",)]
)
def test_a_missing_file(arguments: tuple[str, ...], coordlang: Command) -> None:
    found = error(coordlang(*arguments, T_MAP / "domain.pddl", "none.pddl", "--json"))
    assert found["message"] == "there is no such file"
    assert found["position"] == {"file": "none.pddl", "line": None, "column": None}


def test_usage(coordlang: Command, t_map: tuple[Path, Path]) -> None:
    outcome = coordlang("plans", "--json", "--max", "x", *t_map)
    found = error(outcome)
    assert (outcome.code, found["position"]) == (2, None)
    assert found["message"].startswith("Invalid value for '--max': 'x' is not a valid integer")
    assert found["remedy"] == "See `coordlang plans --help`."
    assert error(coordlang("plains", "--json"))["remedy"] == "See `coordlang --help`."


def test_refuted_and_impossible(
    coordlang: Command, t_map: tuple[Path, Path], language: Path
) -> None:
    found = error(coordlang("understand", language, *t_map, "w9", "--format", "json"))
    assert found["exit_code"] == 31
    found = error(coordlang("understand", language, *t_map, "w2 w0 w1 w2 w1", "--json"))
    assert found["exit_code"] == 1
    assert found["remedy"]


def test_a_limit(
    coordlang: Command, t_map: tuple[Path, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    def late(*_: object, **__: object) -> None:
        ended = OutOfTime("the time is over", remedy="Use a larger --time-limit.")
        ended.reached = "reading 3 lines"
        raise ended

    monkeypatch.setattr("coordlang.commands.inputs.Arguments.instance", late)
    found = error(coordlang("inspect", *t_map, "--json"))
    assert (found["exit_code"], found["reached"]) == (23, "reading 3 lines")

    def broken(*_: object, **__: object) -> None:
        raise ZeroDivisionError("here")

    monkeypatch.setattr("coordlang.commands.inputs.Arguments.instance", broken)
    found = error(coordlang("inspect", *t_map, "--json"))
    assert found["message"] == "internal error: ZeroDivisionError: here"

    def interrupted(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("coordlang.commands.inputs.Arguments.instance", interrupted)
    assert error(coordlang("inspect", *t_map, "--json"))["exit_code"] == 130


def test_an_answer_stays_the_only_object(
    coordlang: Command, t_map: tuple[Path, Path], language: Path, tmp_path: Path
) -> None:
    """`verify` answers, and then finds that a certificate proves less than the file claims."""
    certificate, exact = tmp_path / "c.json", tmp_path / "l.json"
    arguments = ("--tasks", "all", "--method", "minimal", "--certificate", certificate)
    assert coordlang("build", *t_map, *arguments, "-o", exact).code == 0
    data = json.loads(certificate.read_text())
    data["refuted"], data["reasons"] = 0, []
    certificate.write_text(json.dumps(data))
    outcome = coordlang("verify", exact, *t_map, "--certificate", certificate, "--json")
    assert outcome.code == 1
    assert json.loads(outcome.out)["holds"] is True


def test_what_asks_for_json() -> None:
    assert wants_json(["plans", "d", "p", "--json"])
    assert wants_json(["plans", "--format", "json", "d", "p"])
    assert wants_json(["plans", "--format=json"])
    assert not wants_json(["plans", "--format", "ipc", "json"])
    assert not wants_json(["plans", "--", "--json"])
