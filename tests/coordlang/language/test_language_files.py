# SPDX-License-Identifier: GPL-3.0-or-later
"""A language file is believed only as far as it can be checked; older files, and task files."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import coordlang as library
from tests.support.command import Command
from tests.support.domains import T_MAP, files_of


def edit(path: Path, **changes: object) -> None:
    path.write_text(json.dumps(json.loads(path.read_text()) | changes))


def test_a_key_in_another_order_is_refused(coordlang: Command, language: Path) -> None:
    """A robot looks states up by their key: what it would not find must not be verified."""
    states = json.loads(language.read_text())["states"]
    atoms = {key: key.replace(") (", ")|(").split("|") for key in states}
    edit(language, states={" ".join(atoms[key][::-1]): word for key, word in states.items()})
    outcome = coordlang("verify", language, *T_MAP)
    assert outcome.code == 31
    assert "is no key of a state; it would be" in outcome.err


SWAP = {"init": ["(at r1 c0-1)", "(at r2 c1-0)"], "goal": ["(at r1 c1-0)", "(at r2 c0-1)"]}
STAY = {"init": ["(at r1 c0-1)", "(at r2 c1-0)"], "goal": ["(at r1 c0-1)"]}


@pytest.mark.parametrize(
    ("command", "tasks", "message"),
    [
        ("verify", {"kind": "problems", "count": 0, "tasks": [SWAP]}, "records 0 tasks but"),
        ("explain", {"kind": "file", "count": 2, "tasks": [SWAP]}, "records 2 tasks but lists 1"),
    ],
)
def test_contradictions(
    command: str, tasks: dict[str, object], message: str, coordlang: Command, language: Path
) -> None:
    edit(language, tasks=tasks)
    outcome = coordlang(command, language, *T_MAP)
    assert outcome.code == 31
    assert message in outcome.err


@pytest.mark.parametrize(
    "files", [T_MAP, files_of("grid-joint", "three-cells")], ids=["t-map", "grid-joint"]
)
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


def test_a_task_that_is_there_twice_counts_once(coordlang: Command, tmp_path: Path) -> None:
    swapped = {"init": ["(AT r2  c1-0)", *SWAP["init"]], "goal": SWAP["goal"][::-1]}
    means = []
    for number, tasks in enumerate(([SWAP, STAY], [SWAP, swapped, STAY, SWAP])):
        file = tmp_path / f"{number}.json"
        file.write_text(json.dumps({"format": "coordlang/tasks", "version": 1, "tasks": tasks}))
        output = tmp_path / f"{number}-language.json"
        outcome = coordlang("build", *T_MAP, "--tasks", file, "--words", 1, "-o", output)
        repeated = "2 of 4 tasks repeat another one: every task counts once"
        assert (repeated in outcome.err) == (number == 1)
        means.append(library.load_language(output).tolerance)
        edit(output, tasks={"kind": "file", "count": len(tasks), "tasks": tasks})
        assert json.loads(coordlang("verify", output, *T_MAP, "--json").out)["tasks"] == 2
    found, other = means
    assert found is not None
    assert found.failure_mean is not None
    assert found.failure_worst == 2 * found.failure_mean > 0
    assert found == other
    assert len(library.build(*T_MAP, T_MAP[1]).language.provenance.tasks["tasks"]) == 1


DOMAIN = """(define (domain lane) ; the first two cells of a lane, and a bay
  (:requirements :typing :multi-agent)
  (:types robot cell)
  (:predicates (at ?r - robot ?c - cell) (near ?a ?b - cell))
  (:action move :agent ?r - robot :parameters (?a ?b - cell)
    :precondition (and (at ?r ?a) (near ?a ?b)
      (forall (?o - robot) (and (not (at ?o ?b)) (not (move ?o ?a ?b)) (not (move ?o ?b ?a)))))
    :effect (and (not (at ?r ?a)) (at ?r ?b))))
"""
PROBLEM = """(define (problem swap) (:domain lane) (:objects r1 r2 - robot a b bay - cell)
  (:init (at r1 a) (at r2 b) (near a b) (near b a) (near b bay) (near bay b) (near a bay) (near bay a))
  (:goal (and (at r1 b) (at r2 a))))
"""

#: As version 0.1.0 wrote it, before domains were hashed by what they say.
LANGUAGE = """{"format": "coordlang/language", "version": 1,
 "domain": {"name": "lane", "sha256": "3b50a7fc7873dbaea50ef32d93a3692d4c4d8868f4fc7e23d7f76ceb7aa93d36"}, "robots": ["r1", "r2"],
 "model": {"cost": "makespan", "unowned": "error", "remember_actions": false, "idle": ["r1", "r2"], "problem_sha256": "f5bf10e682925dce0a9194013affde3431c0cf3a0d7c74b525a3b4d163a5360c",
 "world_sha256": "3a637edb95e07a4656a3d57e59577906ca64a390e7169099025d4031daf78e35"},
 "tasks": {"kind": "problems", "count": 1, "tasks": [{"init": ["(at r1 a)", "(at r2 b)"], "goal": ["(at r1 b)", "(at r2 a)"]}]}, "words": ["w0", "w1", "w2"],
 "states": {"(at r1 a) (at r2 b)": "w0", "(at r1 a) (at r2 bay)": "w2", "(at r1 b) (at r2 a)": "w0", "(at r1 b) (at r2 bay)": "w0", "(at r1 bay) (at r2 a)": "w0", "(at r1 bay) (at r2 b)": "w1"}, "default": "w0",
 "guarantee": {"method": "greedy", "size": 3, "lower_bound": 2, "proved_minimal": false}, "producer": {"program": "coordlang", "version": "0.1.0"}}"""


@pytest.fixture
def files(tmp_path: Path) -> tuple[Path, Path, Path]:
    paths = tmp_path / "l.json", tmp_path / "d.pddl", tmp_path / "p.pddl"
    for path, text in zip(paths, (LANGUAGE, DOMAIN, PROBLEM), strict=True):
        path.write_text(text)
    return paths


def test_it_is_read_by_every_command(coordlang: Command, files: tuple[Path, Path, Path]) -> None:
    language = files[0]
    assert "3 words" in coordlang("verify", *files).out
    plan = coordlang("plan", *files, "--prefer", "shortest")
    assert "; sentence = w0 w1 w0" in plan.out
    path = language.with_name("plan")
    path.write_text(plan.out)
    assert coordlang("say", *files, path).out == "w0 w1 w0\n"
    for name in ("understand", "choices", "export"):
        assert coordlang(name, *files, "w0 w1 w0").code == 0
    for more in (("explain", *files, "--task"), ("report", *files, "-o", path.with_name("r.html"))):
        assert coordlang(*more).code == 0


def test_its_hash_is_that_of_the_text(coordlang: Command, files: tuple[Path, Path, Path]) -> None:
    """A comment that changed is another domain for an older file, and for a new one it is not."""
    language, domain, problem = files
    new = language.with_name("new.json")
    assert coordlang("build", domain, problem, "--method", "greedy", "-o", new).code == 0
    domain.write_text(DOMAIN.replace("a bay\n", "a bay to wait in\n"))
    assert coordlang("verify", *files).code == 31
    assert coordlang("verify", new, domain, problem).code == 0
