# SPDX-License-Identifier: GPL-3.0-or-later
"""Features as formulas and in English: ``column(at(r1)) mod 3``, "the column of what .."."""

from __future__ import annotations

from collections.abc import Mapping

from coordlang.lifted.features import (
    UNDEFINED,
    Attribute,
    Both,
    Count,
    Distance,
    Everything,
    Expression,
    Feature,
    Gap,
    Least,
    Named,
    One,
    Residue,
    Role,
    Same,
    Sign,
    Size,
    Some,
    Term,
    Without,
)
from coordlang.lifted.world import ANY

_SIGNS = {-1: "<", 0: "=", 1: ">"}
#: What is made of its parts, as a formula and in English.
_FORMS: Mapping[type[Expression], tuple[str, str]] = {
    Sign: ("sign({} - {})", "which is larger, {} or {}"),
    Residue: ("{} mod {}", "{}, modulo {}"),
    Least: ("min({}, {})", "{0}, where {1} stands for {1} or more"),
    Same: ("[{} = {}]", "whether {} is {}"),
    Distance: ("{}-distance({}, {})", "the links of {} between {} and {}"),
    Size: ("|{}|", "the number of objects that are {}"),
    Gap: (
        "{}-distance({}, {})",
        "the fewest links of {} between an object that is {} and one that is {}",
    ),
    Everything: ("all", "any"),
    Named: ("{}", "{}"),
    One: ("{{{}}}", "{}"),
    Without: ("not {}", "not {}"),
    Both: ("({} and {})", "({} and {})"),
    Some: ("some {}.{}", "{} to something {}"),
}


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
            return _FORMS[type(part)][0].format(*map(formula, part.parts))
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
            return _FORMS[type(part)][1].format(*map(english, part.parts))
    return str(part)
