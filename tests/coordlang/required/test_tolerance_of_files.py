# SPDX-License-Identifier: GPL-3.0-or-later
"""Language files that claim how often robots fail: verified by counting, and used with a warning."""

from __future__ import annotations

import json
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import pytest

import coordlang as library
from coordlang.language.file import to_bytes
from coordlang.language.provenance import percent
from coordlang.verification.certificate_file import write_certificate
from tests.support import thorough
from tests.support.command import Command
from tests.support.domains import files_of
from tests.support.task_languages import built_for

SQUARE = files_of("grid", "gw1-2x2")
#: The open 2x2 grid in silence, all pairs of states.
SILENCE = {"failure_mean": 5 / 66, "failure_worst": 0.5}


def silent(path: Path, tolerance: dict[str, float] | None) -> Path:
    """One word for all states."""
    data: dict[str, Any] = json.loads(to_bytes(built_for("grid", "gw1-2x2", "greedy").language))
    data |= {"words": ["w0"], "states": dict.fromkeys(data["states"], "w0"), "default": "w0"}
    own = {"method": "by hand", "size": 1, "lower_bound": 1, "proved_minimal": False}
    data["guarantee"] = {**own, "coordination_language": False}
    if tolerance is not None:
        data["tolerance"] = tolerance
    path.write_text(json.dumps(data))
    return path


@pytest.mark.parametrize(
    ("claimed", "code"),
    [
        (SILENCE, 0),
        ({"failure_mean": 0.08, "failure_worst": 0.6}, 0),  # robots fail less often
        ({"failure_mean": 0.0757, "failure_worst": 0.5}, 1),
        ({"failure_mean": 0.0758, "failure_worst": 0.49}, 1),
        (None, 1),
    ],
)
def test_verify_counts_what_a_file_claims(
    claimed: dict[str, float] | None, code: int, coordlang: Command, tmp_path: Path
) -> None:
    path = silent(tmp_path / "l.json", claimed)
    found = coordlang("verify", path, *SQUARE)
    assert found.code == code
    assert "fail in 7.58 % of all runs, and in 50 % in the worst task" in found.out
    assert ("as claimed" in found.out) == (code == 0)
    assert ("The file claims less" in found.out) == (code == 1 and claimed is not None)
    answer = json.loads(coordlang("verify", path, *SQUARE, "--json").out)
    assert answer["holds"] is False
    assert {key: answer[key] for key in SILENCE} == SILENCE
    assert answer.get("tolerance") == claimed
    assert bool(library.verify(path, *SQUARE)) == (code == 0)


def test_bounds_of_words_that_may_fail_are_checked(coordlang: Command, tmp_path: Path) -> None:
    path, proof = silent(tmp_path / "l.json", SILENCE), tmp_path / "proof.json"
    data = json.loads(path.read_text())
    write_certificate(library.build(*SQUARE, tasks="all", method="minimal").certificate(), proof)
    for claimed, code in ((3, 0), (4, 1)):
        data["guarantee"]["lower_bound"] = claimed
        path.write_text(json.dumps(data))
        unchecked = coordlang("verify", path, *SQUARE)
        assert (unchecked.code, f"at least {claimed} words" in unchecked.out) == (0, True)
        found = coordlang("verify", path, *SQUARE, "--certificate", proof)
        assert (found.code, "lower bound 3" in found.out) == (code, claimed == 3)
    three = replace(library.load_language(path), words=("w0", "w1", "w2"))
    assert not library.verify(three, *SQUARE, certificate=proof).data()["proved_minimal"]


