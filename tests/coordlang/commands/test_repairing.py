# SPDX-License-Identifier: GPL-3.0-or-later
"""``build --start``: a language for more tasks, on a changed map, or as it was."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

import coordlang
from coordlang.commands.building import build_language
from coordlang.commands.repairing import repair_language
from coordlang.language.words import Language
from planners.system.errors import OutOfTime
from tests.support.command import Command
from tests.support.domains import DOMAINS, all_tasks, own_task

GRID = DOMAINS / "grid" / "domain.pddl"
SMALL = GRID, DOMAINS / "grid" / "gw2-2x3.pddl"
CELLS = DOMAINS / "three-cells" / "domain.pddl", DOMAINS / "three-cells" / "problem.pddl"
T_MAP = DOMAINS / "t-map" / "domain.pddl", DOMAINS / "t-map" / "problem.pddl"


def build(coordlang: Command, path: Path, *arguments: object) -> dict[str, Any]:
    """Build with ``--json``, which must end well; the figures."""
    outcome = coordlang("build", *arguments, "-o", path, "--json")
    assert outcome.code == 0, outcome.err
    found: dict[str, Any] = json.loads(outcome.out)
    return found


def parts(path: Path) -> dict[str, Any]:
    """What a language file says, without its provenance."""
    file = json.loads(path.read_text())
    return {key: file[key] for key in ("words", "states", "default")}


def test_more_tasks(coordlang: Command, tmp_path: Path) -> None:
    """From one task to all: states that are new get words, and one that was there another one."""
    old, new = tmp_path / "old.json", tmp_path / "new.json"
    build(coordlang, old, *SMALL, "--method", "minimal")
    figures = build(coordlang, new, *SMALL, "--tasks", "all", "--start", old)
    repair = figures["repair"]
    assert figures["method"] == "repair"
    assert figures["tasks"] == 870
    assert not repair["still_holds"]
    assert repair["miscoordination"]["sentence"]
    assert len(repair["changed"]) == repair["changed_lower_bound"] == 1
    assert len(repair["new_words"]) == repair["new_words_lower_bound"] == 2
    assert repair["new_states"] == 20
    before, after = parts(old)["states"], parts(new)["states"]
    changed = {key for key, word in before.items() if after[key] != word}
    assert changed == {change["state"] for change in repair["changed"]}
    for change in repair["changed"]:
        assert (before[change["state"]], after[change["state"]]) == (change["old"], change["new"])
    assert coordlang("verify", new, *SMALL).code == 0
    assert coordlang("verify", old, *SMALL, "--tasks", "all").code == 1


def test_it_says_which_and_why(coordlang: Command, tmp_path: Path) -> None:
    old, new = tmp_path / "old.json", tmp_path / "new.json"
    build(coordlang, old, *CELLS, "--method", "minimal")
    outcome = coordlang("build", *CELLS, "--tasks", "all", "--start", old, "-o", new)
    assert outcome.code == 0
    assert 'the old language fails: plans with the sentence "w' in outcome.out
    assert "breaks here" in outcome.out
    assert "2 states change their word, proved the fewest; 1 new word (w2)" in outcome.out
    assert outcome.out.count(" -> w2\n") == 2
    # Again, and it holds: the same words, for the tasks that are asked for now.
    again = tmp_path / "again.json"
    outcome = coordlang("build", *CELLS, "--tasks", "all", "--start", new, "-o", again)
    assert outcome.code == 0
    assert "the old language still holds: no word is changed" in outcome.out
    assert parts(again) == parts(new)


def test_a_language_that_still_holds_is_as_it_was(coordlang: Command, tmp_path: Path) -> None:
    """States that are on no plan of the tasks stay, too."""
    old, new = tmp_path / "old.json", tmp_path / "new.json"
    square = GRID, DOMAINS / "grid" / "gw1-2x2.pddl"
    build(coordlang, old, *square, "--tasks", "all", "--method", "minimal")
    figures = build(coordlang, new, *square, "--tasks", "all", "--start", old)
    assert figures["repair"]["still_holds"]
    assert (figures["words"], figures["lower_bound"], figures["proved_minimal"]) == (3, 2, False)
    assert parts(new) == parts(old)
    assert json.loads(new.read_text())["guarantee"]["method"] == "repair"


def test_tasks_are_added_to_those_recorded(coordlang: Command, tmp_path: Path) -> None:
    """The new language serves the old tasks, too: they are in its file, each once."""
    corners = DOMAINS / "grid" / "gw2-2x3.pddl"
    other = tmp_path / "other.pddl"
    text = corners.read_text()
    other.write_text(text.replace("(and (at r1 c1-2) (at r2 c0-0))", "(and (at r1 c0-1))"))
    old, new = tmp_path / "old.json", tmp_path / "new.json"
    build(coordlang, old, *SMALL, "--method", "minimal")
    figures = build(coordlang, new, GRID, other, "--start", old)
    assert figures["tasks"] == 2
    tasks = json.loads(new.read_text())["tasks"]
    assert [task["goal"] for task in tasks["tasks"]] == [
        ["(at r1 c1-2)", "(at r2 c0-0)"],
        ["(at r1 c0-1)"],
    ]
    assert coordlang("verify", new, *SMALL).code == 0
    figures = build(coordlang, tmp_path / "both.json", GRID, other, corners, "--start", new)
    assert figures["tasks"] == 2
    # A task file joins them.
    listed = tmp_path / "tasks.json"
    task = {"init": ["(at r1 c0-1)", "(at r2 c0-0)"], "goal": ["(at r2 c0-2)"]}
    listed.write_text(json.dumps({"format": "coordlang/tasks", "version": 1, "tasks": [task]}))
    figures = build(coordlang, tmp_path / "3.json", *SMALL, "--tasks", listed, "--start", new)
    assert figures["tasks"] == 3
    assert coordlang("verify", tmp_path / "3.json", *SMALL).code == 0


def test_a_changed_map(coordlang: Command, tmp_path: Path) -> None:
    """A way is closed, and then a place is gone: states that are none any more are left out."""
    old, new = tmp_path / "old.json", tmp_path / "new.json"
    build(coordlang, old, *SMALL, "--tasks", "all", "--method", "minimal")
    text = (DOMAINS / "grid" / "gw2-2x3.pddl").read_text()
    closed = tmp_path / "closed.pddl"
    closed.write_text(text.replace("(adjacent c0-1 c1-1)", "").replace("(adjacent c1-1 c0-1)", ""))
    assert coordlang("verify", old, GRID, closed).code == 31
    figures = build(coordlang, new, GRID, closed, "--tasks", "all", "--start", old)
    assert len(figures["repair"]["changed"]) == figures["repair"]["changed_lower_bound"] > 0
    assert len(figures["repair"]["new_words"]) <= len(figures["repair"]["changed"])
    assert figures["lower_bound"] == 2  # the bound of another map is none
    assert coordlang("verify", new, GRID, closed).code == 0
    lines = [
        line.replace("c1-1 c1-2", "c1-2") if line.startswith("    c1") else line
        for line in text.splitlines()
    ]
    smaller = tmp_path / "smaller.pddl"
    gone = "\n".join(lines)
    for place in ("c0-1", "c1-0", "c1-2"):
        gone = gone.replace(f"(adjacent c1-1 {place})", "").replace(f"(adjacent {place} c1-1)", "")
    smaller.write_text(gone)
    outcome = coordlang("build", GRID, smaller, "--tasks", "all", "--start", old, "-o", new)
    assert outcome.code == 0, outcome.err
    assert "10 states of the old language: not on this map" in outcome.out
    assert coordlang("verify", new, GRID, smaller).code == 0


@pytest.mark.parametrize(
    ("options", "code", "said"),
    [
        ([*T_MAP], 31, "this language belongs to another domain"),
        ([*CELLS, "--method", "minimal"], 2, "--start changes the words of a language"),
        (
            [*CELLS, "--alpha-only", "--method", "separating"],
            2,
            "--start changes the words of a language",
        ),
        ([*CELLS, "--cost", "makespan+actions"], 2, "--cost makespan+actions contradicts"),
        ([*CELLS], 31, "this language serves all pairs of states, and others cannot be added"),
    ],
)
def test_what_cannot_be_repaired(
    options: list[object], code: int, said: str, coordlang: Command, tmp_path: Path
) -> None:
    old, new = tmp_path / "old.json", tmp_path / "new.json"
    build(coordlang, old, *CELLS, "--tasks", "all")
    outcome = coordlang("build", *options, "--start", old, "-o", new)
    assert outcome.code == code
    assert said in outcome.err
    assert not new.exists()


def test_the_start_is_not_written_over(coordlang: Command, tmp_path: Path) -> None:
    old = tmp_path / "old.json"
    build(coordlang, old, *CELLS)
    before = old.read_bytes()
    assert coordlang("build", *CELLS, "--start", old, "-o", old).code == 2
    assert old.read_bytes() == before


def test_fewer_pairs_than_it_serves(coordlang: Command, tmp_path: Path) -> None:
    """A door that only opens: from where it is open there are fewer pairs."""
    domain = tmp_path / "domain.pddl"
    domain.write_text(
        "(define (domain door) (:types robot) (:predicates (open) (key ?r - robot) (in ?r - robot))\n"
        "(:action push :agent ?r - robot :parameters () :precondition (key ?r) :effect (open))\n"
        "(:action enter :agent ?r - robot :parameters () :precondition (open) :effect (in ?r)))"
    )
    text = (
        "(define (problem p) (:domain door) (:objects r1 r2 - robot)\n"
        "(:init (key r1) {}) (:goal (and (in r1) (in r2))))"
    )
    shut, ajar = tmp_path / "shut.pddl", tmp_path / "ajar.pddl"
    shut.write_text(text.format(""))
    ajar.write_text(text.format("(open)"))
    old = tmp_path / "old.json"
    figures = build(coordlang, old, domain, shut, "--tasks", "all")
    again = ("--tasks", "all", "--start", old, "-o", tmp_path / "new.json")
    outcome = coordlang("build", domain, ajar, *again)
    assert outcome.code == 31
    assert f"serves {figures['tasks']} pairs of states, but these problems have" in outcome.err
    assert coordlang("build", domain, shut, *again).code == 0


def test_stopped_repairs_are_written(
    coordlang: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    old, new = tmp_path / "old.json", tmp_path / "new.json"
    build(coordlang, old, *SMALL, "--method", "minimal")

    def late(*_: object) -> bool:
        raise OutOfTime("the time limit is over")

    monkeypatch.setattr("coordlang.vocabulary.repair._Repair._hit_least", late)
    outcome = coordlang("build", *SMALL, "--tasks", "all", "--start", old, "-o", new)
    assert outcome.code == 3
    assert "the best language so far is written, without proof" in outcome.err
    assert "1 state changes its word, not proved the fewest; 20 new states; 3 new w" in outcome.out
    assert coordlang("verify", new, *SMALL).code == 0


def test_states_on_no_plan_keep_their_words() -> None:
    """One word for the states of a task, which does not do, and another one for all others."""
    candidates = all_tasks("grid", "gw2-2x3")
    keys = candidates.model.codec.key
    task = own_task("grid", "gw2-2x3")
    on_plans = {keys(task.rows[s]) for s in build_language(task, "greedy").job.states}
    words = {keys(row): "go" if keys(row) in on_plans else "away" for row in candidates.rows}
    old = Language(("away", "go"), words, "away")
    built = repair_language(task, old)
    repaired = built.repaired
    assert repaired is not None
    assert repaired.changed
    changed = {change.state for change in repaired.changed}
    assert changed < on_plans
    assert {key for key, word in words.items() if built.language.states[key] != word} == changed
    assert len(built.language.states) == 30
    assert built.language.default == "away"
    assert built.verdict.holds


def test_the_certificate_of_a_repaired_language(coordlang: Command, tmp_path: Path) -> None:
    old, new, proof = (tmp_path / f"{name}.json" for name in ("old", "new", "proof"))
    build(coordlang, old, *CELLS, "--method", "minimal")
    build(coordlang, new, *CELLS, "--tasks", "all", "--start", old, "--certificate", proof)
    assert coordlang("verify", new, *CELLS, "--certificate", proof).code == 0


def test_a_false_bound_is_not_carried_over() -> None:
    """A file that claims more words to be needed than the repaired language has."""
    found = build_language(own_task("three-cells"), "greedy").language
    guarantee = replace(found.guarantee, size=3, lower_bound=9)
    candidates = all_tasks("three-cells")
    false = replace(found, provenance=replace(found.provenance, guarantee=guarantee))
    for start, bound in ((false, 2), (found, 2)):
        built = repair_language(candidates, start)
        assert built.language.guarantee.lower_bound == bound
        assert built.verdict.holds


def test_from_python() -> None:
    one = coordlang.build(*CELLS, method="minimal")
    all_of_it = coordlang.build(*CELLS, tasks="all", start=one.language)
    assert one.repaired is None
    repaired = all_of_it.repaired
    assert repaired is not None
    assert not repaired.still_holds
    assert [change.new for change in repaired.changed] == ["w2", "w2"]
    assert coordlang.verify(all_of_it.language, *CELLS)
    again = coordlang.build(*CELLS, tasks="all", start=all_of_it.language)
    assert again.repaired is not None
    assert again.repaired.still_holds
