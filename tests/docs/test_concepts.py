# SPDX-License-Identifier: GPL-3.0-or-later
"""The examples of docs/concepts.md that it gives in words, as models, and its table of names."""

from __future__ import annotations

import pkgutil
import re

from coordlang.verification.by_definition import inseparable
from planners.search.optimal_plans import search
from planners.search.plan_space import PlanSpace
from planners.search.plans import Plans
from tests.support import naive
from tests.support.domains import ROOT
from tests.support.pages import DOCS, code, prose, rows, sections
from tests.support.texts import model_of


def joint_space(actions: list[tuple[str, str, str]], robots: int, goal: str) -> PlanSpace:
    """Joint-action PDDL of (subactions, precondition, effect); ``-`` idles, facts are p0 .. p9."""
    text = []
    for number, (parts, before, after) in enumerate(actions):
        comments = "\n".join(
            f"; subaction r{n} {'idle' if p == '-' else f'({p})'}"
            for n, p in enumerate(parts.split(), 1)
        )
        text.append(
            f"(:action j{number} :parameters ()\n{comments}\n :precondition (and {before}) :effect (and {after}))"
        )
    predicates = " ".join(f"(p{n})" for n in range(10))
    loaded = model_of(
        f"(define (domain d) (:predicates {predicates})\n" + "\n".join(text) + ")",
        f"(define (problem p) (:domain d) (:init) (:goal (and {goal})))",
    )
    assert len(loaded.model.robots) == robots
    return search(loaded.model, loaded.tasks[0])


def test_two_actions_of_one_effect() -> None:
    """Subtlety (a): the lamp that either robot may switch on, but not both."""
    space = joint_space([("press -", "", "(p0)"), ("- press", "", "(p0)")], 2, "(p0)")
    assert Plans.of(space).count == 2
    assert inseparable(space) is not None


def test_failing_after_the_plans_have_met() -> None:
    """Subtlety (c): p0 is the lamp, p1 to p3 count the steps."""
    flip = [
        (parts, f"{before} {lamp}", f"{after} {new}")
        for before, after in [("(not (p1))", "(p1)"), ("(p1) (not (p2))", "(p2)")]
        for lamp, choices in [
            ("(not (p0))", [("- -", ""), ("flip -", "(p0)"), ("- flip", "(p0)")]),
            ("(p0)", [("- -", ""), ("flip -", "(not (p0))"), ("- flip", "(not (p0))")]),
        ]
        for parts, new in choices
    ]
    finish = [("finish -", "(p2) (p0)", "(p3)"), ("- finish", "(p2) (not (p0))", "(p3)")]
    space = joint_space(flip + finish, 2, "(p3)")
    plans = Plans.of(space)
    by_text = {tuple(map(space.model.texts, plan)): plan for plan in plans}
    first = by_text[(("(flip)", None), (None, None), ("(finish)", None))]
    second = by_text[((None, None), (None, "(flip)"), ("(finish)", None))]
    mixed = naive.mixture((second, first))
    waits = (None, None)
    assert [*map(space.model.texts, mixed)] == [waits, waits, ("(finish)", None)]
    assert plans.states(first)[1] != plans.states(second)[1]
    assert plans.states(first)[2] == plans.states(second)[2]
    assert plans.rank(mixed) is None
    # Two steps of the mixture begin an optimal plan: only the third one breaks.
    assert any(plan[:2] == mixed[:2] for plan in plans)


def test_names_of_the_table_exist() -> None:
    """Every name of code in the table of the paper's symbols can be imported."""
    table = rows(sections(DOCS / "concepts.md")["Symbols and names"])
    names = [name for cells in table for name in code(cells[-1]) if "." in name]
    assert len(names) >= len(table)
    for name in names:
        assert pkgutil.resolve_name(name)


def test_propositions_that_docstrings_cite_are_there() -> None:
    page = prose(DOCS / "concepts.md")
    stated = re.findall(r"(?m)^(?:- \*[^*]+\* )?\*\*Proposition (\d+)\.?\*\*", page)
    real = {*map(int, stated)}
    paths = [path for name in ("planners", "coordlang") for path in (ROOT / name).rglob("*.py")]
    text = "\n".join(path.read_text() for path in paths)
    citing = re.findall(r"Propositions? ([\d, and]+)\s+of\s+docs/concepts", text)
    cited = {int(number) for found in citing for number in re.findall(r"\d+", found)}
    assert real == set(range(1, len(real) + 1))
    assert len(cited) > 5
    assert cited <= real
