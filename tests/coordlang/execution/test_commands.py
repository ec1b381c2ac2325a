# SPDX-License-Identifier: GPL-3.0-or-later
"""``say``, ``understand``, ``plan``, ``choices``: what they print, write, and say of mistakes."""

from __future__ import annotations

import json
import re
import shlex
from collections.abc import Callable
from pathlib import Path

import pytest

import coordlang as door
from coordlang.execution.monitor import Monitor
from planners.joint.model import show
from planners.loading import load
from planners.search.plan_file import read_plans
from tests.support.command import Command, Outcome
from tests.support.domains import files_of, own_task

#: World -> problem, and which tasks its language is for.
WORLDS = {
    "cells": ("three-cells/problem", None),
    "t": ("t-map/problem", "all"),
    "grid": ("grid/corners-4x4", None),
}
#: The last line of a plan of the T-map.
LAST = "3: (move r2 c1-1 c0-1)"
#: A command about a world: ``ask("say", "t", plan file)``.
Ask = Callable[..., Outcome]


def pddl(world: str) -> tuple[Path, Path]:
    return files_of(*WORLDS[world][0].split("/"))


@pytest.fixture(scope="module")
def languages(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("languages")
    for world, (_, tasks) in WORLDS.items():
        door.build(*pddl(world), tasks=tasks, method="greedy").language.save(folder / world)
    return {world: folder / world for world in WORLDS}


@pytest.fixture
def ask(coordlang: Command, languages: dict[str, Path]) -> Ask:
    def call(command: str, world: str, *arguments: object) -> Outcome:
        return coordlang(command, languages[world], *pddl(world), *arguments)

    return call


@pytest.fixture
def plans(coordlang: Command) -> list[str]:
    """The two plans of the T-map as `plans` writes them."""
    return coordlang("plans", *pddl("t")).out.split("\n\n")[:2]


def changed(path: Path, file: Path, old: str, new: str) -> Path:
    text = file.read_text()
    assert text.count(old) == 1
    path.write_text(text.replace(old, new))
    return path


@pytest.mark.parametrize(
    ("commands", "line", "code", "message"),
    [
        ("understand plan", "t ''", 31, "the sentence is empty"),
        ("understand plan", "t 'w0 w9'", 31, "word 2 of the sentence, 'w9', is no word of this"),
        ("understand plan", "t 'w0 w0'", 31, "twice in a row"),
        ("understand plan", "t 'w1 w0'", 1, "at the beginning no plan says 'w1'"),
        ("understand plan", "t 'w0 w1 w0'", 1, "after \"w0 w1\" no plan says 'w0'"),
        ("understand plan", "t 'w0 w1 w3'", 1, '"w0 w1 w3" no plan ends\n  There plans say'),
        ("plan", "t 'w0 w1 w3 w2 w0 w1'", 1, "no plan says 'w1'\n  There plans end."),
        ("understand", "t w0 --count --max 3", 2, ""),
        ("plan", "t", 2, ""),
        ("plan", "t w0 --prefer shortest", 2, ""),
        ("choices", "cells 'w0 w1'", 1, "no optimal plan has the sentence"),
        ("choices", "cells 'w1 w9'", 31, "'w9', is no word of this language"),
        ("choices", "cells ''", 31, "the sentence is empty"),
        ("choices", "cells 'w1 w0' --robot r3", 2, "no such robot\n  The robots are r1, r2."),
    ],
)
def test_wrong_arguments(commands: str, line: str, code: int, message: str, ask: Ask) -> None:
    for command in commands.split():
        outcome = ask(command, *shlex.split(line))
        assert (outcome.code, outcome.out) == (code, "")
        assert message in outcome.err


# Say.


def test_says_what_plans_wrote(
    coordlang: Command, ask: Ask, plans: list[str], tmp_path: Path
) -> None:
    """And `understand` leaves the plan that says it; spelling is free."""
    path = tmp_path / "plans.json"
    data = json.loads(coordlang("plans", *pddl("t"), "--json").out)
    path.write_text(json.dumps(data))
    both = ask("say", "t", path)
    said = both.out.splitlines()
    assert (both.code, len(set(said)), len(said)) == (0, 2, 2)
    for plan in data["plans"]:
        for step in plan["actions"]:
            step[:] = [t and t.upper().replace("(", " ( ").replace(" ", "  ") for t in step]
    path.write_text(json.dumps(data))
    assert ask("say", "t", path).out == both.out
    path.write_text(f"; \x0c (idle)\n{plans[0]}")  # a line ends at the end of a line only
    assert ask("say", "t", path).out == said[0] + "\n"
    one = json.loads(ask("say", "t", path, "--json").out)
    assert one == {"sentences": said[:1], "covered": True}
    for sentence in said:
        path.write_text(ask("understand", "t", sentence).out)
        assert ask("say", "t", path).out.strip() == sentence
        assert ask("understand", "t", sentence, "--count").out == "1\n"
        data = json.loads(ask("understand", "t", sentence, "--json").out)
        keys = ("count", "complete", "covered", "sentence")
        assert [data[key] for key in keys] == [1, True, True, sentence]
        assert len(data["plans"]) == 1
        assert [edge["from"] for edge in data["edges"]] == list(range(len(data["nodes"]) - 1))
        only = json.loads(ask("understand", "t", sentence, "--json", "--count").out)
        assert (only["count"], only["plans"], "nodes" in only) == (1, [], False)


@pytest.mark.parametrize(
    ("old", "new", "code", "message"),
    [
        (
            *("c1-0 c1-1)", "c1-0 c9-9)", 1),
            "plan.txt:2:1: this is no plan: in step 1, (move r2 c1-0 c9-9) is no action",
        ),
        (
            *("1: (move r1 c0-1 c1-1)", "1: (move r1 c1-1 c0-1)", 1),
            "step 2 cannot be taken: r1 cannot (move r1 c1-1 c0-1) here",
        ),
        (LAST, "", 1, "after 3 steps the goal is not reached: (at r2 c0-1) does not hold"),
        (
            *("; makespan", "5: (move r2 c0-1 c1-1)\n6: (move r2 c1-1 c0-1)\n; makespan", 1),
            "takes 7 steps, and 4 are enough: the goal holds before step 5",
        ),
        (LAST, f"4{LAST[1:]}\n(move r2 c0-1 c1-1)", 1, "after 6 steps the goal is not reached"),
        ("0: (move r2 c1-0 c1-1)", "0:", 31, "plan.txt:2:1: expected '0: (action args)'"),
        *((LAST, f"{n}{LAST[1:]}", 31, "too many steps") for n in (123456789, 4000000)),
    ],
)
def test_wrong_plan_files(
    old: str, new: str, code: int, message: str, ask: Ask, plans: list[str], tmp_path: Path
) -> None:
    path = tmp_path / "plan.txt"
    assert old in plans[0]
    path.write_text(plans[0].replace(old, new, 1))
    outcome = ask("say", "t", path)
    assert (outcome.code, outcome.out) == (code, "")
    assert message in outcome.err


def test_which_plan_of_a_file_is_wrong(coordlang: Command, ask: Ask, tmp_path: Path) -> None:
    path = tmp_path / "plans.json"
    data = json.loads(coordlang("plans", *pddl("t"), "--json").out)
    steps = data["plans"][1]["actions"]

    def said() -> str:
        path.write_text(json.dumps(data))
        outcome = ask("say", "t", path)
        assert outcome.out == ""
        return outcome.err

    steps.insert(0, [None, "idle"])
    wrong = said()
    assert "plan 2 of 2: this plan is not optimal: it takes 5 steps, and 4 are enough" in wrong
    assert "; with step 1 (r1 idles, r2 idles)" in wrong
    steps[0] = [None, "(MOVE  r1 c0-1 c1-1)"]
    assert "in step 1, r2 has no subaction (move r1 c0-1 c1-1)" in said()
    data["plans"] = []
    assert "there is no plan in it" in said()
    path.write_bytes(b"\xff\xfe0: (move")
    assert ask("say", "t", path).code == 31


@pytest.mark.parametrize("form", ["as plans writes them", "without comments", "without numbers"])
def test_several_plans_in_one_text(form: str, ask: Ask, plans: list[str], tmp_path: Path) -> None:
    """They were one plan once, and the answer was about that one."""
    bare = [re.sub(r"(?m)^.*;.*\n?", "", text + "\n") for text in plans]
    first, second = [re.sub(r"(?m)^\d+: ", "", text) for text in bare]
    text, line = {
        "as plans writes them": ("\n".join(f"{plan}\n" for plan in plans), 10),
        "without comments": ("\n".join(bare), 8),
        "without numbers": (f"{first}; cost = 4 (unit cost)\n{second}", 8),
    }[form]
    path = tmp_path / "plans.txt"
    path.write_text(text)
    outcome = ask("say", "t", path)
    assert (outcome.code, outcome.out) == (31, "")
    assert f"plans.txt:{line}:1: this file holds several plans" in outcome.err
    assert "--max 1" in outcome.err


def test_a_joint_action_is_the_one_that_is_named(tmp_path: Path) -> None:
    """There are two with the same parts, of which one is possible."""
    part = "(:action {} ; subaction r1 (lift)\n :precondition {} :effect (and (up) (odd)))"
    both = part.format("lift", "(not (odd))") + part.format("hold", "(odd)")
    domain, problem, plan = (tmp_path / name for name in ("domain", "problem", "plan"))
    domain.write_text(f"(define (domain d) (:predicates (up) (odd)) {both})")
    problem.write_text("(define (problem p) (:domain d) (:init) (:goal (up)))")
    plan.write_text("(hold)")
    language = door.build(domain, problem).language
    with pytest.raises(door.NotAPlan, match=r"joint action \(hold\) is not applicable"):
        door.say(language, domain, problem, plan)


# Understand.


def test_a_task_without_steps_is_understood(coordlang: Command, tmp_path: Path) -> None:
    domain, problem = pddl("t")
    done, language = tmp_path / "done.pddl", tmp_path / "language.json"
    done.write_text(re.sub(r"\(:goal.*", "(:goal (and)))", problem.read_text(), flags=re.S))
    assert coordlang("build", domain, done, "--method", "greedy", "-o", language).code == 0
    for form in ("json", "ipc"):
        outcome = coordlang("understand", language, domain, done, "w0", "--format", form)
        assert outcome.code == 0, outcome.err
        assert outcome.out


def test_samples_are_seeded(ask: Ask) -> None:
    planned = ask("plan", "grid", "--prefer", "most-plans")
    sentence = planned.out.splitlines()[-1].partition("= ")[2]
    first, again, other = (
        ask("understand", "grid", sentence, "--sample", 6, "--seed", seed).out for seed in (1, 1, 2)
    )
    assert first == again != other
    assert first.count("; makespan = 6") == 6
    some = ask("understand", "grid", sentence, "--max", 3)
    assert some.out.count("; makespan") == 3
    assert "3 of 16 plans listed" in some.err


# Plan.


def test_a_plan_as_text_and_as_json(ask: Ask, tmp_path: Path) -> None:
    path = tmp_path / "plan.txt"
    for sentence in ("w0 w1 w3 w2 w0", "w0 w2 w3 w1 w0"):
        outcome, end = ask("plan", "t", sentence), f"; makespan = 4\n; sentence = {sentence}\n"
        assert (outcome.code, outcome.out.endswith(end)) == (0, True)
        assert "A* (relaxed) expanded" in outcome.err
        path.write_text(outcome.out)
        assert ask("say", "t", path).out == sentence + "\n"
    outcome = ask("plan", "t", "w0 w1 w3 w2 w0", "--json")
    data = json.loads(outcome.out)
    assert outcome.err == ""
    assert (data["sentence"], data["count"], data["optimal_cost"]) == ("w0 w1 w3 w2 w0", 1, 4)
    assert data["search"]["expanded"] == 4 < data["search"]["without_sentence"]["expanded"]
    path.write_text(outcome.out)
    assert len(read_plans(path, own_task("t-map").model)) == len(data["plans"]) == 1


def test_what_can_never_hold_is_avoided(coordlang: Command, tmp_path: Path) -> None:
    """Robots are never in cells that they cannot reach, and never closed in; adjacent cells are."""
    domain, problem = pddl("t")
    own = changed(tmp_path / "d.pddl", domain, "(:predicates", "(:predicates (closed ?x)")
    files, language = (own, problem), tmp_path / "l.json"
    assert coordlang("build", *files, "--method", "greedy", "-o", language).code == 0

    def preferring(wish: str) -> Outcome:
        return coordlang("plan", language, *files, "--prefer", wish)

    always = min(show(atom) for atom in load(own, [problem]).model.statics)
    for atom in ("(closed r1)", "(at r1 r2)", f"(closed r1) {always}", "(at r1 r2) (at r1 c1-1)"):
        outcome = preferring(f"avoid:{atom}")
        assert (outcome.code, outcome.out) == (0, preferring("shortest").out)
        assert f"avoid:{atom}: in every plan it keeps away from {atom}: " in outcome.err
        assert " can never be true\n" in outcome.err
    assert f"in every plan it passes through {always}\n" in preferring(f"avoid:{always}").err
    for atom in ("(at r1 c9-9)", "(ta r1 c1-1)", "(at r1)", "(last r1 none)"):
        outcome = preferring(f"avoid:{atom}")
        assert (outcome.code, "this is no atom of the problem" in outcome.err) == (2, True)
        assert "Write a predicate of the domain with objects of the problem" in outcome.err


def test_what_became_of_the_wishes(ask: Ask) -> None:
    outcome = ask("plan", "grid", "--prefer", "avoid:(at r1 c1-1)", "--prefer", "most-plans")
    assert outcome.code == 0
    assert "avoid:(at r1 c1-1): in every plan it keeps away from (at r1 c1-1)\n" in outcome.err
    assert "most-plans: leaves" in outcome.err
    assert "(move r1 c1-1" not in outcome.out
    wishes = ("--prefer", "avoid:(at r1 c3-3)", "--prefer", "shortest", "--json")
    data = json.loads(ask("plan", "grid", *wishes).out)
    avoided, shortest = data["wishes"]
    assert (avoided["granted"], avoided["worst_plan"]) == (False, "it passes through (at r1 c3-3)")
    assert shortest == {"wish": "shortest", "value": len(data["sentence"].split())}


# Choices.


def test_choices_as_a_table_and_as_a_file(
    ask: Ask, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    outcome = ask("choices", "cells", "w1 w0")
    assert (outcome.code, outcome.err) == (0, "")
    assert "r1 may follow 1 subplan (3 states):" in outcome.out
    assert "idle -> 1 | (move r2 b a) -> 2" in outcome.out
    assert "r1 may" not in ask("choices", "cells", "w1 w0", "--robot", "R2").out
    monkeypatch.setattr("coordlang.commands.choices.STATES_SHOWN", 2)
    outcome = ask("choices", "cells", "w1 w0", "--robot", "r2")
    assert "idle -> 1" in outcome.out
    assert outcome.out.endswith("  .. and 1 state more; --format json has all of them\n")
    path = tmp_path / "choices.json"
    outcome = ask("choices", "cells", "w1 w0", "--format", "json", "-o", path)
    assert (outcome.code, outcome.out) == (0, "")
    assert Monitor.read(str(path), "r2").allowed() == (None, "(move r2 b a)")
    data = json.loads(path.read_text())
    assert [entry["robot"] for entry in data["choices"]] == ["r1", "r2"]
    keys = ("plans", "covered", "guaranteed", "combinations_walked")
    assert [data[key] for key in keys] == [2, True, True, 4]
    one = ask("choices", "cells", "w1 w0", "--json", *("--robot", "r2") * 2).out
    assert json.loads(one) == data | {"choices": data["choices"][1:]}


# A task that the language does not cover.


def test_what_is_said_of_another_task(
    coordlang: Command, languages: dict[str, Path], tmp_path: Path
) -> None:
    """Answered, with a warning and exit code 1."""
    domain, problem = pddl("grid")
    plan, sentence = tmp_path / "plan.txt", ""
    other = changed(tmp_path / "other.pddl", problem, "(at r1 c3-3)", "(at r1 c3-2)")
    plan.write_text(coordlang("plans", domain, other, "--max", 1).out)
    for command, part in (("say", "w"), ("understand", "; makespan"), ("plan", "; sentence")):
        outcome = coordlang(command, languages["grid"], domain, other, sentence or plan)
        assert (outcome.code, part in outcome.out) == (1, True)
        assert "warning: the language does not cover this task" in outcome.err
        sentence = sentence or outcome.out.strip()


def test_choices_of_another_task(
    coordlang: Command, languages: dict[str, Path], tmp_path: Path
) -> None:
    domain, problem = pddl("cells")
    old, new = "(at r1 a) (at r2 b)", "(at r1 c) (at r2 b)"
    other, language = changed(tmp_path / "other.pddl", problem, old, new), tmp_path / "other.json"
    found = coordlang("choices", languages["cells"], domain, other, "w0")
    assert found.code == 1
    assert "r1 may follow 1 subplan (2 states)" in found.out
    assert "warning: the language does not cover this task: " in found.err
    assert coordlang("build", domain, other, "--method", "greedy", "-o", language).code == 0
    refuted = coordlang("choices", language, domain, problem, "w0")
    assert refuted.code == 1
    assert "r1 may follow 3 subplans" in refuted.out
    said = "refuted: choices of this task miscoordinate; the language does not cover it"
    assert said in refuted.err
    assert "<-- breaks here" in refuted.err
    asked = "choices", language, domain, problem, "w0", "--json"
    data = json.loads(coordlang(*asked).out)
    assert (data["guaranteed"], data["covered"]) == (False, False)
    assert {entry["atoms"] for entry in data["choices"]} == {"own"}


def test_a_predicate_called_last_is_no_memory(coordlang: Command, tmp_path: Path) -> None:
    """Its atoms may be in a language's states and never be true in another task."""
    domain, problem = pddl("cells")
    own = changed(tmp_path / "d.pddl", domain, "(:predicates", "(:predicates (last ?r - robot)")
    changed(own, own, ":effect (and", ":effect (and (not (last ?r))")
    other = changed(tmp_path / "other.pddl", problem, "(:init", "(:init (last r1)")
    language = tmp_path / "last.json"
    assert coordlang("build", own, other, "--tasks", "all", "-o", language).code == 0
    assert coordlang("explain", language, own, problem).code == 0
