# SPDX-License-Identifier: GPL-3.0-or-later
"""Output files: refused before the work where they cannot be written, overwrite an input file or
each other.
"""

from __future__ import annotations

import json
import os
import shutil
from pathlib import Path

import pytest

import coordlang as door
from tests.support.command import Command
from tests.support.domains import DOMAINS

ALL = ("l.json", "d.pddl", "p.pddl")
SENTENCE = "w0"


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a file of each kind; `in/` holds the PDDL files by the names that `export`
    writes.
    """
    folder = tmp_path_factory.mktemp("outputs")
    (folder / "in").mkdir()
    sources = [DOMAINS / "t-map" / name for name in ("domain.pddl", "problem.pddl")]
    for source in sources:
        shutil.copy(source, folder / f"{source.name[0]}.pddl")
        shutil.copy(source, folder / "in" / source.name)
    door.build(*sources, tasks="all").language.save(folder / "l.json")
    task = {"init": ["(at r1 c0-1)", "(at r2 c1-0)"], "goal": ["(at r1 c1-0)"]}
    tasks = {"format": "coordlang/tasks", "version": 1, "tasks": [task]}
    for name, data in (("t.json", tasks), ("proof.json", {}), ("coordinates.json", {})):
        (folder / name).write_text(json.dumps(data))
    (folder / "plan").write_text("(noop)\n")
    return folder


@pytest.fixture
def folder(made: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy of it, to work in."""
    shutil.copytree(made, tmp_path / "here")
    monkeypatch.chdir(tmp_path / "here")
    return tmp_path / "here"


BUILD = ("build", "d.pddl", "p.pddl", "--tasks", "t.json")
UNDERSTAND = ("understand", *ALL, SENTENCE)
CHOICES = ("choices", *ALL, SENTENCE)
EXPORT = ("export", *ALL, SENTENCE)
VERIFY = ("verify", *ALL, "--tasks", "t.json", "--certificate", "proof.json", "--dimacs")
REPORT = ("report", *ALL, "-o")
OVERWRITING = [
    *((*BUILD, "-o", name) for name in ("d.pddl", "p.pddl", "t.json", "in/../d.pddl")),
    (*BUILD, "-o", "x.json", "--certificate", "t.json"),
    (*UNDERSTAND, "-o", "l.json"),
    (*CHOICES, "-o", "d.pddl"),
    (*EXPORT, "--to", "ltlf", "-o", "l.json"),
    (*EXPORT, "--json", "-o", "p.pddl"),
    (*EXPORT, "--translate-plan", "plan", "-o", "plan"),
    ("export", "l.json", "in/domain.pddl", "p.pddl", SENTENCE, "-o", "in"),
    ("export", "l.json", "d.pddl", "in/problem.pddl", SENTENCE, "-o", "in"),
    ("tasks", "d.pddl", "p.pddl", "-o", "p.pddl"),
    *((*VERIFY, name) for name in (*ALL, "t.json", "proof.json")),
    *((*REPORT, name) for name in ("l.json", "coordinates.json")),
    *(("lift", *ALL[1:], "-o", name) for name in ("p.pddl", "coordinates.json")),
    *(("ground", *ALL, "-o", name) for name in ("l.json", "coordinates.json")),
]


@pytest.mark.parametrize("arguments", OVERWRITING, ids=" ".join)
def test_no_input_file_is_overwritten(
    arguments: tuple[str, ...], coordlang: Command, folder: Path
) -> None:
    before = {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    outcome = coordlang(*arguments)
    assert outcome.code == 2
    assert outcome.out == "" or json.loads(outcome.out)["error"]["exit_code"] == 2
    assert ("--json" in arguments) == (outcome.out != "")
    assert "would overwrite an input file\n  " in outcome.err
    assert before == {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def test_a_link_to_an_input_file_is_one(coordlang: Command, folder: Path) -> None:
    Path("link.json").symlink_to("t.json")
    outcome = coordlang(*BUILD, "-o", "link.json")
    assert (outcome.code, "-o link.json would overwrite an input file" in outcome.err) == (2, True)


@pytest.mark.parametrize("name", ["x.json", "./x.json", "in/../x.json"])
def test_two_outputs_are_two_files(name: str, coordlang: Command, folder: Path) -> None:
    outcome = coordlang(*BUILD, "-o", "x.json", "--certificate", name)
    assert outcome.code == 2
    assert f"-o and --certificate name the same file: {name}" in outcome.err
    assert not Path("x.json").exists()


TO_FILE = [
    (*BUILD, "-o"),
    (*BUILD, "-o", "x.json", "--certificate"),
    (*UNDERSTAND, "-o"),
    (*CHOICES, "-o"),
    VERIFY,
    REPORT,
    (*EXPORT, "--to", "ltlf", "-o"),
    ("tasks", "d.pddl", "p.pddl", "-o"),
]


@pytest.mark.parametrize(
    ("arguments", "place", "reason"),
    [
        *((arguments, "no/x", "there is no folder no") for arguments in TO_FILE),
        (TO_FILE[0], "plan/x", "there is no folder plan"),
        (TO_FILE[0], "in", "Is a directory"),
        (TO_FILE[0], "shut/x", "Permission denied"),
    ],
)
def test_the_place_is_looked_at_before_the_work(
    arguments: tuple[str, ...],
    place: str,
    reason: str,
    coordlang: Command,
    folder: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    Path("shut").mkdir()
    access = os.access  # the superuser may write everywhere
    monkeypatch.setattr(
        os, "access", lambda path, mode: Path(path).name != "shut" and access(path, mode)
    )
    monkeypatch.setattr(
        "coordlang.commands.inputs.read_domain", lambda *_: pytest.fail("no work before")
    )
    outcome = coordlang(*arguments, place)
    assert outcome.code == 2
    assert f"{arguments[-1]} {place} cannot be written: {reason}\n  Name a file" in outcome.err


def test_a_shut_folder_for_exported_files(
    coordlang: Command, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(os, "access", lambda path, mode: not os.path.isdir(path))
    assert "Permission denied" in coordlang(*EXPORT, "-o", "made/here").err
    assert not Path("made").exists()


@pytest.mark.parametrize(
    "arguments", [(*BUILD, "-o", "x.json", "--certificate", "-"), (*VERIFY, "-")], ids=" ".join
)
def test_second_outputs_do_not_go_to_stdout(
    arguments: tuple[str, ...], coordlang: Command, folder: Path
) -> None:
    outcome = coordlang(*arguments)
    assert (outcome.code, outcome.out) == (2, "")
    assert f"{arguments[-2]} -: this cannot go to stdout\n  Name a file." in outcome.err


def test_a_device_may_be_both(coordlang: Command, folder: Path) -> None:
    assert (
        coordlang(
            *BUILD, "--method", "minimal", "-o", "/dev/null", "--certificate", "/dev/null"
        ).code
        == 0
    )
