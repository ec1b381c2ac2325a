# SPDX-License-Identifier: GPL-3.0-or-later
"""``coordlang export``: what it prints and writes, for planners of every kind, and what it refuses."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import pytest

import coordlang as door
from coordlang.exports.pddl import ExportedTask
from planners.classical.fast_downward import total_cost
from planners.classical.task import action_names
from planners.system.errors import UsageError
from tests.support import slow
from tests.support.command import Command, Outcome
from tests.support.domains import T_MAP, files_of
from tests.support.naive_classical import optimal_plans
from tests.support.task_languages import SHIPPED
from tests.support.texts import parsed

#: A sentence of the least language of the T-map, and one of the task of three cells.
SENTENCE, OF_CELLS = "w0 w2 w1 w0", "w1 w0"
#: Arguments -> what ``coordlang export`` ends with.
Ask = Callable[..., Outcome]
CELLS = files_of("three-cells")


@pytest.fixture(scope="module")
def languages(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    folder = tmp_path_factory.mktemp("languages")
    door.build(*T_MAP, tasks="all", method="minimal").language.save(folder / "t-map")
    door.build(*CELLS, method="greedy").language.save(folder / "cells")
    return folder / "t-map", folder / "cells"


@pytest.fixture
def ask(coordlang: Command, languages: tuple[Path, Path]) -> Ask:
    return lambda *arguments: coordlang("export", languages[0], *T_MAP, *arguments)


@pytest.fixture
def of_cells(coordlang: Command, languages: tuple[Path, Path]) -> Ask:
    return lambda *arguments: coordlang("export", languages[1], *CELLS, *arguments)


@pytest.mark.parametrize(("limit", "form"), [(2000, "explicit"), (0, "select-then-apply")])
def test_out_to_a_planner_and_back(
    limit: int,
    form: str,
    ask: Ask,
    coordlang: Command,
    languages: tuple[Path, Path],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("coordlang.exports.pddl.MAX_ACTIONS", limit)
    folder, plan = tmp_path / "out", tmp_path / "sas_plan"
    exported = door.export(languages[0], *T_MAP, SENTENCE)
    done = ask(SENTENCE, "-o", folder)
    assert (done.code, done.err) == (0, "")
    assert form in done.out
    assert (folder / "domain.pddl").read_text() == exported.domain
    assert (folder / "problem.pddl").read_text() == exported.problem
    classical = exported.classical
    names = [action_names(classical)[n] for n in next(iter(optimal_plans(classical)))]
    plan.write_text("".join(f"({name} )\n" for name in names) + "; cost = 4 (general cost)\n")
    back = ask(SENTENCE, "--translate-plan", plan)
    first = coordlang("plans", *T_MAP, "--max", 1).out.split("\n", 1)[1]
    assert (back.code, back.out) == (0, first.rstrip("\n") + "\n")


def test_the_command_as_json(ask: Ask, of_cells: Ask, tmp_path: Path) -> None:
    data = json.loads(ask(SENTENCE, "--json").out)
    assert ask(SENTENCE).out == data["domain"] + data["problem"]
    assert (data["optimal_cost"], data["step_cost"], data["form"]) == (4, 1, "explicit")
    assert data["robots"] == ["r1", "r2"]
    assert {"r1": "(move r1 c0-1 c1-1)", "r2": None} in data["actions"].values()
    assert {} in data["actions"].values()
    data = json.loads(ask(SENTENCE, "--to", "ltlf", "--json").out)
    assert data["over_words"] == "(w0 & (w0 U (w2 & (w2 U (w1 & (w1 U G(w0)))))))"
    trees = json.loads(of_cells(OF_CELLS, "--to", "bt", "--json").out)
    subplans = {"r1": 1, "r2": 2}
    assert trees == {"xml": trees["xml"], "subplans": subplans, "guaranteed": True}
    for asked, to, text in (
        (ask, (SENTENCE, "--to", "ltlf"), data["formula"] + "\n"),
        (of_cells, (OF_CELLS, "--to", "bt"), trees["xml"]),
    ):
        shown = asked(*to)
        assert (shown.code, shown.out) == (0, text)
        assert asked(*to, "-o", tmp_path / "file").out == ""
        assert (tmp_path / "file").read_text() == text


@pytest.mark.parametrize(
    ("arguments", "code", "message"),
    [
        ((SENTENCE, "--translate-plan", "missing"), 31, "there is no such file"),
        ((SENTENCE, "--translate-plan", "other"), 31, "none of the exported problem"),
        ((SENTENCE, "--translate-plan", "empty"), 1, "no optimal plan"),
        ((SENTENCE, "--translate-plan", "two"), 31, "two:3:1: this file holds several plans"),
        ((SENTENCE, "--to", "ltlf", "--translate-plan", "empty"), 2, "belongs to --to pddl"),
        ((SENTENCE, "--to", "bt", "--translate-plan", "empty"), 2, "or --to bt"),
        ((SENTENCE, "--to", "ltlf", "--for", "fd"), 2, "--for fd belongs to --to pddl"),
        ((SENTENCE, "-o", "other"), 2, "the folder other cannot be made"),
        ((SENTENCE, "-o", "missing/x", "--to", "ltlf"), 2, "cannot be written"),
        (("w0 w1 w0",), 1, "no optimal plan has the sentence"),
        (("w7",), 31, "no word of this language"),
        ((SENTENCE, "--max-actions", "-1"), 2, "--max-actions"),
    ],
)
def test_wrong_arguments(
    arguments: tuple[str, ...],
    code: int,
    message: str,
    ask: Ask,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("two").write_text("(fly)\n; cost = 1 (unit cost)\n(fly)\n; cost = 1 (unit cost)\n")
    Path("other").write_text("(fly)\n")
    Path("empty").write_text("; nothing\n")
    done = ask(*arguments)
    assert (done.code, message in done.err) == (code, True), done.err
    assert done.out == ""


def test_a_task_that_the_language_does_not_cover(
    coordlang: Command, languages: tuple[Path, Path], tmp_path: Path
) -> None:
    other, out = tmp_path / "other.pddl", tmp_path / "out"
    other.write_text(re.sub(r"(?s)\(:goal.*", "(:goal (at r1 c)))", CELLS[1].read_text()))
    done = coordlang("export", languages[1], CELLS[0], other, OF_CELLS, "-o", out)
    assert (done.code, "guarantees nothing" in done.err) == (1, True), done.err
    assert (out / "domain.pddl").exists()


# Planners that refuse negative goals (K*), or know neither negation nor costs.

#: Two ends of a table, lifted together or the glasses on it fall: the goal wants a fact false.
LIFT = """(define (domain table) (:requirements :typing :multi-agent)
  (:types robot) (:predicates (up ?r - robot) (level) (spilled))
  (:action lift :agent ?r - robot :parameters () :precondition (level)
    :effect (and (up ?r) (when (and (level) (forall (?o - robot) (or (= ?o ?r) (not (lift ?o)))))
                               (and (not (level)) (spilled))))))"""
BOTH = """(define (problem both) (:domain table) (:objects r1 r2 - robot) (:init (level))
  (:goal (and (up r1) (up r2) (not (spilled)))))"""
WORLDS = ["lift", "grid/corners-3x3", "charger/in-turn"]
EACH = pytest.mark.parametrize("name", WORLDS)


@cache
def built(name: str, cost: str = "makespan") -> tuple[Any, Any, str, int]:
    """Files, language, a sentence of its task, and how many plans have it."""
    files: Any = parsed(LIFT, BOTH) if name == "lift" else files_of(*name.split("/"))
    language = door.build(*files, cost=cost, method="greedy").language
    sentence = " ".join(door.explain(language, *files).sentences[0].words)
    return files, language, sentence, door.understand(language, *files, sentence).count


def export(name: str, cost: str = "makespan", **options: Any) -> ExportedTask:
    files, language, sentence, _ = built(name, cost)
    exported: ExportedTask = door.export(language, *files, sentence, **options)
    return exported


@EACH
def test_what_each_planner_reads(name: str) -> None:
    """No negative goal for any, for pyperplan plain STRIPS; the plans stay the same."""
    listed = []
    for reader in ("fd", "kstar", "pyperplan"):
        found = export(name, for_planner=reader)
        classical = found.classical
        names, plans = action_names(classical), optimal_plans(classical)
        listed.append(sorted(found.joint_plan([names[n] for n in p]) for p in plans))
        assert len(listed[-1]) == built(name)[3]
        assert "(not (" not in found.problem
    assert listed[0] == listed[1] == listed[2]
    assert export(name, for_planner="fd").domain == export(name, for_planner="kstar").domain
    assert "(:requirements :strips)" in found.domain
    assert not [p for p in re.findall(r":precondition (.*)", found.domain) if "(not (" in p]
    for word in ("total-cost", ":functions", ":metric"):
        assert word not in found.domain + found.problem


@pytest.mark.parametrize(
    ("cost", "most", "reader", "message"),
    [
        ("makespan+actions", 2000, "pyperplan", "--for pyperplan writes no costs"),
        ("makespan", 0, "pyperplan", "every joint action must be one action"),
        ("makespan", 2000, "metric-ff", "--for metric-ff"),
    ],
)
def test_what_strips_cannot_say(
    cost: str, most: int, reader: str, message: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("coordlang.exports.pddl.MAX_ACTIONS", most)
    with pytest.raises(UsageError, match=message):
        export("grid/corners-3x3", cost, for_planner=reader)


@EACH
def test_pyperplan(name: str, tmp_path: Path) -> None:
    pytest.importorskip("pyperplan", reason="pyperplan is not installed (extra oracles)")
    files, language, sentence, _ = built(name)
    exported = export(name, for_planner="pyperplan")
    exported.save(tmp_path)
    given = [str(tmp_path / file) for file in ("domain.pddl", "problem.pddl")]
    command = [sys.executable, "-m", "pyperplan", "-s", "astar", "-H", "blind", *given]
    subprocess.run(command, check=True, capture_output=True)
    plan = exported.translate_text((tmp_path / "problem.pddl.soln").read_text(), "the plan")
    assert door.say(language, *files, plan).sentence == sentence


@pytest.mark.parametrize("name", [*WORLDS, *slow(*SHIPPED)])
def test_kstar_and_fast_downward(name: str, tmp_path: Path) -> None:
    """K* lists as many plans of least cost as there are with the sentence; the cost is the least."""
    planners = pytest.importorskip(
        "kstar_planner.planners", reason="K* is not installed (extra oracles)"
    )
    try:
        exported = export(name, for_planner="kstar")
    except door.Inseparable:
        return
    exported.save(tmp_path)
    found = planners.plan_unordered_topq(
        domain_file=tmp_path / "domain.pddl",
        problem_file=tmp_path / "problem.pddl",
        quality_bound=1.0,
        timeout=100,
    )
    assert len(found["plans"]) == built(name)[3]
    assert total_cost(exported.classical) == exported.cost
