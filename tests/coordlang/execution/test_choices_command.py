# SPDX-License-Identifier: GPL-3.0-or-later
"""``coordlang choices`` at the terminal: tables, JSON, pictures, detours, and what it says when
something is wrong.
"""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from coordlang.execution.monitor import Monitor
from tests.support.command import Command
from tests.support.domains import DOMAINS

CELLS = DOMAINS / "three-cells" / "domain.pddl", DOMAINS / "three-cells" / "problem.pddl"


@pytest.fixture
def cells(coordlang: Command, tmp_path: Path) -> Path:
    path = tmp_path / "cells.json"
    assert coordlang("build", *CELLS, "--method", "greedy", "-o", path).code == 0
    return path


def test_table(coordlang: Command, cells: Path) -> None:
    outcome = coordlang("choices", cells, *CELLS, "w1 w0", "--check")
    assert (outcome.code, outcome.err) == (0, "")
    assert (
        "checked: 2 combinations of own subplans, all optimal plans (4 nodes walked)" in outcome.out
    )
    assert "r1 may follow 1 subplan (3 states):" in outcome.out
    assert "idle -> 1 | (move r2 b a) -> 2" in outcome.out
    assert "r1 may" not in coordlang("choices", cells, *CELLS, "w1 w0", "--robot", "R2").out


def test_json_is_a_choices_file(coordlang: Command, cells: Path, tmp_path: Path) -> None:
    path = tmp_path / "choices.json"
    outcome = coordlang("choices", cells, *CELLS, "w1 w0", "--format", "json", "-o", path)
    assert (outcome.code, outcome.out) == (0, "")
    assert Monitor.read(str(path), "r2").allowed() == (None, "(move r2 b a)")
    data = json.loads(path.read_text())
    assert [entry["robot"] for entry in data["choices"]] == ["r1", "r2"]
    keys = ("plans", "covered", "guaranteed", "combinations_walked")
    assert [data[key] for key in keys] == [2, True, True, 4]
    one = json.loads(
        coordlang("choices", cells, *CELLS, "w1 w0", "--json", "--robot", "r2", "--robot", "r2").out
    )
    assert one == data | {"choices": data["choices"][1:]}
    drawn = coordlang("choices", cells, *CELLS, "w1 w0", "--format", "dot").out
    assert drawn.count("subgraph") == 2
    assert 'r1s0 -> r1s2 [label="(move r2 b a)"];' in drawn


def test_detours(coordlang: Command, cells: Path) -> None:
    ask = "choices", cells, *CELLS, "w1 w0", "--robot", "r2"
    yes = coordlang(*ask, "--history", "idle", "--visit", "(at r2 a)")
    assert yes.code == 0
    assert yes.out.splitlines() == [
        "step 2: r2 may do (move r2 b a); 1 subplan left",
        "the detour is possible in 1 subplan, the first of them:",
        "     2  (move r2 b a)",
    ]
    no = coordlang(*ask, "--avoid", "(at r1 c)", "--json")
    assert no.code == 1
    assert json.loads(no.out) == {
        "robot": "r2",
        "step": 0,
        "allowed": [None, "(move r2 b a)"],
        "left": 2,
        "atoms": "exact",
        "possible": False,
        "subplans": 0,
        "subplan": None,
    }
    done = coordlang(*ask, "--history", "(move r2 b a)", "--history", "idle")
    assert done.out == "r2 has done all its 2 steps\n"
    wrong = coordlang(*ask, "--history", "idle", "--history", "idle")
    assert wrong.code == 1
    assert "step 2: r2 may not do idle; it may do (move r2 b a)" in wrong.err


@pytest.mark.parametrize(
    ("arguments", "code", "message"),
    [
        (
            ["w1 w0", "--robot", "r3"],
            2,
            "--robot r3: there is no such robot\n  The robots are r1, r2.",
        ),
        (["w1 w0", "--history", "idle"], 2, "ask about one --robot"),
        (
            ["w1 w0", "--robot", "r1", "--visit", "(at r1 z)"],
            2,
            "(at r1 z) is no atom that can change",
        ),
        (["w1 w0", "--robot", "r1", "--history", "jump"], 2, "'jump' is no PDDL text"),
        (["w1 w0", "--robot", "r1", "--history", "idle", "--format", "dot"], 2, "as text or JSON"),
        (["w0 w1"], 1, "no optimal plan has the sentence"),
        (["w1 w9"], 31, "'w9', is no word of this language"),
        ([""], 31, "the sentence is empty"),
    ],
)
def test_bad_input(
    arguments: list[str], code: int, message: str, coordlang: Command, cells: Path
) -> None:
    outcome = coordlang("choices", cells, *CELLS, *arguments)
    assert outcome.code == code
    assert message in outcome.err
    assert outcome.out == ""


def other_task(tmp_path: Path, old: str, new: str) -> Path:
    path = tmp_path / "other.pddl"
    text = CELLS[1].read_text()
    assert text.count(old) == 1
    path.write_text(text.replace(old, new))
    return path


def test_a_task_that_is_not_covered(coordlang: Command, cells: Path, tmp_path: Path) -> None:
    """The answer is given with a warning and exit code 1; the proof for this one sentence makes it
    good.
    """
    other = other_task(tmp_path, "(at r1 a) (at r2 b)", "(at r1 c) (at r2 b)")
    unproved = coordlang("choices", cells, CELLS[0], other, "w0")
    assert unproved.code == 1
    assert "r1 may follow 1 subplan (2 states)" in unproved.out
    assert (
        unproved.err
        == "coordlang: warning: the language does not cover this task: it guarantees nothing here\n"
    )
    proved = coordlang("choices", cells, CELLS[0], other, "w0", "--check")
    assert proved.code == 0
    assert "checked: 1 combination of own subplans" in proved.out
    assert "--check proved this sentence" in proved.err


@pytest.mark.parametrize("check", [[], ["--check"]])
def test_a_task_that_is_not_covered_and_refuted(
    check: list[str], coordlang: Command, cells: Path, tmp_path: Path
) -> None:
    other = other_task(tmp_path, "(at r1 a) (at r2 b)", "(at r1 c) (at r2 b)")
    assert coordlang("build", CELLS[0], other, "--method", "greedy", "-o", cells).code == 0
    refuted = coordlang("choices", cells, *CELLS, "w0", *check)
    assert refuted.code == 1
    assert "r1 may follow 3 subplans" in refuted.out
    assert (
        "coordlang: refuted: choices of this task miscoordinate; the language does not cover it"
        in refuted.err
    )
    assert "<-- breaks here" in refuted.err
    data = json.loads(coordlang("choices", cells, *CELLS, "w0", "--json", *check).out)
    assert (data["guaranteed"], data["covered"]) == (False, False)
    assert {entry["atoms"] for entry in data["choices"]} == {"own"}


def test_large_tables_are_cut(
    coordlang: Command, cells: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("coordlang.commands.choices.STATES_SHOWN", 2)
    outcome = coordlang("choices", cells, *CELLS, "w1 w0", "--robot", "r2")
    assert "idle -> 1" in outcome.out
    assert outcome.out.endswith("  .. and 1 state more; --format json has all of them\n")
