# SPDX-License-Identifier: GPL-3.0-or-later
"""What people read: singular and plural, sentences that would say nothing, states in which nothing
is true.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from coordlang.commands.witness import witness_text
from coordlang.required.miscoordination import Miscoordination
from tests.support.command import Command
from tests.support.domains import DOMAINS

DOMAIN = """(define (domain e) (:types robot place) (:predicates (q ?r - robot) (ok ?r - robot))
  (:action a :agent ?r - robot :precondition (ok ?r) :effect (q ?r)))"""
PROBLEM = (
    "(define (problem x) (:domain e) (:objects r1 r2 - robot) (:init (ok r1) MORE) (:goal GOAL))"
)


@pytest.fixture
def files(tmp_path: Path) -> tuple[Path, Path]:
    domain, problem = tmp_path / "d.pddl", tmp_path / "p.pddl"
    domain.write_text(DOMAIN)
    problem.write_text(PROBLEM.replace("MORE", "").replace("GOAL", "(q r1)"))
    return domain, problem


def test_one_plan_of_one_step(coordlang: Command, files: tuple[Path, Path]) -> None:
    """One plan is no mixture."""
    out = coordlang("coordination", *files).out
    assert out.endswith("p.pddl: 1 optimal plan of 1 step; coordination is not required\n")
    files[1].write_text(PROBLEM.replace("MORE", "(ok r2)").replace("GOAL", "(q r1)"))
    out = coordlang("coordination", *files).out
    assert out.endswith(
        "2 optimal plans of 1 step; coordination is not required: any mixture of them is optimal\n"
    )


def test_one_state(coordlang: Command, files: tuple[Path, Path]) -> None:
    files[1].write_text(PROBLEM.replace("(ok r1) MORE", "").replace("GOAL", "(q r1)"))
    outcome = coordlang("plans", *files)
    assert (outcome.code, outcome.err) == (
        11,
        f"coordlang: {files[1]}: task x: the goal cannot be reached\n  "
        "No other state can be reached.\n"
        "  The goal needs (q r1), and nothing makes it true.\n"
        "  Action a of r1 is never possible: nothing makes (ok r1) true.\n"
        "  Action a of r2 is never possible: nothing makes (ok r2) true.\n",
    )


def test_a_robot_that_only_idles(coordlang: Command, files: tuple[Path, Path]) -> None:
    out = coordlang("inspect", *files, "--states").out
    assert "\n  r1            1 subaction: a 1; may idle in every step\n" in out
    assert "\n  r2            0 subactions; may idle in every step\n" in out
    assert "\nfluents         1 fact: q 1\n" in out
    assert "\nreachable       2 joint states, " in out


def test_the_trivial_lower_bound(
    coordlang: Command, files: tuple[Path, Path], tmp_path: Path
) -> None:
    language, proof = tmp_path / "l.json", tmp_path / "proof.json"
    assert (
        coordlang(
            "build", *files, "--method", "minimal", "-o", language, "--certificate", proof
        ).code
        == 0
    )
    out = coordlang("verify", language, *files, "--certificate", proof).out
    assert out.splitlines()[-1] == "lower bound 1: every language has a word"


def test_pairs_of_several_problems(coordlang: Command, tmp_path: Path) -> None:
    domain, problem = (
        DOMAINS / "three-cells" / "domain.pddl",
        DOMAINS / "three-cells" / "problem.pddl",
    )
    language, other = tmp_path / "l.json", tmp_path / "other.pddl"
    assert (
        coordlang(
            "build", domain, problem, "--tasks", "all", "--method", "greedy", "-o", language
        ).code
        == 0
    )
    text = language.read_text()
    language.write_text(
        text.replace('"count": 30', '"count": 31').replace('"count":30', '"count":31')
    )
    other.write_text(problem.read_text())
    err = coordlang("verify", language, domain, problem).err
    assert f"the language records 31 tasks, but {problem} has 30 pairs of reachable states" in err
    err = coordlang("verify", language, domain, problem, other).err
    assert (
        "the language records 31 tasks, but these 2 problems have 30 pairs of reachable states"
        in err
    )


def test_a_drawn_state_without_facts(
    coordlang: Command, files: tuple[Path, Path], tmp_path: Path
) -> None:
    files[0].write_text(DOMAIN.replace(":precondition (ok ?r)", ""))
    language = tmp_path / "l.json"
    assert coordlang("build", *files, "--method", "greedy", "-o", language).code == 0
    out = coordlang("understand", language, *files, "w0", "--format", "dot").out
    assert out.count("(no fact holds)\\n") == 1, out


def test_a_miscoordination_through_states_without_facts() -> None:
    plan = (("(a r1)", None), (None, "(a r2)"))
    plans = (plan, plan[::-1])
    states = ("", "(q)", "")
    text = witness_text(
        Miscoordination(
            "t", ("r1", "r2"), plans, (states, states), plan, ("", "(q)"), 1, "so it is"
        )
    )
    assert text.count("reaches (no fact holds)\n") == 2
    assert "\n    (no fact holds)\n" in text
    assert not [line for line in text.splitlines() if not line.strip()]
