# SPDX-License-Identifier: GPL-3.0-or-later
"""``coordlang report`` at the terminal."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.coordlang.report.conftest import data_of
from tests.support.command import Command
from tests.support.domains import DOMAINS

FILES = DOMAINS / "t-map" / "domain.pddl", DOMAINS / "t-map" / "problem.pddl"


def test_a_page_is_written(coordlang: Command, language: Path, tmp_path: Path) -> None:
    page = tmp_path / "report.html"
    outcome = coordlang("report", language, *FILES, "-o", page)
    assert outcome.code == 0
    assert outcome.out == f"30 tasks of 132, {page.stat().st_size:,} bytes, written to {page}\n"
    assert page.read_text().startswith("<!DOCTYPE html>")
    assert len(data_of(page.read_bytes())["tasks"]) == 30
    to_stdout = coordlang("report", language, *FILES, "-o", "-")
    assert to_stdout.out == page.read_text()
    assert "written to stdout" in to_stdout.err


def test_coordinates(coordlang: Command, language: Path, tmp_path: Path) -> None:
    sidecar = tmp_path / "mine.json"
    sidecar.write_text(
        '{"coordinates": {"c0-1": [9, 0], "c1-0": [0, 5], "c1-1": [9, 5], "c1-2": [20, 5]}}'
    )
    page = tmp_path / "report.html"
    one = ("-o", page)
    assert coordlang("report", language, *FILES, *one, "--coordinates", sidecar).code == 0
    assert data_of(page.read_bytes())["places"][0] == {"name": "c0-1", "x": 9, "y": 0}
    # Beside the problem it needs no option.
    copy = tmp_path / "problem.pddl"
    copy.write_text(FILES[1].read_text())
    sidecar.rename(tmp_path / "coordinates.json")
    assert coordlang("report", language, FILES[0], copy, *one).code == 0
    assert data_of(page.read_bytes())["places"][0]["x"] == 9
    (tmp_path / "coordinates.json").write_text("[]")
    assert coordlang("report", language, FILES[0], copy, *one).code == 31


@pytest.mark.parametrize(
    ("arguments", "code"),
    [
        (("-o", "{folder}"), 2),
        ((), 2),
        (("--coordinates", "{folder}/none.json", "-o", "-"), 31),
        (("--cost", "makespan+actions", "-o", "-"), 2),
    ],
)
def test_what_is_refused(
    arguments: tuple[str, ...], code: int, coordlang: Command, language: Path, tmp_path: Path
) -> None:
    before = language.read_bytes()
    given = [a.format(language=language, folder=tmp_path) for a in arguments]
    outcome = coordlang("report", language, *FILES, *given)
    assert outcome.code == code
    assert outcome.err
    assert language.read_bytes() == before