def test_what_cannot_be_counted_cannot_be_claimed(
    coordlang: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = silent(tmp_path / "l.json", SILENCE)
    for most in ("MOST", "_QUICKLY"):
        monkeypatch.setattr(f"coordlang.required.failure.{most}", 100)
    found = coordlang("verify", path, *SQUARE)
    assert found.code == 22
    assert "what the language tolerates cannot be checked" in found.err
    unclaimed = coordlang("verify", silent(path, None), *SQUARE)
    assert unclaimed.code == 1
    assert "(estimated from 1,000 draws" in unclaimed.out


def test_a_refuted_language_is_refuted_when_time_is_over(
    coordlang: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Counting is a service: without it the answer is the same."""
    over = Mock(side_effect=library.OutOfTime("the time limit of 1 s is over"))
    monkeypatch.setattr("coordlang.required.failure.failure_probability", over)
    found = coordlang("verify", silent(tmp_path / "l.json", None), *SQUARE)
    assert found.code == 1
    assert "fail in an unknown share of all runs (the time limit of 1 s is over)" in found.out


@pytest.mark.parametrize(
    ("tolerance", "warning"),
    [
        *thorough((SILENCE, "fail in 7.58 % of all runs")),
        (None, "may fail, and its file does not say how often"),
    ],
)
def test_commands_warn_of_words_that_are_too_few(
    tolerance: dict[str, float] | None, warning: str, coordlang: Command, tmp_path: Path
) -> None:
    path, page = silent(tmp_path / "l.json", tolerance), tmp_path / "page.html"
    plan = tmp_path / "plan"
    plan.write_text(coordlang("plans", *SQUARE, "--max", 1).out)
    sentence = [(name, "w0") for name in ("understand", "plan", "choices")]
    others = [*sentence, ("export", "w0", "--to", "bt"), ("explain", "--task")]
    for name, *more in (
        *(("say", plan), ("explain",), ("report", "-o", page)),
        *(others if tolerance else []),
    ):
        found = coordlang(name, path, *SQUARE, *more)
        assert found.code == 0, name
        assert warning in found.err, name
        assert warning not in found.out or name == "explain"
    assert warning.removeprefix("may fail, and its file ") in page.read_text()
    assert "whatever the others choose" not in page.read_text()
    assert library.say(path, *SQUARE, plan).data().get("tolerance") == tolerance
    library.load_language(path).save(path)
    assert library.load_language(path).may_fail
    if tolerance is None:
        assert coordlang("choices", path, *SQUARE, "w0").code == 1  # it miscoordinates


def test_choices_under_words_that_are_too_few_are_not_guaranteed(
    coordlang: Command, tmp_path: Path
) -> None:
    path = silent(tmp_path / "l.json", SILENCE)
    found = library.choices(path, *SQUARE, "w0")
    assert found.covered
    assert not found.guaranteed
    assert found.data()["tolerance"] == SILENCE
    shown = coordlang("choices", path, *SQUARE, "w0")
    assert "choices of this task miscoordinate in 50 % of all runs, for example:" in shown.err
    assert found.failure == Fraction(1, 2)
    assert "no coordination language" in coordlang("export", path, *SQUARE, "w0", "--to", "bt").out


def test_coordination_says_how_often_silence_fails(coordlang: Command, tmp_path: Path) -> None:
    near = tmp_path / "near.pddl"
    text = SQUARE[1].read_text()
    near.write_text(text[: text.index("(:goal")] + "(:goal (at r1 c0-1))\n)")
    files = [*SQUARE, near]
    found = json.loads(coordlang("coordination", *files, "--json").out)
    assert [task["requires_coordination"] for task in found["tasks"]] == [True, False]
    for task in found["tasks"]:
        assert (task["failure"] > 0) == task["requires_coordination"]
    assert found["failure_worst"] == max(task["failure"] for task in found["tasks"])
    assert found["failure_mean"] == sum(task["failure"] for task in found["tasks"]) / 2
    shown = coordlang("coordination", *files).out
    assert "robots that choose by themselves fail in 50 % of all runs." in shown
    assert "Over all tasks, without a word, robots fail in 25 % of all runs" in shown


@pytest.mark.parametrize(
    ("share", "text"),
    [
        (Fraction(0), "0 %"),
        (1.0, "100 %"),
        (5 / 66, "7.58 %"),
        (1e-9, "less than 0.01 %"),
        (0.9996, "more than 99.9 %"),
        (1 - Fraction(1, 2**60), "more than 99.9 %"),
        (0.5, "50 %"),
    ],
)
def test_percent_never_rounds_to_certainty(share: float | Fraction, text: str) -> None:
    assert percent(share) == text
