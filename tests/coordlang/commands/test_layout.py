# SPDX-License-Identifier: GPL-3.0-or-later
"""Output about many robots that a person can read: grouped, aligned, no wider than a page."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

import coordlang as door
from coordlang.commands import terminal
from coordlang.commands.layout import WIDTH, columns, fitted, wrapped
from coordlang.commands.witness import witness_text
from planners.joint.states import split_atoms
from tests.support.command import Command
from tests.support.domains import DOMAINS


def test_equal_plans_are_shown_once_and_lines_fit(coordlang: Command) -> None:
    files = DOMAINS / "vans" / "domain.pddl", DOMAINS / "vans" / "two-each.pddl"
    lines = coordlang("coordination", *files).out.split("\n")
    assert "  d1, v1 and v2 follow this optimal plan:" in lines
    assert "  d2 follows this optimal plan:" in lines
    assert "      1  d1: (board d1 v1 depot)       d2: (board d2 v2 depot)" in lines
    assert any(line.endswith("<-- breaks here") for line in lines)
    witness = door.coordination(*files).witness
    assert witness is not None
    for width in (60, WIDTH, 200):
        text = fitted(witness_text(witness), width)
        assert max(map(len, text.split("\n"))) <= width
        for atom in split_atoms(witness.states[0][0]):
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


def test_inspect_keeps_columns_apart_and_to_the_page(coordlang: Command, tmp_path: Path) -> None:
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
