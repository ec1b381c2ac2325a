# SPDX-License-Identifier: GPL-3.0-or-later
"""Odd names of files, and surroundings without HOME, TMPDIR or UTF-8."""

from __future__ import annotations

import os
import shutil
import tempfile
from pathlib import Path

import pytest

from tests.support.domains import DOMAINS
from tests.support.forks import fork_command, fresh_command

NAMES = ("two words", "two\nlines", "-o", "--help", "ünïcödé", "'\"$(x)`*")
SURROUNDINGS: dict[str, dict[str, str | None]] = {
    "no HOME": {"HOME": None},
    "HOME is missing": {"HOME": "/no/such/home"},
    "TMPDIR is missing": {"TMPDIR": "/no/such/folder"},
    "not UTF-8": {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"},
}


def run(folder: Path, changes: dict[str, str | None], *arguments: str, fresh: bool = False) -> None:
    def before() -> None:
        os.chdir(folder)
        tempfile.tempdir = None
        for name, value in changes.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value

    ended = (fresh_command if fresh else fork_command)(*arguments, before=before).join()
    assert ended.code == 0, ended
    assert "Traceback" not in ended.err


def build_verify_report(
    folder: Path, name: str, changes: dict[str, str | None], *, fresh: bool = False
) -> None:
    """All files have names that begin with ``name``."""
    domain, problem, language, page = (f"{name}{end}" for end in (".d", ".p", ".json", ".html"))
    shutil.copy(DOMAINS / "grid" / "domain.pddl", folder / domain)
    shutil.copy(DOMAINS / "grid" / "gw1-2x2.pddl", folder / problem)
    run(folder, changes, "build", f"--output={language}", "--", domain, problem, fresh=fresh)
    run(folder, changes, "verify", "--", language, domain, problem, fresh=fresh)
    run(folder, changes, "report", f"--output={page}", "--", language, domain, problem, fresh=fresh)
    assert sorted(path.name for path in folder.iterdir()) == sorted(
        [domain, problem, language, page]
    )


@pytest.mark.parametrize("name", NAMES)
def test_names_of_files(name: str, tmp_path: Path) -> None:
    build_verify_report(tmp_path, name, {})


@pytest.mark.thorough
def test_without_utf_8(tmp_path: Path) -> None:
    build_verify_report(tmp_path, "ünïcödé", SURROUNDINGS["not UTF-8"], fresh=True)


@pytest.mark.parametrize("which", ["no HOME", "HOME is missing", "TMPDIR is missing"])
@pytest.mark.parametrize("fresh", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_surroundings(fresh: bool, which: str, tmp_path: Path) -> None:
    build_verify_report(tmp_path, "ünïcödé", SURROUNDINGS[which], fresh=fresh)
