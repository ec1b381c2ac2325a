# SPDX-License-Identifier: GPL-3.0-or-later
"""Idling is a rule of the model: no file, no start and no other problem changes a task's plans."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import coordlang
from coordlang.language.file import to_bytes
from tests.support.command import Command
from tests.support.domains import DOMAINS

#: A do-nothing action that is possible for a robot that is awake.
_REST = """(:action rest :agent ?r - robot :parameters () :precondition (awake ?r))
  (:action wake :agent ?r - robot :parameters () :precondition (not (awake ?r)) :effect (awake ?r))"""


@pytest.fixture
def files(tmp_path: Path) -> tuple[Path, Path, Path]:
    """A T-map with a cell ``far`` and an action ``rest``; r2 is awake in problem A, not in B."""
    domain = (DOMAINS / "t-map" / "domain.pddl").read_text()
    problem = (DOMAINS / "t-map" / "problem.pddl").read_text()
    domain = domain.replace("(:predicates", "(:predicates (awake ?r - robot)")
    domain = domain.rstrip().removesuffix(")") + _REST + ")"
    problem = problem.replace("c0-1\n", "c0-1 far\n", 1)
    paths = tmp_path / "domain.pddl", tmp_path / "a.pddl", tmp_path / "b.pddl"
    paths[0].write_text(domain)
    paths[1].write_text(problem.replace("(:init", "(:init (awake r1) (awake r2)"))
    paths[2].write_text(problem.replace("(:init", "(:init (awake r1)"))
    return paths


def test_a_tasks_plans_do_not_depend_on_other_problems(files: tuple[Path, Path, Path]) -> None:
    domain, a, b = files
    alone = [coordlang.plans(domain, problem).count for problem in (a, b)]
    assert [task.plans for task in coordlang.coordination(domain, a, b)] == alone
    assert [task.plans for task in coordlang.coordination(domain, b, a)] == alone[::-1]
    assert all(coordlang.coordination(domain, a, b))


def test_a_language_is_verified_in_the_model_of_the_domain(
    files: tuple[Path, Path, Path], tmp_path: Path
) -> None:
    domain, a, b = files
    built = coordlang.build(domain, a, method="greedy")
    path = tmp_path / "a.json"
    built.language.save(path)
    assert "idle" not in json.loads(path.read_text())["model"]
    again = coordlang.build(domain, b, start=path)
    assert again.tasks == 2
    assert again.first_differences.requiring == 2
    assert coordlang.verify(again.language, domain, a, b)


def test_a_file_with_another_rule_is_refused(
    files: tuple[Path, Path, Path], tmp_path: Path
) -> None:
    """One with the same rule is read."""
    domain, a, _ = files
    data = json.loads(to_bytes(coordlang.build(domain, a, method="greedy").language))
    path = tmp_path / "old.json"
    for idle in (["r1"], [], ["r1", "r2", "r3"]):
        path.write_text(json.dumps({**data, "model": {**data["model"], "idle": idle}}))
        with pytest.raises(coordlang.BadInput, match="some robot might not idle") as refused:
            coordlang.verify(path, domain, a)
        assert "coordlang build" in str(refused.value)
    path.write_text(json.dumps({**data, "model": {**data["model"], "idle": ["r2", "r1"]}}))
    assert coordlang.verify(path, domain, a)
    assert "idle" not in coordlang.load_language(path).provenance.model


def test_a_plan_with_what_is_left_out(
    files: tuple[Path, Path, Path], tmp_path: Path, coordlang: Command
) -> None:
    domain, a, _ = files
    language, plan = tmp_path / "l.json", tmp_path / "plan"
    assert coordlang("build", domain, a, "--method", "greedy", "-o", language).code == 0
    actions = [["(move r1 c0-1 c1-1)", "(rest r2)"]]
    for text in (
        "0: (rest r2)\n0: (move r1 c0-1 c1-1)\n",
        json.dumps({"plans": [{"cost": 1, "actions": actions}], "count": 1}),
    ):
        plan.write_text(text)
        refused = coordlang("say", language, domain, a, plan)
        assert refused.code == 1
        assert "(rest r2)" in refused.err
        assert "idling" in refused.err
    assert "rest: idling" in coordlang("inspect", domain, a).out


def test_all_pairs_are_those_of_the_same_states(tmp_path: Path) -> None:
    """As many states are reachable from a mirrored start, but other ones."""
    folder = DOMAINS / "t-map"
    domain, text = folder / "domain.pddl", (folder / "problem.pddl").read_text()
    walls = text.replace("(adjacent c1-0 c1-1)", "").replace("(adjacent c1-1 c1-0)", "")
    problems = []
    for number, start in enumerate(("(at r1 c1-0) (at r2 c1-1)", "(at r2 c1-0) (at r1 c1-1)")):
        problems.append(tmp_path / f"p{number}.pddl")
        problems[-1].write_text(walls.replace("(at r1 c0-1) (at r2 c1-0)", start))
    language = coordlang.build(domain, problems[0], tasks="all", method="greedy").language
    assert coordlang.verify(language, domain, problems[0])
    with pytest.raises(coordlang.BadInput, match="all pairs of other states"):
        coordlang.verify(language, domain, problems[1])
