# SPDX-License-Identifier: GPL-3.0-or-later
"""Plans as PlanSys2 reads them, by a reader that does what PlanSys2's does; and back."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from planners.search.optimal_plans import search
from planners.search.plan_file import read_plans, to_ipc, to_json, to_plansys2
from planners.search.plans import Plans, texts
from tests.support.command import Command
from tests.support.domains import DOMAINS, loaded_from


def items(text: str) -> list[tuple[float, str, float]]:
    """What `POPFPlanSolver::getPlan` of PlanSys2 makes of a planner's output, line by line.

    Written from its source: nothing before "Solution Found" counts, comments are left out, and every
    other line is cut at its first colon, closing parenthesis and opening bracket.
    """
    found: list[tuple[float, str, float]] = []
    begun = False
    for line in text.split("\n")[:-1]:
        if not begun:
            begun = "Solution Found" in line
        elif line[0] != ";":
            colon, closing, bracket = line.find(":"), line.find(")"), line.find("[")
            action = line[colon + 2 :][: closing - colon - 1]
            found.append((float(line[:colon]), action, float(line[bracket + 1 : -1])))
    return found


WORLDS = (
    "three-cells/problem grid/corners-3x3 grid-joint/three-cells handover/exchange flags/parade"
)


@pytest.mark.parametrize("name", WORLDS.split())
def test_plansys2_reads_each_plan_and_so_do_we(name: str, tmp_path: Path) -> None:
    folder, stem = name.split("/")
    loaded = loaded_from(folder, stem)
    plans = Plans.of(search(loaded.model, loaded.tasks[0]))
    path = tmp_path / "plan"
    for plan in plans.sample(10, seed=1):
        path.write_text(to_plansys2(plans, plan))
        assert read_plans(path, loaded.model) == [texts(loaded.model, plan)]
        data = to_json(plans, [plan])
        data["robots"].reverse()
        for listed in data["plans"]:
            listed["actions"] = [step[::-1] for step in listed["actions"]]
        (tmp_path / "json").write_text(json.dumps(data))
        assert read_plans(tmp_path / "json", loaded.model) == [texts(loaded.model, plan)]
        read = items(path.read_text())
        assert {duration for _, _, duration in read} == {1.0}
        joint = loaded.model.is_joint_action
        lines = [action if joint else f"{time:.0f}: {action}" for time, action, _ in read]
        assert lines == to_ipc(plans, plan).splitlines()[:-1]
        assert [time for time, _, _ in read] == sorted(time for time, _, _ in read)


def test_command(coordlang: Command, tmp_path: Path) -> None:
    files = DOMAINS / "three-cells" / "domain.pddl", DOMAINS / "three-cells" / "problem.pddl"
    language = tmp_path / "l.json"
    coordlang("build", *files, "--method", "greedy", "-o", language)
    shown = coordlang("plan", language, *files, "w1 w0", "--format", "plansys2").out
    moves = [(0.0, "(move r1 a c)"), (1.0, "(move r1 c b)"), (1.0, "(move r2 b a)")]
    assert [(time, action) for time, action, _ in items(shown)] == moves
    as_json = coordlang("plan", language, *files, "w1 w0", "--format", "json").out
    assert as_json == coordlang("plan", language, *files, "w1 w0", "--json").out
    assert coordlang("plan", language, *files, "w1 w0", "--json", "--format", "ipc").code == 2
    path = tmp_path / "plan"
    path.write_text(shown)
    assert coordlang("say", language, *files, path).out == "w1 w0\n"
    path.write_text(shown.replace("1.000: ", "1.500: "))
    assert coordlang("say", language, *files, path).code == 31
