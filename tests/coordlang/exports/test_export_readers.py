# SPDX-License-Identifier: GPL-3.0-or-later
"""Exports for planners that refuse negative goals (K*), or know neither negation nor costs."""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import pytest

import coordlang as door
from coordlang.commands.building import build_language
from coordlang.commands.export import ExportedTask
from coordlang.execution.task_language import TaskLanguage, languages_in_tasks
from coordlang.language.candidates import from_problems
from planners.classical import ClassicalTask, with_positive_conditions, with_positive_goal
from planners.pddl import parse_domain, parse_problem
from planners.pddl.sexpr import Source
from planners.system.errors import UsageError
from tests.support.command import Command
from tests.support.domains import DOMAINS
from tests.support.naive_classical import optimal_plans

#: Two ends of a table, lifted together or the glasses on it fall: the goal wants a fact false.
LIFT = """(define (domain table) (:requirements :typing :multi-agent)
  (:types robot) (:predicates (up ?r - robot) (level) (spilled))
  (:action lift :agent ?r - robot :parameters () :precondition (level)
    :effect (and (up ?r) (when (and (level) (forall (?o - robot) (or (= ?o ?r) (not (lift ?o)))))
                               (and (not (level)) (spilled))))))"""
BOTH = """(define (problem both) (:domain table) (:objects r1 r2 - robot) (:init (level))
  (:goal (and (up r1) (up r2) (not (spilled)))))"""
GRID = DOMAINS / "grid" / "domain.pddl", DOMAINS / "grid" / "corners-3x3.pddl"
CHARGER = DOMAINS / "charger" / "domain.pddl", DOMAINS / "charger" / "in-turn.pddl"


def lift() -> tuple[Any, Any]:
    domain = parse_domain(Source("d.pddl", LIFT))
    return domain, parse_problem(Source("p.pddl", BOTH), domain)


TASKS: dict[str, Callable[[], tuple[Any, Any]]] = {
    "lift": lift,
    "grid": lambda: GRID,
    "charger": lambda: CHARGER,
}
EACH = pytest.mark.parametrize("name", TASKS)


@cache
def built(name: str) -> tuple[Any, Any, str, int]:
    """Files, language, a sentence of its task, and how many plans have it."""
    files = TASKS[name]()
    language = door.build(*files, method="greedy").language
    sentence = " ".join(door.explain(language, *files).sentences[0].words)
    return files, language, sentence, door.understand(language, *files, sentence).count


def export(name: str, **options: Any) -> ExportedTask:
    files, language, sentence, _ = built(name)
    exported: ExportedTask = door.export(language, files[0], files[1], sentence, **options)
    return exported


def test_no_negative_goal() -> None:
    """The goal of the table wants (spilled) false."""
    for reader in ("fd", "kstar", "pyperplan"):
        assert "(not (" not in export("lift", for_planner=reader).problem
    assert export("lift", for_planner="fd").domain == export("lift", for_planner="kstar").domain


@EACH
def test_strips_only(name: str) -> None:
    exported = export(name, for_planner="pyperplan")
    assert "(:requirements :strips)" in exported.domain
    for part in re.findall(r":precondition (.*)", exported.domain):
        assert "(not (" not in part
    for word in ("total-cost", ":functions", ":metric"):
        assert word not in exported.domain + exported.problem


@pytest.mark.parametrize("change", [with_positive_goal, with_positive_conditions])
@EACH
def test_the_plans_stay_the_same(name: str, change: Any) -> None:
    """All optimal plans, listed by a search of its own, before and after."""
    domain, problem = TASKS[name]()
    if name != "lift":
        loaded = door.load(domain, problem)
        domain, problem = loaded.domain, loaded.problems[0]
    candidates = from_problems(domain, [problem])
    (used,) = languages_in_tasks(build_language(candidates, "greedy").language, candidates)
    plain = _compiled(used)
    before, after = plain, change(plain)
    assert sorted(optimal_plans(after)) == sorted(optimal_plans(before))
    assert all(positive for _, positive in after.goal)


def _compiled(used: TaskLanguage) -> ClassicalTask:
    from planners.classical import compile_classical
    from planners.joint.model import PlanningTask

    space = used.space
    start = space.starts[used.task]
    task = PlanningTask("task", space.rows[space.state[start]], space.goals[space.goal[start]])
    return compile_classical(used.model, task, 100_000)


def test_what_strips_cannot_say(coordlang: Command, tmp_path: Path) -> None:
    language = tmp_path / "l.json"
    assert (
        coordlang(
            "build", *GRID, "--cost", "makespan+actions", "--method", "greedy", "-o", language
        ).code
        == 0
    )
    sentence = door.explain(language, *GRID).sentences[0].words
    with pytest.raises(UsageError, match="--for pyperplan writes no costs"):
        door.export(language, *GRID, sentence, for_planner="pyperplan")
    with pytest.raises(UsageError, match="every joint action must be one action"):
        export("grid", for_planner="pyperplan", max_actions=0)
    with pytest.raises(UsageError, match="--for metric-ff"):
        export("grid", for_planner="metric-ff")
    outcome = coordlang("export", language, *GRID, "w0", "--to", "ltlf", "--for", "fd")
    assert (outcome.code, "--for belongs to --to pddl" in outcome.err) == (2, True)


@EACH
def test_pyperplan(name: str, tmp_path: Path) -> None:
    pytest.importorskip("pyperplan", reason="pyperplan is not installed (extra oracles)")
    files, language, sentence, _ = built(name)
    exported = export(name, for_planner="pyperplan")
    exported.save(tmp_path)
    pddl = [str(tmp_path / file) for file in ("domain.pddl", "problem.pddl")]
    command = [sys.executable, "-m", "pyperplan", "-s", "astar", "-H", "blind", *pddl]
    subprocess.run(command, check=True, capture_output=True)
    plan = exported.translate_text((tmp_path / "problem.pddl.soln").read_text(), "the plan")
    assert door.say(language, files[0], files[1], plan).sentence == sentence


@EACH
def test_kstar(name: str, tmp_path: Path) -> None:
    """It lists as many plans of least cost as there are plans with the sentence."""
    planners = pytest.importorskip(
        "kstar_planner.planners", reason="K* is not installed (extra oracles)"
    )
    export(name, for_planner="kstar").save(tmp_path)
    found = planners.plan_unordered_topq(
        domain_file=tmp_path / "domain.pddl",
        problem_file=tmp_path / "problem.pddl",
        quality_bound=1.0,
        timeout=100,
    )
    assert len(found["plans"]) == built(name)[3]
