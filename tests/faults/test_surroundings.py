# SPDX-License-Identifier: GPL-3.0-or-later
"""Odd names of files, and surroundings without HOME, TMPDIR or UTF-8."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import pytest

from tests.support.command import own_process
from tests.support.domains import DOMAINS

NAMES = ("two words", "two\nlines", "-o", "--help", "ünïcödé", "'\"$(x)`*")
SURROUNDINGS: dict[str, dict[str, str | None]] = {
    "no HOME": {"HOME": None},
    "HOME is missing": {"HOME": "/no/such/home"},
    "TMPDIR is missing": {"TMPDIR": "/no/such/folder"},
    "not UTF-8": {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"},
}


def run(folder: Path, changes: dict[str, str | None], *arguments: str) -> None:
    environment = {**os.environ, **{k: v for k, v in changes.items() if v is not None}}
    for name in (name for name, value in changes.items() if value is None):
        environment.pop(name, None)
    ended = subprocess.run(
        own_process(*arguments), cwd=folder, env=environment, capture_output=True, text=True
    )
    assert ended.returncode == 0, ended.stderr
    assert "Traceback" not in ended.stderr


def build_verify_report(folder: Path, name: str, changes: dict[str, str | None]) -> None:
    """All files have names that begin with ``name``."""
    domain, problem, language, page = (f"{name}{end}" for end in (".d", ".p", ".json", ".html"))
    shutil.copy(DOMAINS / "grid" / "domain.pddl", folder / domain)
    shutil.copy(DOMAINS / "grid" / "gw1-2x2.pddl", folder / problem)
    run(folder, changes, "build", f"--output={language}", "--", domain, problem)
    run(folder, changes, "verify", "--", language, domain, problem)
    run(folder, changes, "report", f"--output={page}", "--", language, domain, problem)
    assert sorted(path.name for path in folder.iterdir()) == sorted(
        [domain, problem, language, page]
    )


@pytest.mark.parametrize("name", NAMES)
def test_names_of_files(name: str, tmp_path: Path) -> None:
    build_verify_report(tmp_path, name, {})


@pytest.mark.parametrize("which", SURROUNDINGS)
def test_surroundings(which: str, tmp_path: Path) -> None:
    build_verify_report(tmp_path, "ünïcödé", SURROUNDINGS[which])
