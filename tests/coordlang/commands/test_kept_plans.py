# SPDX-License-Identifier: GPL-3.0-or-later
"""Commands do not search again what an earlier one found; ``--no-cache``, damage, two at once."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

from planners.joint.model import JointModel, PlanningTask
from planners.search import kept_plans, optimal_plans
from planners.search.plan_space import PlanSpace
from tests.support.command import Command
from tests.support.domains import DOMAINS

GRID = DOMAINS / "grid" / "domain.pddl", DOMAINS / "grid" / "gw4-3x3.pddl"


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("COORDLANG_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


@pytest.fixture
def no_search(monkeypatch: pytest.MonkeyPatch) -> None:
    """No task may be searched."""

    def refused(model: JointModel, task: PlanningTask) -> PlanSpace:
        raise AssertionError(f"{task.name} is searched again")

    # Not in its own module: what is imported now would keep it.
    other = SimpleNamespace(search=refused, joined=optimal_plans.joined)
    monkeypatch.setattr(kept_plans, "optimal_plans", other)


def commands(language: Path, plan: Path, sentence: str) -> dict[str, tuple[object, ...]]:
    return {
        "plans": ("plans", *GRID, "--count"),
        "coordination": ("coordination", *GRID, "--jobs", 1),
        "verify": ("verify", language, *GRID, "--jobs", 1),
        "say": ("say", language, *GRID, plan),
        "understand": ("understand", language, *GRID, sentence, "--count"),
        "plan": ("plan", language, *GRID, sentence),
        "choices": ("choices", language, *GRID, sentence, "--robot", "r1"),
        "explain": ("explain", language, *GRID),
        "export": ("export", language, *GRID, sentence, "--to", "ltlf"),
        "report": ("report", language, *GRID, "-o", "-"),
    }


def test_no_command_searches_again(
    coordlang: Command, folder: Path, tmp_path: Path, request: pytest.FixtureRequest
) -> None:
    language, plan = tmp_path / "l.json", tmp_path / "plan"
    build = ("build", *GRID, "-o", language, "--jobs", 1)
    assert coordlang(*build).code == 0
    (entry,) = folder.glob("plans-*/*")
    outcome = coordlang("plans", *GRID, "--max", 1, "--format", "ipc")
    plan.write_text(outcome.out)
    sentence = coordlang("say", language, *GRID, plan).out.strip()
    every = commands(language, plan, sentence)
    before = {name: coordlang(*arguments, "--no-cache") for name, arguments in every.items()}
    request.getfixturevalue("no_search")
    for name, arguments in every.items():
        assert coordlang(*arguments) == before[name], name
        assert before[name].code == 0, name
    assert coordlang(*build).code == 0
    assert list(folder.glob("plans-*/*")) == [entry]


def test_no_cache_reads_and_keeps_nothing(
    coordlang: Command,
    folder: Path,
    monkeypatch: pytest.MonkeyPatch,
    request: pytest.FixtureRequest,
) -> None:
    arguments = ("plans", *GRID, "--count")
    assert coordlang(*arguments, "--no-cache").out == "18\n"
    monkeypatch.setenv("COORDLANG_CACHE", "off")
    assert coordlang(*arguments).out == "18\n"
    assert not folder.exists()
    monkeypatch.setenv("COORDLANG_CACHE", str(folder))
    assert coordlang(*arguments).out == "18\n"
    request.getfixturevalue("no_search")
    assert coordlang(*arguments).out == "18\n"
    assert "is searched again" in coordlang(*arguments, "--no-cache").err


def test_damage_is_said(coordlang: Command, folder: Path) -> None:
    arguments = ("plans", *GRID, "--count")
    coordlang(*arguments)
    (entry,) = folder.glob("plans-*/*")
    whole = entry.read_bytes()
    entry.write_bytes(whole[:-1])
    outcome = coordlang(*arguments)
    assert (outcome.code, outcome.out) == (0, "18\n")
    assert f"{entry} is damaged: it is ignored, and its result is worked out again" in outcome.err
    assert entry.read_bytes() == whole
    assert coordlang(*arguments).err == ""


def test_a_folder_that_cannot_be_made(
    coordlang: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("COORDLANG_CACHE", str(tmp_path / "file"))
    outcome = coordlang("plans", *GRID, "--count")
    assert (outcome.code, outcome.out) == (0, "18\n")
    assert "not kept" in outcome.err
    assert "--no-cache" in outcome.err


def test_two_commands_at_once(folder: Path) -> None:
    command = [sys.executable, "-m", "coordlang", "plans", *map(str, GRID), "--count"]
    both = [
        subprocess.Popen(
            command, env=dict(os.environ), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )
        for _ in range(2)
    ]
    assert [(*process.communicate(), process.returncode) for process in both] == [
        ("18\n", "", 0)
    ] * 2
    assert len([*folder.glob("plans-*/*")]) == 1
