# SPDX-License-Identifier: GPL-3.0-or-later
"""Varied tasks: the pairs that the patterns describe, and no others."""

from __future__ import annotations

import json
import re
from itertools import product
from pathlib import Path

import networkx as nx
import pytest

from coordlang.language.candidates import from_listed
from coordlang.language.listed import ListedTask, read_task_file, varied_tasks
from planners.loading import PlanningInstance
from planners.system.errors import UsageError
from tests.support.command import Command
from tests.support.domains import DOMAINS, loaded_from
from tests.support.naive_joint_steps import Twin


def matches(atom: str, pattern: str) -> bool:
    """Word by word, a ``?`` for any one."""
    mine, theirs = (text.strip("()").split() for text in (atom, pattern))
    return len(mine) == len(theirs) and all(
        b in ("?", a) for a, b in zip(mine, theirs, strict=True)
    )


def naive(
    loaded: PlanningInstance, starts: list[str], goals: list[str]
) -> set[tuple[frozenset[str], frozenset[str]]]:
    """The definition, with sets of atoms."""
    twin = Twin(loaded.domain, loaded.problems[0], loaded.team)
    states = twin.reachable()
    text = {
        state: frozenset(f"({' '.join((a.predicate, *a.args))})" for a in state) for state in states
    }
    own = text[twin.init]
    chosen = {s for s in states if all(any(matches(a, p) for p in starts) for a in text[s] ^ own)}
    wanted = {
        frozenset(atoms)
        for state in states
        for atoms in product(*([a for a in text[state] if matches(a, goal)] for goal in goals))
    }
    steps = nx.DiGraph((state, after) for state in states for _, after in twin.successors(state))
    found = set()
    for start in chosen:
        reached = {start, *nx.descendants(steps, start)}
        for goal in wanted:
            if not goal <= text[start] and any(goal <= text[state] for state in reached):
                found.add((text[start], goal))
    return found


@pytest.mark.parametrize(
    ("folder", "problem", "starts", "goals", "number"),
    [
        ("three-cells", "problem", [], ["(at r1 ?)"], 2),
        ("three-cells", "problem", ["(at ? ?)"], ["(at r1 ?)", "(at r2 ?)"], 30),
        ("three-cells", "problem", ["(at r1 ?)"], ["(at r2 c)"], 2),
        ("handover", "two-doors", ["(at r1 ?)", "(at r2 ?)"], ["(lies box ?)"], 9),
        ("vans", "one-van", ["(at d1 ?)"], ["(at v1 ?)", "(vacant ?)"], None),
        ("lock", "both-in", ["(at r1 ?)"], ["(at r1 ?)"], None),
        ("elevator", "two-calls", ["(stops ?)"], ["(on ? second)", "(outside ?)"], None),
        ("charger", "three-robots", ["(charged ?)"], ["(charged ?)", "(charged ?)"], None),
    ],
)
def test_the_tasks_are_those_of_the_definition(
    folder: str, problem: str, starts: list[str], goals: list[str], number: int | None
) -> None:
    loaded = loaded_from(folder, problem)
    tasks = varied_tasks(loaded, starts, goals)
    assert len(set(tasks)) == len(tasks)
    assert {(frozenset(t.init), frozenset(t.goal)) for t in tasks} == naive(loaded, starts, goals)
    assert number is None or len(tasks) == number
    assert from_listed(loaded.domain, loaded.problems, tasks).count == len(tasks)


def test_without_goals_it_is_the_problems_own() -> None:
    loaded = loaded_from("lock", "both-in")
    assert varied_tasks(loaded, [], []) == (
        ListedTask(("(at r1 yard)", "(at r2 yard)"), ("(at r1 lab)", "(at r2 lab)")),
    )
    assert {task.goal for task in varied_tasks(loaded, ["(at ? ?)"], [])} == {
        ("(at r1 lab)", "(at r2 lab)")
    }


def test_a_pattern_that_matches_nothing() -> None:
    loaded = loaded_from("lock", "both-in")
    for wrong in ("(on r1 ?)", "(at r1)", "at r1 ?", "(at r1 ? ?)", "(switch outer yard)", ""):
        with pytest.raises(
            UsageError, match=re.escape(f"no fluent of this problem matches {wrong}")
        ):
            varied_tasks(loaded, [], [wrong])


def test_the_command_writes_what_build_reads(coordlang: Command, tmp_path: Path) -> None:
    files = [DOMAINS / "three-cells" / name for name in ("domain.pddl", "problem.pddl")]
    output = tmp_path / "tasks.json"
    two = "--start", "(AT  r1 ?)", "--goal", "( at r2 ? )"
    written = coordlang("tasks", *files, *two, "-o", output, "--json")
    assert json.loads(written.out) == {"tasks": 4, "starts": 2, "goals": 2}
    assert len(read_task_file(output)) == 4
    shown = coordlang("tasks", *files, *two, "-o", "-")
    assert (shown.out, shown.err) == (output.read_text(), "4 tasks: 2 starts, 2 goals\n")
    assert coordlang("build", *files, "--tasks", output, "-o", tmp_path / "l.json").code == 0
    for goals, code in ((("(on r2 ?)",), 2), (("(at r1 a)", "(at r2 a)"), 11)):
        more = [text for goal in goals for text in ("--goal", goal)]
        assert coordlang("tasks", *files, *more, "-o", output).code == code
