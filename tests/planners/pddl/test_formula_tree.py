# SPDX-License-Identifier: GPL-3.0-or-later
"""Formulas taken apart and put together, against the definition on random formulas; domains as text."""

from __future__ import annotations

from dataclasses import replace
from itertools import product
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from planners.pddl import lifted as f
from planners.pddl.domain import parse_domain, read_domain
from planners.pddl.formula_tree import conjuncts, joined, negated, signed, substituted
from planners.pddl.pddl_text import domain_text, problem_text
from planners.pddl.problem import parse_problem, read_problem
from planners.pddl.sexpr import Source
from tests.support.domains import DOMAINS, SHARED

LEAVES: tuple[f.Formula, ...] = (f.Atom("a", ()), f.Atom("b", ()), f.StepAtom("move", ("r1", "x")))
#: Ground formulas, not in negation normal form.
FORMULAS = st.recursive(
    st.sampled_from((*LEAVES, f.TRUE, f.FALSE)),
    lambda parts: st.one_of(
        st.builds(f.Not, parts),
        st.builds(f.And, st.lists(parts, max_size=3).map(tuple)),
        st.builds(f.Or, st.lists(parts, max_size=3).map(tuple)),
    ),
    max_leaves=8,
)


def true(formula: f.Formula, values: dict[f.Formula, bool]) -> bool:
    """The definition."""
    match formula:
        case f.Truth(value):
            return value
        case f.Not(part):
            return not true(part, values)
        case f.And(parts):
            return all(true(part, values) for part in parts)
        case f.Or(parts):
            return any(true(part, values) for part in parts)
    return values[formula]


@given(FORMULAS)
def test_the_meaning_is_kept(formula: f.Formula) -> None:
    assert joined(f.And, [formula, f.FALSE]) == f.FALSE
    part, positive = signed(formula)
    assert (part if positive else f.Not(part)) == formula
    for chosen in product((False, True), repeat=len(LEAVES)):
        values = dict(zip(LEAVES, chosen, strict=True))
        meant = true(formula, values)
        assert true(f.And(conjuncts(formula)), values) == meant
        assert true(negated(formula), values) != meant
        assert true(substituted(formula, lambda leaf: leaf), values) == meant
        decided = substituted(formula, lambda leaf: f.Truth(values[leaf]))  # noqa: B023 - now
        assert decided == f.Truth(meant)


NOWHERE = Source("nowhere", "")
OWN = sorted(DOMAINS.glob("*/domain.pddl"))
FOREIGN = sorted(
    path for path in SHARED.glob("[cf]o*/*/domain*.pddl") if "factored" not in str(path)
)


def check(path: Path) -> None:
    domain = read_domain(path)
    again = parse_domain(Source("again", text := domain_text(domain)))
    assert replace(again, source=NOWHERE) == replace(domain, source=NOWHERE)
    assert sorted(domain_text(again).splitlines()) == sorted(text.splitlines())
    files = [p for p in path.parent.glob("*.pddl") if "(problem" in p.read_text("latin-1").lower()]
    for file in sorted(files)[:3]:
        problem = read_problem(file, domain)
        found = parse_problem(Source("again", problem_text(problem, domain)), again)
        assert replace(found, source=NOWHERE) == replace(problem, source=NOWHERE)


@pytest.mark.parametrize("path", OWN, ids=lambda path: path.parent.name)
def test_own_domains(path: Path) -> None:
    check(path)


@pytest.mark.parametrize(
    "number",
    ["0", "3.0", "1234567", "2147483647", "-0.0000123", "12345.678901", "9" * 22, "9" * 400],
)
def test_values_of_functions(number: str) -> None:
    text = "(define (domain d) (:functions (f)) (:action a :parameters ()))"
    domain = parse_domain(Source("d", text))
    text = f"(define (problem p) (:domain d) (:init (= (f) {number})) (:goal ()))"
    problem = parse_problem(Source("p", text), domain)
    again = parse_problem(Source("again", problem_text(problem, domain)), domain)
    assert again.values == problem.values == {f.Atom("f", ()): float(number)}


@pytest.mark.foreign
@pytest.mark.parametrize("path", FOREIGN, ids=lambda path: f"{path.parent.name}-{path.stem}")
def test_domains_of_others(path: Path) -> None:
    check(path)
