# SPDX-License-Identifier: GPL-3.0-or-later
"""A language file is believed only as far as it can be checked."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.support.command import Command
from tests.support.domains import DOMAINS


def edit(path: Path, **changes: object) -> None:
    path.write_text(json.dumps(json.loads(path.read_text()) | changes))


def test_a_key_in_another_order_is_refused(
    coordlang: Command, language: Path, t_map: tuple[Path, Path]
) -> None:
    """A robot looks states up by their key: what it would not find must not be verified."""
    states = json.loads(language.read_text())["states"]
    atoms = {key: key.replace(") (", ")|(").split("|") for key in states}
    edit(language, states={" ".join(atoms[key][::-1]): word for key, word in states.items()})
    outcome = coordlang("verify", language, *t_map)
    assert outcome.code == 31
    assert "is no key of a state; it would be" in outcome.err


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"tasks": {"kind": "problems", "count": 2, "tasks": []}}, "records 2 tasks but lists 0"),
        ({"tasks": {"kind": "all", "count": 5}}, "the language records 5 tasks"),
    ],
)
def test_contradictions(
    changes: dict[str, object],
    message: str,
    coordlang: Command,
    language: Path,
    t_map: tuple[Path, Path],
) -> None:
    edit(language, **changes)
    outcome = coordlang("verify", language, *t_map)
    assert outcome.code == 31
    assert message in outcome.err


T_MAP = DOMAINS / "t-map" / "domain.pddl", DOMAINS / "t-map" / "problem.pddl"
GRID_JOINT = DOMAINS / "grid-joint" / "domain.pddl", DOMAINS / "grid-joint" / "three-cells.pddl"


@pytest.mark.parametrize("files", [T_MAP, GRID_JOINT], ids=["t-map", "grid-joint"])
def test_a_language_belongs_to_what_the_domain_says(
    files: tuple[Path, Path], coordlang: Command, tmp_path: Path
) -> None:
    """Not to its line ends, spacing and case, nor to comments that are not read."""
    domain, problem = files
    path, copy = tmp_path / "l.json", tmp_path / "copy.pddl"
    assert coordlang("build", *files, "--method", "greedy", "-o", path).code == 0
    text = domain.read_text()
    said = {
        "line ends": text.replace("\n", "\r\n"),
        "comments": "; a new first line\n" + text + "\n; the end ; subactions\n",
        "spacing": text.replace("\n", "\n\n ").replace("(", "  ( "),
        "case": "\n".join(line.upper() if ";" not in line else line for line in text.split("\n")),
        "byte order mark": "\ufeff" + text,
    }
    for what, other in said.items():
        copy.write_bytes(other.encode())
        assert coordlang("verify", path, copy, problem).code == 0, what
    renamed = text.replace("?to", "?where") if "?to" in text else text.replace("?a", "?where")
    for other in (renamed, text.replace("subaction r1 (move", "subaction r1 (drive")):
        if other != text:
            copy.write_text(other)
            outcome = coordlang("verify", path, copy, problem)
            assert (outcome.code, "belongs to another domain" in outcome.err) == (31, True)


@pytest.mark.parametrize("flags", [[], ["--remember-actions"]], ids=["states", "actions"])
def test_the_file_says_which_predicates_keys_hold(
    flags: list[str], coordlang: Command, tmp_path: Path
) -> None:
    path = tmp_path / "l.json"
    assert coordlang("build", *T_MAP, "--tasks", "all", *flags, "-o", path).code == 0
    data = json.loads(path.read_text())
    held = {atom.split("(")[1].split()[0] for key in data["states"] for atom in key.split(") ")}
    assert set(data["domain"]["fluents"]) == held
