# SPDX-License-Identifier: GPL-3.0-or-later
"""Fixtures of all tests: the command line in this process, and a first language."""

from __future__ import annotations

from pathlib import Path

import pytest

from coordlang.commands.main import run
from tests.support.command import Command, Outcome
from tests.support.domains import DOMAINS


@pytest.fixture(autouse=True)
def _no_cache(monkeypatch: pytest.MonkeyPatch) -> None:
    """No test reads what another one, or this machine's user, has found: not in processes either."""
    monkeypatch.setenv("COORDLANG_CACHE", "off")


@pytest.fixture
def coordlang(capfd: pytest.CaptureFixture[str]) -> Command:
    def call(*arguments: object) -> Outcome:
        code = run([str(a) for a in arguments])
        out, err = capfd.readouterr()
        assert "Traceback" not in err
        return Outcome(code, out, err)

    return call


@pytest.fixture
def t_map() -> tuple[Path, Path]:
    return DOMAINS / "t-map" / "domain.pddl", DOMAINS / "t-map" / "problem.pddl"


@pytest.fixture
def language(coordlang: Command, t_map: tuple[Path, Path], tmp_path: Path) -> Path:
    path = tmp_path / "language.json"
    assert coordlang("build", *t_map, "--tasks", "all", "--method", "greedy", "-o", path).code == 0
    return path
