# SPDX-License-Identifier: GPL-3.0-or-later
"""Output about many robots that a person can read: grouped, aligned, no wider than a page."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from coordlang.commands import terminal
from coordlang.commands.layout import WIDTH, columns, fitted, wrapped
from coordlang.commands.witness import witness_text
from coordlang.required.miscoordination import Miscoordination, Step
from planners.joint.states import split_atoms
from tests.support.command import Command
from tests.support.domains import DOMAINS

ROBOTS = tuple(f"robot{n}" for n in range(1, 8))


def step(**acts: str) -> Step:
    return tuple(acts.get(robot) for robot in ROBOTS)


def seven() -> Miscoordination:
    """Six of seven robots follow one plan; states of several lines."""
    first = (step(robot1="(load a)", robot2="(load b)"), step(robot3="(carry a)"))
    second = (step(robot1="(load a)"), step(robot2="(load b)", robot7="(carry a)"))
    facts = [f"(lies parcel{n} depot{n})" for n in range(12)]
    start, end = " ".join(facts), " ".join([*facts[1:], "(carried parcel0)"])
    states = (start, end, end)
    return Miscoordination(
        task=f"{start} -> (carried parcel0)",
        robots=ROBOTS,
        plans=(*[first] * 6, second),
        states=(states,) * 7,
        mixture=(step(robot1="(load a)", robot2="(load b)"), step(robot3="(carry a)")),
        mixed_states=(start, end),
        step=1,
        reason="(carry a) forbids it",
    )


def test_equal_plans_are_shown_once() -> None:
    text = witness_text(seven())
    lines = text.split("\n")
    assert "  robot1, robot2, robot3, robot4, robot5 and robot6 follow this optimal plan:" in lines
    assert "  robot7 follows this optimal plan:" in lines
    assert "      1  robot1: (load a)   robot2: (load b)" in lines
    assert "      2  robot3: (carry a)  <-- breaks here" in lines
    assert "         reaches the same state" in lines
    assert "    now (carried parcel0), no longer (lies parcel0 depot0)" in lines
    assert len(lines) < 30


@pytest.mark.parametrize("width", [60, 80, WIDTH, 200])
def test_lines_fit(width: int) -> None:
    text = witness_text(seven(), width)
    assert max(map(len, text.split("\n"))) <= width
    for atom in split_atoms(seven().states[0][0]):
        assert atom in text.replace("\n", "")


def test_atoms_are_not_broken() -> None:
    text = "state (at r1 c0-0) (last r2 (go r2 b)) (not (free r1)) end"
    assert wrapped(text, 80, "  ", "    ") == ["  " + text]
    assert wrapped(text, 20, "  ", "    ") == [
        "  state (at r1 c0-0)",
        "    (last r2 (go r2 b))",
        "    (not (free r1))",
        "    end",
    ]
    assert wrapped("", 20, "  ", "") == [""]
    rows = [("n", "does", "knows"), ("10", "a\n| b", "(at r1 c0-0) (at r2 c0-1) (at r3 c2-2)")]
    assert [*columns(rows, 20, 1)] == [
        "   n  does  knows",
        "  10  a     (at r1 c0-0) (at r2 c0-1)",
        "      | b   (at r3 c2-2)",
    ]


class Screen:
    def isatty(self) -> bool:
        return True


def test_the_width_is_the_terminals(monkeypatch: pytest.MonkeyPatch) -> None:
    """A page where the output is no terminal, whatever COLUMNS says."""
    monkeypatch.setenv("COLUMNS", "90")
    assert terminal.line_width() == WIDTH
    monkeypatch.setattr(sys, "stdout", Screen())
    assert terminal.line_width() == 90
    assert terminal.line_width(err=True) == WIDTH
    monkeypatch.setenv("COLUMNS", "7")
    assert terminal.line_width() == 60


def test_tables_of_choices_fit(coordlang: Command, tmp_path: object) -> None:
    """Shipped problems with three robots: robots that only idle share a table."""
    charger = DOMAINS / "charger"
    files = charger / "domain.pddl", charger / "three-robots.pddl"
    language, plan = f"{tmp_path}/l.json", f"{tmp_path}/plan"
    coordlang("build", *files, "--method", "greedy", "-o", language)
    with open(plan, "w") as file:
        file.write(coordlang("plans", *files, "--max", "1").out)
    said = coordlang("say", language, *files, plan).out.strip()
    out = coordlang("choices", language, *files, said).out
    assert max(map(len, out.split("\n"))) <= WIDTH
    assert out.count("may ") >= 3


def test_long_lines_are_broken() -> None:
    text = "short\n  r1: move it, and stay.\n  (at r1 a) (at r2 b)"
    shown = ["short", "  r1: move it, and", "      stay.", "  (at r1 a)", "      (at r2 b)"]
    assert fitted(text, 18).split("\n") == shown
    assert fitted(text, 100) == text


def test_inspect_keeps_its_columns_apart_and_to_the_page(
    coordlang: Command, tmp_path: Path
) -> None:
    """Users met names of robots that run into the next column, and lines of any length."""
    domain, problem = tmp_path / "d.pddl", tmp_path / "p.pddl"
    domain.write_text(
        """(define (domain d) (:types robot) (:predicates (up ?r - robot))
        (:action rise :agent ?r - robot :parameters () :precondition (not (up ?r)) :effect (up ?r)))"""
    )
    names = " ".join(f"immersion-varnisher-{k}" for k in range(9))
    goal = " ".join(f"(up immersion-varnisher-{k})" for k in range(9))
    problem.write_text(
        f"(define (problem p) (:domain d) (:objects {names} - robot) (:init) (:goal (and {goal})))"
    )
    lines = coordlang("inspect", domain, problem).out.splitlines()
    assert max(map(len, lines)) <= WIDTH
    assert "  immersion-varnisher-8  1 subaction: rise 1; may idle in every step" in lines
    assert "read as                  MA-PDDL (:agent)" in lines
