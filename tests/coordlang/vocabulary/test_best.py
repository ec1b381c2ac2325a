# SPDX-License-Identifier: GPL-3.0-or-later
"""The default method: what some effort finds, what it says of it, and what none finds."""

from __future__ import annotations

import json
from itertools import pairwise
from pathlib import Path

import pytest

import coordlang as library
from coordlang.commands.building import build_language
from coordlang.language.candidates import all_pairs
from planners.pddl.model_options import ModelOptions
from planners.system.errors import UsageError
from tests.support.command import Command
from tests.support.domains import DOMAINS, all_tasks, own_task, read

CORNERS = DOMAINS / "grid" / "domain.pddl", DOMAINS / "grid" / "corners-3x3.pddl"
NINE = DOMAINS / "grid" / "domain.pddl", DOMAINS / "grid" / "gw4-3x3.pddl"


def test_few_words_that_leave_many_plans_open() -> None:
    """Of one task: as few words as the exact method proves, and no less freedom than it leaves."""
    found = build_language(own_task("grid", "corners-4x4"))
    exact = build_language(own_task("grid", "corners-4x4"), "minimal", prefer="flexible")
    assert found.language.guarantee.proved_minimal
    assert found.language.guarantee.size == exact.language.guarantee.size == 2
    assert found.figures["flexibility"] >= 86 > found.figures["work"] / 1_000


def test_the_same_language_again() -> None:
    one, again = (build_language(own_task("grid", "corners-3x3")).language for _ in range(2))
    assert one == again


@pytest.mark.parametrize(
    ("stem", "least"), [("gw2-2x3", 5), pytest.param("gw3-2x4", 6, marks=pytest.mark.thorough)]
)
def test_effort_buys_words_and_bounds(stem: str, least: int) -> None:
    candidates = all_tasks("grid", stem)
    known = [
        build_language(candidates, effort=effort).language.guarantee for effort in (0, 1, 5, 1_000)
    ]
    greedy = build_language(candidates, "greedy").language.guarantee
    assert (known[0].size, known[0].lower_bound) == (greedy.size, 2)
    assert known[-1].size == known[-1].lower_bound == least
    for less, more in pairwise(known):
        assert less.lower_bound <= more.lower_bound <= more.size <= less.size
    assert known[1].size < known[0].size, "words are merged with the least effort"


def test_what_more_effort_might_bring(coordlang: Command, tmp_path: Path) -> None:
    path = tmp_path / "l.json"
    built = coordlang("build", *NINE, "--tasks", "all", "--effort", 1, "-o", path)
    assert built.code == 0
    guarantee = json.loads(path.read_text())["guarantee"]
    said = f"between {guarantee['lower_bound']} and {guarantee['size']} words are needed"
    assert f"{said}: a larger --effort than 1 may find fewer" in built.out
    proved = coordlang("build", *CORNERS, "-o", path)
    assert "proved minimal" in proved.out
    assert "--effort" not in proved.out


def test_effort_belongs_to_it(coordlang: Command, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="--effort belongs to --method best"):
        library.build(*CORNERS, method="minimal", effort=3)
    made = coordlang("build", *CORNERS, "--effort", -1, "-o", tmp_path / "l.json")
    assert made.code == 2


def test_single_states_are_merged_before_effort_is_spent_on_bounds() -> None:
    """Without a common step no words are greedy's: each state begins with its own."""
    domain, problem = read("grid", "gw2-2x3")
    candidates = all_pairs(domain, [problem], ModelOptions(asynchronous=True))
    built = build_language(candidates, effort=1)
    assert built.verdict.holds
    assert len(built.job.states) == 30 > 2 * built.language.guarantee.size
