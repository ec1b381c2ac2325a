# SPDX-License-Identifier: GPL-3.0-or-later
"""docs/pddl.md: its table of what is not supported, its dialects, and that its answers are compared."""

from __future__ import annotations

import pytest

from planners.pddl import parse_domain
from planners.pddl.sexpr import Source
from planners.system.errors import BadInput, Unsupported
from tests.support.domains import ROOT
from tests.support.pages import DOCS, blocks, code, links, rows, sections
from tests.support.texts import model_of

PAGE = DOCS / "pddl.md"
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


def test_an_unknown_section_is_bad_input() -> None:
    with pytest.raises(BadInput, match="unknown section ':observe'"):
        model_of(*texts("section", "(:observe (p))"))


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
