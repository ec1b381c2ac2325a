# SPDX-License-Identifier: GPL-3.0-or-later
"""Features read back from their s-expressions (`coordlang.lifted.features`)."""

from __future__ import annotations

import re
from typing import cast

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
from planners.system.errors import BadInput, Position
from planners.system.messages import echoed

_TOKEN = re.compile(r"[()]|[^\s()]+")
#: Longer definitions are refused; no feature of ours is as long.
_LONGEST = 1_000
#: Numbers in definitions, and values of features, are smaller than this.
LARGEST = 1_000_000

Tree = str | list["Tree"]


def feature_of(text: str, position: Position) -> Feature:
    """The feature that a text defines.

    Raises `BadInput` for anything else.
    """
    try:
        found = _feature(_tree(text))
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


def _feature(tree: Tree) -> Feature | None:
    match tree:
        case ["sign", ["-", one, other]]:
            return Sign(_number(one), _number(other))
        case ["mod", number, str(modulus)] if 1 < int(modulus) < LARGEST:
            return Residue(_number(number), int(modulus))
        case ["min", number, str(most)] if 0 < int(most) < LARGEST:
            return Least(_number(number), int(most))
        case ["same", one, other]:
            return Same(_term(one), _term(other))
    return None


def _number(tree: Tree) -> Number:
    match tree:
        case ["distance", str(relation), one, other]:
            return Distance(relation, _term(one), _term(other))
        case ["count", str(predicate), *args]:
            names = tuple(arg for arg in args if isinstance(arg, str))
            if len(names) == len(args):
                return Count(predicate, names)
        case ["size", concept]:
            return Size(_concept(concept))
        case ["gap", str(relation), one, other]:
            return Gap(relation, _concept(one), _concept(other))
        case [("row" | "column") as name, term]:
            return Attribute(cast(str, name), "", _term(term))
        case [("degree" | "position") as name, str(relation), term]:
            return Attribute(cast(str, name), relation, _term(term))
    raise ValueError


def _term(tree: Tree) -> Term:
    match tree:
        case ["inverse", str(predicate), str(named)]:
            return Term(predicate, named, inverse=True)
        case [str(predicate), str(named)]:
            return Term(predicate, named)
    raise ValueError


def _concept(tree: Tree) -> Concept:
    match tree:
        case "all":
            return Everything()
        case str(name):
            return Named(name)
        case ["one", str(name)]:
            return One(name)
        case ["not", concept]:
            return Without(_concept(concept))
        case ["and", one, other]:
            return Both(_concept(one), _concept(other))
        case ["some", role, concept]:
            return Some(_role(role), _concept(concept))
    raise ValueError


def _role(tree: Tree) -> Role:
    match tree:
        case str(predicate):
            return Role(predicate)
        case ["inverse", str(predicate)]:
            return Role(predicate, inverse=True)
        case ["closure", ["inverse", str(predicate)]]:
            return Role(predicate, inverse=True, closure=True)
        case ["closure", str(predicate)]:
            return Role(predicate, closure=True)
    raise ValueError
