# SPDX-License-Identifier: GPL-3.0-or-later
"""Fixtures of all tests: the command line in this process, and a first language."""

from __future__ import annotations

import gc
import os
import sys
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from coordlang.commands.main import run
from tests.support.command import Command, Outcome
from tests.support.domains import SHARED, T_MAP

# Some 150 processes are started, each of which would compile the packages again.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False
# No test reads what another one, or this machine's user, has found: not in processes either.
os.environ["COORDLANG_CACHE"] = "off"


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems() -> None:
    """Hypothesis draws nothing from the packages' files: it takes 5 s and varies with the code."""
    from hypothesis.internal.conjecture import providers

    if hasattr(providers, "_get_local_constants"):
        providers._get_local_constants = lambda: providers._local_constants


def pytest_collection_finish() -> None:
    """Modules stay: to look for garbage in what they hold, again and again, takes 3 % of all time."""
    gc.freeze()


def pytest_runtest_setup(item: pytest.Item) -> None:
    """What others wrote is read where it is."""
    if item.get_closest_marker("foreign") and not SHARED.is_dir():
        pytest.skip(f"the inputs that others wrote are not here: {SHARED}")


@pytest.fixture
def coordlang(capfd: pytest.CaptureFixture[str]) -> Command:
    def call(*arguments: object) -> Outcome:
        code = run([str(a) for a in arguments])
        out, err = capfd.readouterr()
        assert "Traceback" not in err
        return Outcome(code, out, err)

    return call


@pytest.fixture
def searches(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The names of the tasks that are really searched, and not among the kept plans."""
    from planners.search import kept_plans, optimal_plans

    done: list[str] = []

    def search(model: Any, task: Any, *rest: Any) -> object:
        done.append(task.name)
        return optimal_plans.search(model, task, *rest)

    counting = SimpleNamespace(search=search, joined=optimal_plans.joined)
    monkeypatch.setattr(kept_plans, "optimal_plans", counting)
    return done


@pytest.fixture
def language(tmp_path: Path) -> Path:
    """A language of the T-map."""
    path = tmp_path / "language.json"
    path.write_bytes(_greedy())
    return path


@cache
def _greedy() -> bytes:
    from coordlang import build
    from coordlang.language.file import to_bytes

    return to_bytes(build(*T_MAP, tasks="all", method="greedy").language)
