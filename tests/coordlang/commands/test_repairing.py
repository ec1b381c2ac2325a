# SPDX-License-Identifier: GPL-3.0-or-later
"""``build --start``: a language for more tasks, on a changed map, or as it was."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import pytest

from planners.system.errors import OutOfTime
from tests.coordlang.commands.conftest import FILES, Shell

CELLS = FILES["CELLS"]
GRID, SMALL = FILES["SMALL"]


def build(shell: Shell, line: str) -> dict[str, Any]:
    """Build with ``--json``, which must end well; the figures."""
    found: dict[str, Any] = json.loads(shell(f"build {line} --json").out)
    return found


def parts(path: str) -> dict[str, Any]:
    """What a language file says, without its provenance."""
    file = json.loads(Path(path).read_text())
    return {key: file[key] for key in ("words", "states", "default")}


def test_more_tasks(shell: Shell) -> None:
    """From one task to all: states that are new get words, and one that was there another one."""
    build(shell, "SMALL --method separating -o old.json")
    figures = build(shell, "SMALL --tasks all --start old.json -o new.json")
    repair = figures["repair"]
    assert (figures["method"], figures["tasks"]) == ("repair", 870)
    assert not repair["still_holds"]
    assert repair["miscoordination"]["sentence"]
    assert len(repair["changed"]) == repair["changed_lower_bound"] == 1
    assert len(repair["new_words"]) == repair["new_words_lower_bound"] == 2
    assert repair["new_states"] == 20
    before, after = parts("old.json")["states"], parts("new.json")["states"]
    changed = {key for key, word in before.items() if after[key] != word}
    assert changed == {change["state"] for change in repair["changed"]}
    for change in repair["changed"]:
        assert (before[change["state"]], after[change["state"]]) == (change["old"], change["new"])
    shell("verify new.json SMALL")
    shell("verify old.json SMALL --tasks all", 1)


def test_it_says_which_and_why(shell: Shell) -> None:
    shell("build CELLS --method minimal -o old.json")
    outcome = shell(
        "build CELLS --tasks all --start old.json -o new.json --certificate proof.json",
        0,
        'the old language fails: plans with the sentence "w',
        "breaks here",
        "2 states change their word, proved the fewest; 1 new word (w2)",
    )
    assert outcome.out.count(" -> w2\n") == 2
    shell("verify new.json CELLS --certificate proof.json")
    # Again, and it holds: the same words, for the tasks that are asked for now.
    said = "the old language still holds: no word is changed"
    shell("build CELLS --tasks all --start new.json -o again.json", 0, said)
    assert parts("again.json") == parts("new.json")
    before = Path("new.json").read_bytes()
    shell("build CELLS --start new.json -o new.json", 2)
    assert Path("new.json").read_bytes() == before


def test_tasks_are_added_to_those_recorded(shell: Shell) -> None:
    """The new language serves the old tasks, too: they are in its file, each once."""
    text = Path(SMALL).read_text()
    Path("other.pddl").write_text(text.replace("(at r1 c1-2) (at r2 c0-0)", "(at r1 c0-1)"))
    build(shell, "SMALL --method minimal -o old.json")
    assert build(shell, f"{GRID} other.pddl --start old.json -o new.json")["tasks"] == 2
    tasks = json.loads(Path("new.json").read_text())["tasks"]
    goals = [["(at r1 c1-2)", "(at r2 c0-0)"], ["(at r1 c0-1)"]]
    assert [task["goal"] for task in tasks["tasks"]] == goals
    shell("verify new.json SMALL")
    for task in tasks["tasks"]:
        task["init"] = [atom.upper() for atom in reversed(task["init"])]
    data = json.loads(Path("new.json").read_text()) | {"tasks": tasks}
    Path("new.json").write_text(json.dumps(data))
    line = f"{GRID} other.pddl {SMALL} --start new.json -o both.json"
    assert build(shell, line)["tasks"] == 2
    # A task file joins them.
    task = {"init": ["(at r1 c0-1)", "(at r2 c0-0)"], "goal": ["(at r2 c0-2)"]}
    data = {"format": "coordlang/tasks", "version": 1, "tasks": [task]}
    Path("tasks.json").write_text(json.dumps(data))
    line = "SMALL --tasks tasks.json --start new.json -o 3.json"
    assert build(shell, line)["tasks"] == 3
    shell("verify 3.json SMALL")
    said = "the recorded goal (at r1 c0-1) is one of several states"
    shell("build SMALL --tasks all --start 3.json -o all.json", 31, said)


def test_a_changed_map(shell: Shell) -> None:
    """A way is closed, and then a place is gone: states that are none any more are left out."""
    build(shell, "SMALL --tasks all --method minimal -o old.json")
    text = Path(SMALL).read_text()
    closed = text.replace("(adjacent c0-1 c1-1)", "").replace("(adjacent c1-1 c0-1)", "")
    Path("closed.pddl").write_text(closed)
    shell(f"verify old.json {GRID} closed.pddl", 31)
    figures = build(shell, f"{GRID} closed.pddl --tasks all --start old.json -o new.json")
    repair = figures["repair"]
    assert len(repair["changed"]) == repair["changed_lower_bound"] > 0
    assert len(repair["new_words"]) <= len(repair["changed"])
    assert figures["lower_bound"] == 2  # the bound of another map is none
    shell(f"verify new.json {GRID} closed.pddl")
    gone = text.replace("c1-1 c1-2 - cell", "c1-2 - cell").replace("c1-0 c1-1 c1-2", "c1-0 c1-2")
    gone = re.sub(r"\(adjacent (c1-1 \S+|\S+ c1-1)\)", "", gone)
    Path("smaller.pddl").write_text(gone)
    said = "10 states of the old language: not on this map"
    shell(f"build {GRID} smaller.pddl --tasks all --start old.json -o new.json", 0, said)
    shell(f"verify new.json {GRID} smaller.pddl")


@pytest.mark.parametrize(
    ("line", "code", "said"),
    [
        ("T-MAP", 31, "this language belongs to another domain"),
        ("CELLS --method minimal", 2, "--start and --"),
        ("CELLS --alpha-only --method separating", 2, "--start and --"),
        ("CELLS --cost makespan+actions", 2, "--cost makespan+actions contradicts"),
        ("CELLS", 31, "this language serves all pairs of states, and others cannot be added"),
    ],
)
def test_what_cannot_be_repaired(line: str, code: int, said: str, shell: Shell) -> None:
    shell("build CELLS --tasks all --method greedy -o old.json")
    shell(f"build {line} --start old.json -o new.json", code, said)
    assert not Path("new.json").exists()


def test_fewer_pairs_than_it_serves(shell: Shell) -> None:
    """A door that only opens: from where it is open there are fewer pairs."""
    domain, shut, ajar = (Path(f"{name}.pddl") for name in ("domain", "shut", "ajar"))
    domain.write_text(
        "(define (domain door) (:types robot) (:predicates (open) (key ?r - robot) (in ?r - robot))\n"
        "(:action push :agent ?r - robot :parameters () :precondition (key ?r) :effect (open))\n"
        "(:action enter :agent ?r - robot :parameters () :precondition (open) :effect (in ?r)))"
    )
    text = (
        "(define (problem p) (:domain door) (:objects r1 r2 - robot)\n"
        "(:init (key r1) {}) (:goal (and (in r1) (in r2))))"
    )
    shut.write_text(text.format(""))
    ajar.write_text(text.format("(open)"))
    figures = build(shell, "domain.pddl shut.pddl --tasks all -o old.json")
    said = f"serves {figures['tasks']} pairs of states, but these problems have"
    again = "--tasks all --start old.json -o new.json"
    shell(f"build domain.pddl ajar.pddl {again}", 31, said)
    shell(f"build domain.pddl shut.pddl {again}")
    # From where r1 is in there are more pairs than from where r2 is, but not those.
    first, second = Path("first.pddl"), Path("second.pddl")
    first.write_text(text.format("(in r1)"))
    second.write_text(text.format("(open) (in r2)"))
    for tasks, said in (
        ("", "do not reach both states of the recorded task (in r2) (open)"),
        ("--tasks all", "of states, but these problems do not reach all"),
    ):
        shell(f"build domain.pddl second.pddl {tasks} -o old.json")
        shell(f"build domain.pddl first.pddl {again}", 31, said)
        shell(f"build domain.pddl first.pddl second.pddl {again}")


def test_stopped_repairs_are_written(shell: Shell, monkeypatch: pytest.MonkeyPatch) -> None:
    build(shell, "SMALL --method separating -o old.json")
    late = Mock(side_effect=OutOfTime("the time limit is over"))
    monkeypatch.setattr("coordlang.vocabulary.repair._Repair._hit_least", late)
    shell(
        "build SMALL --tasks all --start old.json -o new.json",
        3,
        "the best language so far is written, without proof",
        "1 state changes its word, not proved the fewest; 20 new states; 3 new w",
    )
    shell("verify new.json SMALL")
