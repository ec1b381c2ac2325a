# SPDX-License-Identifier: GPL-3.0-or-later
"""Features as people read them, and read back from their s-expressions.

As formulas, ``column(at(r1)) mod 3``, and in English, "the column of what ..".
"""

from __future__ import annotations

import re
from dataclasses import fields, replace
from typing import Any, get_args

from coordlang.lifted.features import (
    UNDEFINED,
    Attribute,
    Concept,
    Count,
    Everything,
    Expression,
    Feature,
    Least,
    Named,
    Number,
    Residue,
    Role,
    Same,
    Sign,
    Term,
)
from coordlang.lifted.world import ANY
from planners.system.errors import BadInput, Position
from planners.system.messages import echoed

_SIGNS = {-1: "<", 0: "=", 1: ">"}
_TOKEN = re.compile(r"[()]|[^\s()]+")
#: Longer definitions are refused; no feature of ours is as long.
_LONGEST = 1_000
#: Numbers in definitions, and values of features, are smaller than this.
LARGEST = 1_000_000

Tree = str | list["Tree"]

#: What is written as its head and its parts in order, by its kind, the type of a field.
_MADE: dict[tuple[str, str], type[Expression]] = {
    (kind, made.HEAD): made
    for kind, types in (("Feature", Feature), ("Number", Number), ("Concept", Concept))
    for made in get_args(types)
    if hasattr(made, "HEAD")
}


def feature_of(text: str, position: Position) -> Feature:
    """The feature that a text defines.  Raises `BadInput` for anything else."""
    try:
        found: Feature | None = _read("Feature", _tree(text))
    except (ValueError, IndexError):
        found = None
    if found is None or str(found) != " ".join(text.split()):
        raise BadInput(
            f"{echoed(text)} defines no feature",
            position=position,
            remedy="As in (mod (row (at r1)) 3), (sign (- (row (at r1)) (row (at r2)))) or "
            "(min (count holds r1 _) 1).",
        )
    return found


def _tree(text: str) -> Tree:
    if len(text) > _LONGEST:
        raise ValueError
    stack: list[list[Tree]] = [[]]
    for token in _TOKEN.findall(text):
        if token == "(":
            stack.append([])
        elif token == ")":
            done = stack.pop()
            stack[-1].append(done)
        else:
            stack[-1].append(token)
    (whole,), *open_groups = stack
    if open_groups:
        raise ValueError
    return whole


def _read(kind: str, tree: Tree) -> Any:
    """What a text is as something of a kind, the type of a field.  Raises `ValueError` if none."""
    match kind, tree:
        case "str", str():
            return tree
        case "int", str() if 0 < int(tree) < LARGEST:
            return int(tree)
        case "Feature", ["mod", _, "1"]:
            raise ValueError
        case "Feature", ["sign", ["-", one, other]]:
            return Sign(_read("Number", one), _read("Number", other))
        case (("Term" | "Role"), _):
            return _term(tree) if kind == "Term" else _role(tree)
        case "Concept", str():
            return Everything() if tree == "all" else Named(tree)
        case _, [str(head), *parts]:
            made = _MADE.get((kind, head))
            if made is None:
                return _number(kind, head, parts)
            kinds = [str(field.type) for field in fields(made)]  # type: ignore[arg-type]
            return made(*(_read(own, part) for own, part in zip(kinds, parts, strict=True)))
    raise ValueError


def _number(kind: str, head: str, parts: list[Tree]) -> Attribute | Count:
    match kind, head, parts:
        case "Number", "count", [predicate, *args]:
            return Count(_read("str", predicate), tuple(_read("str", arg) for arg in args))
        case "Number", ("row" | "column"), [term]:
            return Attribute(head, "", _term(term))
        case "Number", ("degree" | "position"), [str(relation), term]:
            return Attribute(head, relation, _term(term))
    raise ValueError


def _term(tree: Tree) -> Term:
    match tree:
        case ["inverse", str(predicate), str(named)]:
            return Term(predicate, named, inverse=True)
        case [str(predicate), str(named)]:
            return Term(predicate, named)
    raise ValueError


def _role(tree: Tree) -> Role:
    match tree:
        case str(predicate):
            return Role(predicate)
        case ["inverse", str(predicate)]:
            return Role(predicate, inverse=True)
        case ["closure", one]:
            return replace(_role(one), closure=True)  # twice is refused: it is written once
    raise ValueError


# ---- as formulas and in English


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
