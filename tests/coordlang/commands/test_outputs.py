# SPDX-License-Identifier: GPL-3.0-or-later
"""Output files: refused before the work if not writable, an input, or one written twice."""

from __future__ import annotations

import json
import os
import shlex
import shutil
import socket
from pathlib import Path

import pytest

import coordlang as door
from planners.system.errors import UsageError
from planners.system.writing import write_atomically
from tests.coordlang.commands.conftest import Shell
from tests.support.domains import DOMAINS


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A file of each kind; `in/` holds the PDDL files by the names that `export` writes."""
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
def here(shell: Shell, made: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Shell:
    """The command line in a copy of it."""
    shutil.copytree(made, tmp_path / "here")
    monkeypatch.chdir(tmp_path / "here")
    return shell


ALL = "l.json d.pddl p.pddl"
BUILD = "build d.pddl p.pddl --tasks t.json"
UNDERSTAND, CHOICES, EXPORT = (f"{name} {ALL} w0" for name in ("understand", "choices", "export"))
VERIFY = f"verify {ALL} --tasks t.json --certificate proof.json --dimacs"
OVERWRITING = [
    *(f"{BUILD} -o {name}" for name in ("d.pddl", "p.pddl", "t.json", "in/../d.pddl")),
    f"{BUILD} -o x.json --certificate t.json",
    f"{UNDERSTAND} -o l.json",
    f"{CHOICES} -o d.pddl",
    f"{EXPORT} --to ltlf -o l.json",
    f"{EXPORT} --json -o p.pddl",
    f"{EXPORT} --translate-plan plan -o plan",
    "export l.json in/domain.pddl p.pddl w0 -o in",
    "export l.json d.pddl in/problem.pddl w0 -o in",
    "inspect in/domain.pddl in/problem.pddl --write in",
    "tasks d.pddl p.pddl -o p.pddl",
    *(f"{VERIFY} {name}" for name in (*ALL.split(), "t.json", "proof.json")),
    *(f"report {ALL} -o {name}" for name in ("l.json", "coordinates.json")),
    *(f"lift d.pddl p.pddl -o {name}" for name in ("p.pddl", "coordinates.json")),
    *(f"ground {ALL} -o {name}" for name in ("l.json", "coordinates.json")),
]


@pytest.mark.parametrize("line", OVERWRITING)
def test_no_input_file_is_overwritten(line: str, here: Shell) -> None:
    before = {path: path.read_bytes() for path in Path().rglob("*") if path.is_file()}
    outcome = here(line, 2, "would overwrite an input file\n  ")
    assert outcome.out == "" or json.loads(outcome.out)["error"]["exit_code"] == 2
    assert ("--json" in line) == (outcome.out != "")
    assert before == {path: path.read_bytes() for path in Path().rglob("*") if path.is_file()}


def test_links_devices_and_two_names_of_one_file(here: Shell) -> None:
    Path("link.json").symlink_to("t.json")
    here(f"{BUILD} -o link.json", 2, "-o link.json would overwrite an input file")
    for name in ("x.json", "./x.json", "in/../x.json"):
        said = f"-o and --certificate name the same file: {name}"
        here(f"{BUILD} -o x.json --certificate {name}", 2, said)
    here(f"{BUILD} -o new --resume new", 2, "-o and --resume name the same file")
    assert not any(Path(name).exists() for name in ("x.json", "new"))
    here(f"{BUILD} --method minimal -o /dev/null --certificate /dev/null")


TO_FILE = [
    f"{BUILD} -o",
    f"{BUILD} -o x.json --certificate",
    f"{UNDERSTAND} -o",
    f"{CHOICES} -o",
    VERIFY,
    f"report {ALL} -o",
    f"{EXPORT} --to ltlf -o",
    "tasks d.pddl p.pddl -o",
]

TO_FOLDER = [f"{EXPORT} -o", "inspect d.pddl p.pddl --write", "domains --copy grid"]
LONG = "x" * (os.pathconf("/", "PC_NAME_MAX") + 1)
UNWRITABLE = {
    "no/x": "there is no folder no",
    "plan/x": "there is no folder plan",
    "in": "Is a directory",
    "": "its name is empty",
    "new/": "this names a folder, and there is none",
    "new/.": "this names a folder, and there is none",
    "plan/": "this names a folder, and there is none",
    LONG: "File name too long",
    "loop": "Too many levels of symbolic links",
    "readonly": "the file is read-only",
    "link": "the file is read-only",
    "socket": "No such device or address",
}


@pytest.mark.parametrize(
    ("line", "place"),
    [
        *((line, "no/x") for line in TO_FILE),
        *((TO_FILE[1], place) for place in UNWRITABLE),
        *((line, place) for line in TO_FOLDER for place in ("", LONG)),
    ],
)
def test_the_place_is_looked_at_before_the_work(
    line: str, place: str, here: Shell, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(
        "coordlang.commands.inputs.read_domain", lambda *_: pytest.fail("no work before")
    )
    Path("loop").symlink_to("loop")
    Path("readonly").write_text("precious")
    Path("readonly").chmod(0o444)
    Path("link").symlink_to("readonly")
    with socket.socket(socket.AF_UNIX) as made:
        made.bind("socket")
    before = sorted(Path().rglob("*"))
    reason = f"cannot be written: {UNWRITABLE[place]}"
    said = f"{line.split()[-1]} {place} {reason}\n  Name a file"
    outcome = here(f"{line} {shlex.quote(place)}", 2, "written" if line in TO_FOLDER else said)
    assert outcome.out == ""
    with pytest.raises(UsageError, match=reason):
        write_atomically(place, b"new")
    assert sorted(Path().rglob("*")) == before
    assert Path("readonly").read_text() == "precious"


@pytest.mark.parametrize("line", [f"{BUILD} -o x.json --certificate", VERIFY])
def test_second_outputs_do_not_go_to_stdout(line: str, here: Shell) -> None:
    said = f"{line.split()[-1]} -: this cannot go to stdout\n  Name a file."
    assert here(f"{line} -", 2, said).out == ""
