# SPDX-License-Identifier: GPL-3.0-or-later
"""`coordlang lift` and `coordlang ground` at the terminal: exit codes, files, the page."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import coordlang as api
from tests.coordlang.report.conftest import data_of
from tests.support.command import Command
from tests.support.domains import DOMAINS

GRID = DOMAINS / "grid" / "domain.pddl"
RINGS = [DOMAINS / "grid" / f"{stem}.pddl" for stem in ("gwb1-2x4", "gwb2-3x3")]
LARGER, OPEN = DOMAINS / "grid" / "gwb3-3x4.pddl", DOMAINS / "grid" / "gw2-2x3.pddl"
SMALL = DOMAINS / "grid" / "gw1-2x2.pddl"


@pytest.fixture(scope="module")
def lifted(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("lifted") / "rings.json"
    api.lift(GRID, *RINGS, tasks="all", jobs=1).save(path)
    return path


def test_files_on_stdout(
    coordlang: Command, lifted: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """``-`` is stdout, and no file of that name; what is said goes to stderr."""
    monkeypatch.chdir(tmp_path)
    out = coordlang("lift", GRID, *RINGS, "--tasks", "all", "-o", "-", "--jobs", "1")
    assert (out.code, out.out) == (0, lifted.read_text())
    assert "4 words, functions of 2 features" in out.err
    assert coordlang("ground", lifted, GRID, LARGER, "-o", "l.json", "--jobs", "1").code == 0
    out = coordlang("ground", lifted, GRID, LARGER, "-o", "-", "--jobs", "1")
    assert (out.code, out.out) == (0, Path("l.json").read_text())
    assert sorted(path.name for path in tmp_path.iterdir()) == ["l.json"]


def test_where_the_memory_does_not_suffice(
    coordlang: Command, lifted: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is written all the same, covers nothing, and exit code 3 says that it lacks the proof."""

    def too_large(*_: object) -> None:
        raise api.OutOfMemory("the walk would need 47 GiB")

    monkeypatch.setattr("coordlang.commands.lift.verify_candidates", too_large)
    language = tmp_path / "language.json"
    outcome = coordlang("ground", lifted, GRID, LARGER, "-o", language, "--jobs", "1")
    assert outcome.code == 3
    assert "not verified here: the walk would need 47 GiB" in outcome.err
    assert json.loads(language.read_text())["tasks"]["count"] == 0


@pytest.mark.parametrize(
    ("arguments", "code"),
    [
        (("lift", GRID), 2),
        (("lift", GRID, OPEN, "--tasks", "all", "--complexity", "3", "-o", "x.json"), 11),
        (("lift", GRID, "missing.pddl", "-o", "x.json"), 31),
        (("ground", "missing.json", GRID, OPEN, "-o", "x.json"), 31),
    ],
)
def test_exit_codes(
    arguments: tuple[object, ...], code: int, coordlang: Command, tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    monkeypatch.chdir(tmp_path)
    assert coordlang(*arguments).code == code
    assert not (tmp_path / "x.json").exists()


def test_the_report_shows_the_features(coordlang: Command, lifted: Path, tmp_path: Path) -> None:
    """Words have the same numbers, and so colours, on every map; states are coloured by them."""
    page = tmp_path / "page.html"
    assert coordlang("report", lifted, GRID, LARGER, "-o", page).code == 0
    text = page.read_text()
    assert "The words are functions of features" in text
    data = data_of(page.read_bytes())
    assert [word["name"] for word in data["words"]] == ["w0", "w1", "w2", "w3"]
    assert data["words"][3]["terms"] == ["column(at(r1)) >= 1 and row(at(r1)) >= 1"]
    corner = [
        data["words"][word]["name"]
        for state, word in zip(data["states"], data["state_words"], strict=True)
        if "(at r1 c0-0)" in {data["facts"][fact]["text"] for fact in state}
    ]
    assert set(corner) == {"w0"}


def test_coordinates_beside_the_problem(coordlang: Command, tmp_path: Path) -> None:
    """Places without telling names: a file says where they are, and features use it."""
    text = OPEN.read_text().replace("c0-", "upper").replace("c1-", "lower")
    domain, problem, out = tmp_path / "d.pddl", tmp_path / "p.pddl", tmp_path / "l.json"
    domain.write_text(GRID.read_text())
    problem.write_text(text)
    points = {f"{row}{x}": [x, y] for y, row in enumerate(("upper", "lower")) for x in range(3)}
    (tmp_path / "coordinates.json").write_text(json.dumps({"coordinates": points}))
    outcome = coordlang(
        "lift", domain, problem, "--tasks", "all", "--complexity", "5", "-o", out, "--jobs", "1"
    )
    assert outcome.code == 0
    assert "column(at(" in outcome.out
    assert coordlang("ground", out, domain, problem, "-o", tmp_path / "g.json").code == 0
    explained = coordlang("explain", tmp_path / "g.json", domain, problem)
    assert "column(at(" in explained.out


def test_a_limit_ends_the_search_for_fewer_words(
    coordlang: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The words that are verified already are written: exit code 3; 130 after an interrupt."""
    late = api.OutOfTime("the time limit is over")
    for error, code in ((late, 3), (MemoryError(), 3), (KeyboardInterrupt(), 130)):

        def stop(*_: object, error: BaseException = error) -> None:
            raise error

        monkeypatch.setattr("coordlang.lifted.learning.merge_classes", stop)
        path = tmp_path / f"{code}.json"
        outcome = coordlang(
            "lift", GRID, SMALL, "--tasks", "all", "--prefer", "features", "-o", path, "--jobs", 1
        )
        assert outcome.code == code
        assert "the best words so far are written: they are verified" in outcome.err
        assert len(json.loads(path.read_text())["words"]) > 1
