# SPDX-License-Identifier: GPL-3.0-or-later
"""``coordlang check``: agreement, disagreement and proof of unsolvability, each with its exit code."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from planners.classical.fast_downward import FastDownwardAnswer
from tests.support.command import Command
from tests.support.domains import DOMAINS

T_MAP = DOMAINS / "t-map"


@pytest.mark.parametrize("folder", ["t-map", "three-cells"])
def test_agreement(
    folder: str, coordlang: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    outcome = coordlang(
        "check", DOMAINS / folder / "domain.pddl", DOMAINS / folder / "problem.pddl", "--json"
    )
    assert outcome.code == 0
    data = json.loads(outcome.out)
    assert data["agree"] is True
    assert data["coordlang"] == data["fast_downward"]
    assert list(tmp_path.iterdir()) == []


def test_both_prove_that_there_is_no_plan(coordlang: Command, tmp_path: Path) -> None:
    problem = tmp_path / "p.pddl"
    text = (T_MAP / "problem.pddl").read_text()
    problem.write_text(text.replace("(at r1 c1-0) (at r2 c0-1)))", "(at r1 c1-0) (at r2 c1-0)))"))
    assert problem.read_text() != text
    outcome = coordlang("check", T_MAP / "domain.pddl", problem)
    assert outcome.code == 11
    assert outcome.out.count("no plan exists") == 2


def test_a_disagreement_is_refuted(coordlang: Command, monkeypatch: pytest.MonkeyPatch) -> None:
    answer = FastDownwardAnswer((3, 0), "explicit", 1)
    monkeypatch.setattr("coordlang.commands.check.optimal_cost", lambda *_, **__: answer)
    outcome = coordlang("check", T_MAP / "domain.pddl", T_MAP / "problem.pddl")
    assert outcome.code == 1
    assert "coordlang      makespan 4" in outcome.out
    assert "Fast Downward  makespan 3" in outcome.out
    assert "the optimal costs differ" in outcome.err


def test_the_time_limit_ends_fast_downward_too(coordlang: Command) -> None:
    grid = DOMAINS / "grid"
    outcome = coordlang(
        "check", grid / "domain.pddl", grid / "corners-10x10.pddl", "--time-limit", "3"
    )
    assert outcome.code == 23
