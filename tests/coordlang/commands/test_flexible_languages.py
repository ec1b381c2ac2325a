# SPDX-License-Identifier: GPL-3.0-or-later
"""``build --prefer flexible`` and ``simple``: what is printed, written, and verified again."""

from __future__ import annotations

import json
import re
from pathlib import Path

from tests.support.command import Command
from tests.support.domains import DOMAINS

GRID = DOMAINS / "grid"
SQUARE = GRID / "domain.pddl", GRID / "gw1-2x2.pddl"


def test_prefer_flexible(tmp_path: Path, coordlang: Command) -> None:
    path, again = tmp_path / "l.json", tmp_path / "again.json"
    chosen = (*SQUARE, "--tasks", "all", "--method", "minimal", "--prefer", "flexible")
    outcome = coordlang("build", *chosen, "-o", path, "--json")
    figures = json.loads(outcome.out)
    assert outcome.code == 0
    assert figures["words"] == figures["lower_bound"] == 3
    assert (
        figures["flexibility_before"]
        < figures["flexibility"]
        <= figures["flexibility_bound"] + 1e-9
    )
    assert 0 < figures["communication_saving"] < 1
    assert coordlang("verify", path, *SQUARE).code == 0
    coordlang("build", *chosen, "-o", again)
    first, second = (json.loads(p.read_text()) for p in (path, again))
    assert first["states"] == second["states"]


def test_the_summary_says_what_is_left_open(tmp_path: Path, coordlang: Command) -> None:
    arguments = ("--tasks", "all", "--method", "exhaustive", "--prefer", "flexible")
    files = DOMAINS / "three-cells" / "domain.pddl", DOMAINS / "three-cells" / "problem.pddl"
    outcome = coordlang("build", *files, *arguments, "-o", tmp_path / "l.json")
    assert outcome.code == 0
    assert "a sentence leaves 1.20 plans open on average (1.20 before, 1.20 at most)" in outcome.out


def test_prefer_simple(tmp_path: Path, coordlang: Command) -> None:
    """The formulas are those that `explain` then shows, and proved the shortest."""
    path = tmp_path / "l.json"
    chosen = ("--tasks", "all", "--method", "minimal", "--prefer", "simple")
    outcome = coordlang("build", *SQUARE, *chosen, "-o", path)
    assert outcome.code == 0
    # What it had before depends on which of the smallest languages was found first.
    said = r"formulas of 2 terms with 2 limits on variables \(\d+ terms, \d+ limits before"
    assert re.search(said, outcome.out)
    assert "proved the shortest)" in outcome.out
    shown = json.loads(coordlang("explain", path, *SQUARE, "--json").out)["formulas"]
    terms = sorted(len(formula["terms"]) for formula in shown.values())
    assert sum(terms[:-1]) == 2
    assert coordlang("verify", path, *SQUARE).code == 0


def test_greedy_words_have_no_preference(tmp_path: Path, coordlang: Command) -> None:
    arguments = ("--method", "greedy", "--prefer", "flexible", "-o", tmp_path / "l.json")
    outcome = coordlang("build", *SQUARE, *arguments)
    assert outcome.code == 2
    assert "--prefer flexible belongs to --method best, minimal or exhaustive" in outcome.err
    assert not (tmp_path / "l.json").exists()
