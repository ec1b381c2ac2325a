# SPDX-License-Identifier: GPL-3.0-or-later
"""Arguments of atoms have a type in common with the declared one, or the text is refused."""

from __future__ import annotations

import re
from itertools import product
from random import Random

import pytest

from planners.pddl import parse_domain, parse_problem
from planners.pddl.sexpr import Source
from planners.system.errors import BadInput

TYPES = ("t0", "t1", "t2", "t3", "t4")


def typed(names: tuple[str, ...]) -> str:
    return f" - (either {' '.join(names or ('object',))})"


def above(parents: dict[str, tuple[str, ...]], name: str) -> set[str]:
    """The definition: the type, and all above one of its parents."""
    return {name}.union(*(above(parents, parent) for parent in parents[name]))


def test_random_types_against_the_definition() -> None:
    refused = read = 0
    for seed in range(300):
        pick = Random(seed)
        parents = {
            name: tuple(pick.sample(TYPES[:n], pick.choice((0, 1, 1, 2)) if n > 1 else 0))
            for n, name in enumerate(TYPES)
        }
        declared, own = (tuple(pick.sample(TYPES, pick.choice((0, 1, 1, 2)))) for _ in range(2))
        pairs = product(own, declared)
        fits = not (own and declared) or any(
            {a, b} <= above(parents, c) for a, b in pairs for c in TYPES
        )
        types = " ".join(f"{name}{typed(parents[name])}" for name in TYPES)
        domain = parse_domain(
            Source(
                "d",
                f"(define (domain d) (:types {types}) (:predicates (p ?x{typed(declared)}) (q))"
                " (:action a :parameters () :effect (q)))",
            )
        )
        sections = {
            "(:init (p o)) (:goal (q))": "argument 1 of 'p', 'o', is of type",
            "(:init) (:goal (p o))": "argument 1 of 'p', 'o', is of type",
            f"(:init) (:goal (forall (?v{typed(own)}) (p ?v)))": "argument 1 of 'p', '?v', is of",
        }
        for section, message in sections.items():
            text = f"(define (problem x) (:domain d) (:objects o{typed(own)}) {section})"
            if fits:
                parse_problem(Source("p", text), domain)
                read += 1
            else:
                with pytest.raises(BadInput, match=re.escape(message)) as caught:
                    parse_problem(Source("p", text), domain)
                position = caught.value.position
                assert position is not None
                assert text[position.column - 1 :].startswith(("o)", "?v)"))
                refused += 1
    assert refused > 100
    assert read > 100


def test_an_undeclared_type_and_several_declarations_restrict_nothing_more() -> None:
    domain = parse_domain(
        Source(
            "d",
            "(define (domain d) (:types robot room) (:predicates (p ?x - thing) (at ?r - robot)"
            " (:private (at ?r - room)) (at ?r - robot ?x - room))"
            " (:action a :parameters (?r - robot) :effect (and (p ?r) (at ?r))))",
        )
    )
    text = (
        "(define (problem x) (:domain d) (:objects r - robot a - room)"
        " (:init (p r) (p a) (at r) (at a) (at r a)) (:goal (at a r)))"
    )
    parse_problem(Source("p", text.replace("(at a r)", "(at r a)")), domain)
    with pytest.raises(BadInput) as caught:
        parse_problem(Source("p", text), domain)
    assert str(caught.value) == (
        "p:1:117: argument 1 of 'at', 'a', is of type room, not robot\n"
        "  It is declared as (at robot room): are arguments swapped, or is a type missing there?"
    )
