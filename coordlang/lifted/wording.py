# SPDX-License-Identifier: GPL-3.0-or-later
"""Features as formulas and in English: ``column(at(r1)) mod 3``, "the column of what .."."""

from __future__ import annotations

from collections.abc import Sequence

from coordlang.lifted.concepts import (
    Both,
    Concept,
    Everything,
    Gap,
    Named,
    One,
    Role,
    Size,
    Some,
    Without,
)
from coordlang.lifted.features import (
    UNDEFINED,
    Attribute,
    Count,
    Distance,
    Feature,
    Least,
    Number,
    Residue,
    Same,
    Sign,
    Term,
)
from coordlang.lifted.world import ANY

_SIGNS = {-1: "<", 0: "=", 1: ">"}


def formula(feature: Feature) -> str:
    """A feature as a formula, ``column(at(r1)) mod 3``."""
    match feature:
        case Sign(one, other):
            return f"sign({_number(one)} - {_number(other)})"
        case Residue(number, modulus):
            return f"{_number(number)} mod {modulus}"
        case Least(number, most):
            return f"min({_number(number)}, {most})"
        case Same(first, second):
            return f"[{_term(first)} = {_term(second)}]"


def condition(feature: Feature, value: int) -> str:
    """What it means that a feature has a value: ``column(at(r1)) mod 3 = 1``."""
    if value == UNDEFINED:
        return f"{formula(feature)} undefined"
    match feature:
        case Sign(one, other):
            return f"{_number(one)} {_SIGNS.get(value, '?')} {_number(other)}"
        case Least(number, most):
            return f"{_number(number)} {'>=' if value == most else '='} {value}"
        case Same(first, second):
            return f"{_term(first)} {'=' if value else '!='} {_term(second)}"
        case Residue():
            return f"{formula(feature)} = {value}"


def english(feature: Feature) -> str:
    """A feature in words."""
    match feature:
        case Sign(one, other):
            return f"which is larger, {_number_said(one)} or {_number_said(other)}"
        case Residue(number, modulus):
            return f"{_number_said(number)}, modulo {modulus}"
        case Least(number, most):
            return f"{_number_said(number)}, where {most} stands for {most} or more"
        case Same(first, second):
            return f"whether {_term_said(first)} is {_term_said(second)}"


def _number(number: Number) -> str:
    match number:
        case Attribute(name, relation, term):
            return f"{relation + '-' if relation else ''}{name}({_term(term)})"
        case Distance(relation, one, other):
            return f"{relation}-distance({_term(one)}, {_term(other)})"
        case Count(predicate, args):
            return f"#{predicate}({', '.join(args)})"
        case Size(concept):
            return f"|{_concept(concept)}|"
        case Gap(relation, first, second):
            return f"{relation}-distance({_concept(first)}, {_concept(second)})"


def _term(term: Term) -> str:
    return f"{term.predicate}{'^-1' * term.inverse}({term.named})"


def _concept(concept: Concept) -> str:
    match concept:
        case Everything():
            return "all"
        case Named(name):
            return name
        case One(name):
            return f"{{{name}}}"
        case Without(inner):
            return f"not {_concept(inner)}"
        case Both(one, other):
            return f"({_concept(one)} and {_concept(other)})"
        case Some(role, inner):
            return f"some {_role(role)}.{_concept(inner)}"


def _role(role: Role) -> str:
    return f"{role.predicate}{'^-1' * role.inverse}{'+' * role.closure}"


def _number_said(number: Number) -> str:
    match number:
        case Attribute("degree", relation, term):
            return f"the number of objects that {relation} links with {_term_said(term)}"
        case Attribute("position", relation, term):
            return f"the position along {relation} of {_term_said(term)}"
        case Attribute(name, _, term):
            return f"the {name} of {_term_said(term)}"
        case Distance(relation, one, other):
            return f"the links of {relation} between {_term_said(one)} and {_term_said(other)}"
        case Count(predicate, args):
            return f"the number of true atoms ({' '.join((predicate, *map(_any, args)))})"
        case Size(concept):
            return f"the number of objects that are {_concept_said(concept)}"
        case Gap(relation, first, second):
            between = f"{_concept_said(first)} and one that is {_concept_said(second)}"
            return f"the fewest links of {relation} between an object that is {between}"


def _any(arg: str) -> str:
    return ".." if arg == ANY else arg


def _term_said(term: Term) -> str:
    ends: Sequence[str] = ("..", term.named) if term.inverse else (term.named, "..")
    return f"the object in ({' '.join((term.predicate, *ends))})"


def _concept_said(concept: Concept) -> str:
    match concept:
        case Everything():
            return "any"
        case Named(name) | One(name):
            return name
        case Without(inner):
            return f"not {_concept_said(inner)}"
        case Both(one, other):
            return f"({_concept_said(one)} and {_concept_said(other)})"
        case Some(role, inner):
            inverse = "inversely " * role.inverse
            steps = " in one or more steps" * role.closure
            return f"{inverse}{role.predicate}-related{steps} to something {_concept_said(inner)}"
