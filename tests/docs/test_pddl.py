# SPDX-License-Identifier: GPL-3.0-or-later
"""docs/pddl.md and docs/concepts: what is not supported, dialects, examples in words, names."""

from __future__ import annotations

import pkgutil
import re

import pytest

from coordlang.verification.by_definition import inseparable
from planners.pddl import parse_domain
from planners.pddl.sexpr import Source
from planners.search.optimal_plans import search
from planners.search.plan_space import PlanSpace
from planners.search.plans import Plans
from planners.system.errors import Unsupported
from tests.support import naive
from tests.support.domains import ROOT
from tests.support.pages import DOCS, blocks, code, links, prose, rows, sections
from tests.support.texts import model_of

PAGE = DOCS / "pddl.md"
CONCEPTS = DOCS / "concepts"
REFUSED = rows(sections(PAGE)["What is not supported"])


def texts(where: str = "", example: str = "") -> tuple[str, str]:
    """A domain and a problem with an example in one place."""
    parts = {"section": "", "condition": "(p)", "effect": "(p)", "init": "(p)"}
    assert not where or where in parts, where
    parts |= {where: example} if where else {}
    return (
        f"""(define (domain d) (:types robot) (:predicates (p) (q ?x)) (:functions (f) (total-cost)) {parts["section"]}
        (:action a :agent ?r - robot :precondition {parts["condition"]} :effect {parts["effect"]}))""",
        f"(define (problem p) (:domain d) (:objects r1 - robot) (:init {parts['init']}) (:goal (p)))",
    )


def test_without_an_example_nothing_is_refused() -> None:
    model_of(*texts())
    assert len(REFUSED) >= 19


@pytest.mark.parametrize("cells", REFUSED, ids=lambda cells: cells[0])
def test_what_is_not_supported(cells: list[str]) -> None:
    with pytest.raises(Unsupported) as error:
        model_of(*texts(cells[1], code(cells[0])[0]))
    assert error.value.what in (f"{cells[2]} {verb} not supported" for verb in ("is", "are"))
    assert error.value.exit_code == 34
    place = error.value.position
    assert place is not None
    assert place.file == ("problem.pddl" if cells[1] == "init" else "domain.pddl")
    assert place.line > 0


def test_every_answer_is_compared() -> None:
    """Each Python block that asks is followed by its output."""
    kinds = [(b.kind, "ask(" in b.text and "def ask(" not in b.text) for b in blocks(PAGE)]
    asking = [n for n, (kind, asks) in enumerate(kinds) if kind == "python" and asks]
    assert len(asking) >= 12
    assert all(kinds[n + 1][0] == "output" for n in asking)


def test_each_example_domain_is_of_its_dialect() -> None:
    """The files that the table of dialects points to are read as what it says."""
    styles = {}
    for cells in rows(sections(PAGE)["Dialects"]):
        for target in [t for t in links(PAGE) if t in cells[2] and t.endswith(".pddl")]:
            text = (PAGE.parent / target).resolve().relative_to(ROOT)
            domain = parse_domain(Source(str(text), (ROOT / text).read_text()))
            agents = any(schema.agent is not None for schema in domain.schemas)
            styles[cells[0]] = (domain.is_joint_action, agents, bool(domain.types))
    assert styles == {
        "plain PDDL, typed": (False, False, True),
        "plain PDDL, untyped": (False, False, False),
        "joint-action PDDL": (True, False, True),
        "MA-PDDL": (False, True, True),
        "action formulas (Kovacs 2012)": (False, True, True),
    }


# ---- examples that docs/concepts/coordination.md gives in words


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
    table = rows(sections(CONCEPTS / "definitions.md")["Symbols and names"])
    names = [name for cells in table for name in code(cells[-1]) if "." in name]
    assert len(names) >= len(table)
    for name in names:
        assert pkgutil.resolve_name(name)


def test_propositions_that_docstrings_cite_are_there() -> None:
    page = "\n".join(map(prose, sorted(CONCEPTS.glob("*.md"))))
    stated = re.findall(r"(?m)^(?:- \*[^*]+\* )?\*\*Proposition (\d+)\.?\*\*", page)
    real = {*map(int, stated)}
    paths = [path for name in ("planners", "coordlang") for path in (ROOT / name).rglob("*.py")]
    text = "\n".join(path.read_text() for path in paths)
    citing = re.findall(r"Propositions? ([\d, and]+)\s+of\s+docs/concepts", text)
    cited = {int(number) for found in citing for number in re.findall(r"\d+", found)}
    assert real == set(range(1, len(real) + 1))
    assert len(cited) > 5
    assert cited <= real
