# SPDX-License-Identifier: GPL-3.0-or-later
"""A robot in two places is noted, and nothing is noted of what others wrote on purpose."""

from __future__ import annotations

import warnings
from dataclasses import replace
from pathlib import Path

import pytest

from planners.loading import build
from planners.pddl import read_domain, read_problem
from planners.pddl.lifted import Atom
from planners.search.reachable import explore
from planners.search.state_variables import note_doubled
from planners.system.errors import Note
from tests.support.command import Command
from tests.support.domains import DOMAINS

FIRST = [
    sorted(p for p in d.glob("*.pddl") if p.name != "domain.pddl")[-1]
    for d in DOMAINS.iterdir()
    if (d / "domain.pddl").is_file()
]


def noted(domain_path: Path, problem_path: Path, more: frozenset[Atom]) -> list[str]:
    domain = read_domain(domain_path)
    problem = read_problem(problem_path, domain)
    problem = replace(problem, init=problem.init | more)
    loaded = build(domain, [problem])
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", Note)
        note_doubled(domain, [problem], loaded.model)
    return [str(one.message) for one in caught]


def test_nothing_is_noted_of_shipped_problems() -> None:
    for path in sorted(FIRST):
        assert noted(path.parent / "domain.pddl", path, frozenset()) == [], path


@pytest.mark.parametrize("place", ["grid", "three-cells", "t-map", "corridor"])
def test_a_second_place_is_noted(place: str) -> None:
    (path,) = (path for path in FIRST if path.parent.name == place)
    domain = read_domain(path.parent / "domain.pddl")
    problem = read_problem(path, domain)
    at = min((a for a in problem.init if a.predicate == "at"), key=lambda a: a.args)
    others = {a.args[1] for a in problem.init if a.predicate == "at"} - {at.args[1]}
    second = Atom("at", (at.args[0], min(others)))
    said = noted(path.parent / "domain.pddl", path, frozenset({second}))
    assert len(said) == 1
    assert (
        f"are true at the start, and actions only ever put one such fact about {at.args[0]}"
        in said[0]
    )
    # The definition: no reachable state has more facts about where it is than the start.
    loaded = build(domain, [replace(problem, init=problem.init | {second})])
    rows = explore(loaded.model, loaded.tasks[0].init[None, :]).rows
    about = {n for n, a in enumerate(loaded.model.codec.facts) if at.args[0] == a.args[0]}
    counts = [len(about.intersection(loaded.model.codec.true_facts(row))) for row in rows]
    assert max(counts) == 2


def test_the_command_says_it_once(coordlang: Command, tmp_path: Path) -> None:
    folder = DOMAINS / "three-cells"
    path = tmp_path / "two.pddl"
    text = (folder / "problem.pddl").read_text()
    path.write_text(text.replace("(at r1 a)", "(at r1 a) (at r1 c)"))
    outcome = coordlang("plans", folder / "domain.pddl", path, "--count")
    assert outcome.err.count("are true at the start") == 1
    assert outcome.err.startswith(f"coordlang: note: {path}:")
