# SPDX-License-Identifier: GPL-3.0-or-later
"""The plans with the fewest actions, cut out of the space, against a search under that cost."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from coordlang.required.task_answers import fewest_actions, requiring
from planners.loading import PlanningInstance, build
from planners.pddl.model_options import ModelOptions
from planners.search.optimal_plans import search
from planners.search.plan_space import PlanSpace
from planners.search.plans import Plans
from planners.system.errors import ProvedImpossible
from tests.support import naive, thorough
from tests.support.command import Command
from tests.support.domains import files_of
from tests.support.joint_twin import built
from tests.support.random_pddl import Kind, random_model
from tests.support.texts import parsed

Plan = tuple[tuple[str | None, ...], ...]


def listed(space: PlanSpace) -> set[Plan]:
    """All plans of the task, as texts; none if they are too many."""
    plans = Plans.of(space)
    return {tuple(map(space.model.texts, p)) for p in plans} if plans.count <= 400 else set()


def plans(loaded: PlanningInstance) -> set[Plan]:
    return listed(search(loaded.model, loaded.tasks[0]))


@pytest.mark.parametrize(("kind", "number"), [("agent", 36), *thorough(("plain", 75))])
def test_they_are_the_plans_of_the_other_cost(kind: Kind, number: int) -> None:
    cut = mixed = 0
    for seed in range(number):
        text = random_model(seed, kind)
        try:
            least, cheap = built(text), built(text, "makespan+actions")
            space = search(least.model, least.tasks[0])
        except ProvedImpossible:
            continue
        expected = plans(cheap)
        if not expected or not plans(least):
            continue
        fewer = fewest_actions(space)
        if fewer is None:
            assert expected == plans(least)
            assert requiring([space]) is None
            continue
        cut += 1
        assert listed(fewer) == expected
        if len(expected) ** len(least.model.robots) <= 20_000:
            mixed += 1
            assert requiring([space]) == any(naive.failing([*expected], space.robots))  # type: ignore[list-item]
        assert fewest_actions(search(cheap.model, cheap.tasks[0])) is None
    assert min(cut, mixed) >= 5


def test_of_joint_actions_the_parts_count() -> None:
    domain_text, text = (path.read_text() for path in files_of("grid-joint", "gw1-2x2"))
    goal = "(:goal (at r1 c1-1)))"
    domain, problem = parsed(domain_text, text[: text.index("(:goal")] + goal)
    least, cheap = (
        build(domain, [problem], ModelOptions(cost=cost))
        for cost in ("makespan", "makespan+actions")
    )
    fewer = fewest_actions(search(least.model, least.tasks[0]))
    assert fewer is not None
    assert listed(fewer) == plans(cheap) < plans(least)


#: r1 goes from a to d by b or c; r2 has nothing to do, and may stand in its way at either.
WANDER = """(define (problem wander) (:domain three-cells)
 (:objects r1 r2 - robot a b c d p - cell)
 (:init (at r1 a) (at r2 p) (adjacent a b) (adjacent b a) (adjacent a c) (adjacent c a)
  (adjacent b d) (adjacent d b) (adjacent c d) (adjacent d c)
  (adjacent p b) (adjacent b p) (adjacent p c) (adjacent c p))
 (:goal (at r1 d)))"""


def test_coordination_says_so_in_one_line(coordlang: Command) -> None:
    files = files_of("grid", "three-robots-3x3")
    outcome = coordlang("coordination", *files)
    line = "With --cost makespan+actions, which leaves 112 plans, they fail in 19.7 %.\n"
    assert outcome.out.count(line) == 1
    data = json.loads(coordlang("coordination", *files, "--json").out)["tasks"][0]
    assert data["fewest_actions"]["plans"] == 112
    said = coordlang("coordination", *files, "--json", "--cost", "makespan+actions").out
    other = json.loads(said)["tasks"][0]
    assert data["fewest_actions"] == {
        key: other[key] for key in ("plans", "requires_coordination", "failure")
    }
    assert "fewest_actions" not in other
    assert "With --cost" not in coordlang("coordination", *files_of("three-cells")).out


def test_build_says_so_in_one_line(coordlang: Command, tmp_path: Path) -> None:
    (domain, shipped), problem = files_of("three-cells"), tmp_path / "wander.pddl"
    problem.write_text(WANDER)
    files = domain, problem, "-o", tmp_path / "l.json"
    key = "tasks_requiring_coordination_with_fewest_actions"
    line = (
        "with --cost makespan+actions 0 tasks would require coordination, not 1: one word would do"
    )
    assert line in coordlang("build", *files).out.splitlines()
    assert json.loads(coordlang("build", *files, "--json").out)[key] == 0
    said = coordlang("build", *files, "--json", "--cost", "makespan+actions")
    figures = json.loads(said.out)
    assert (figures["tasks_requiring_coordination"], figures["words"]) == (0, 1)
    assert key not in figures
    assert "With --cost makespan+actions, which leaves 2 plans, coordination is not required." in (
        coordlang("coordination", domain, problem).out.splitlines()
    )
    assert "with --cost" not in coordlang("build", domain, shipped, *files[2:]).out
