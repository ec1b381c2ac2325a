# SPDX-License-Identifier: GPL-3.0-or-later
"""Commands do not search again what an earlier one found; ``--no-cache``, damage, two at once."""

from __future__ import annotations

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
    build = ("build", *GRID, "--method", "greedy", "-o", language, "--jobs", 1)
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
