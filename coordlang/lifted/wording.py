# SPDX-License-Identifier: GPL-3.0-or-later
"""Features as formulas and in English: ``column(at(r1)) mod 3``, "the column of what .."."""

from __future__ import annotations

from coordlang.lifted.features import (
    UNDEFINED,
    Attribute,
    Count,
    Expression,
    Feature,
    Least,
    Residue,
    Role,
    Same,
    Sign,
    Term,
)
from coordlang.lifted.world import ANY

_SIGNS = {-1: "<", 0: "=", 1: ">"}


def condition(feature: Feature, value: int) -> str:
    """What it means that a feature has a value: ``column(at(r1)) mod 3 = 1``."""
    if value == UNDEFINED:
        return f"{formula(feature)} undefined"
    match feature:
        case Sign(one, other):
            return f"{formula(one)} {_SIGNS.get(value, '?')} {formula(other)}"
        case Least(number, most):
            return f"{formula(number)} {'>=' if value == most else '='} {value}"
        case Same(first, second):
            return f"{formula(first)} {'=' if value else '!='} {formula(second)}"
        case Residue():
            return f"{formula(feature)} = {value}"


def formula(part: object) -> str:
    """A feature, or a part of one, as a formula: ``column(at(r1)) mod 3``."""
    match part:
        case Attribute(name, relation, term):
            return f"{relation + '-' if relation else ''}{name}({formula(term)})"
        case Count(predicate, args):
            return f"#{predicate}({', '.join(args)})"
        case Term(predicate, named, inverse):
            return f"{predicate}{'^-1' * inverse}({named})"
        case Role(predicate, inverse, closure):
            return f"{predicate}{'^-1' * inverse}{'+' * closure}"
        case Expression():
            return part.FORMS[0].format(*map(formula, part.parts))
    return str(part)


def english(part: object) -> str:
    """A feature, or a part of one, in words."""
    match part:
        case Attribute("degree", relation, term):
            return f"the number of objects that {relation} links with {english(term)}"
        case Attribute(name, relation, term):
            along = f" along {relation}" if relation else ""
            return f"the {name}{along} of {english(term)}"
        case Count(predicate, args):
            shown = (".." if arg == ANY else arg for arg in args)
            return f"the number of true atoms ({' '.join((predicate, *shown))})"
        case Term(predicate, named, inverse):
            ends = ("..", named) if inverse else (named, "..")
            return f"the object in ({' '.join((predicate, *ends))})"
        case Role(predicate, inverse, closure):
            steps = " in one or more steps" * closure
            return f"{'inversely ' * inverse}{predicate}-related{steps}"
        case Expression():
            return part.FORMS[1].format(*map(english, part.parts))
    return str(part)
