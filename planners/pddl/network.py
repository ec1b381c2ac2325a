# SPDX-License-Identifier: GPL-3.0-or-later
"""Concurrency networks (Crosby, Jonsson, Rovatsos 2014).

Constraints on how many do an action together.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

from planners.pddl.lifted import Constraint, Schema
from planners.pddl.names import Names, group, known, token
from planners.pddl.sexpr import Expression, Group, Token
from planners.system.messages import echoed

#: What a constraint looks like.
_FORM = (
    "As in (:concurrency-constraint v :parameters (?b - boat) :bounds (2 inf) :actions ((row 1)))."
)
#: More robots than there ever are: larger numbers mean the same.
_MANY = 1_000_000_000


def read_network(
    names: Names, schemas: Sequence[Schema], sections: dict[str, list[Group]]
) -> tuple[tuple[Constraint, ...], tuple[tuple[str, str], ...]]:
    """The ``:concurrency-constraint`` and ``:positive-dependence`` sections of a domain.

    Raises `BadInput` for unknown actions, positions outside the arguments, impossible bounds,
    unknown constraints.
    """
    arities = {schema.name: len(schema.parameters) for schema in schemas}
    constraints = [
        _constraint(names, arities, s) for s in sections.get(":concurrency-constraint", ())
    ]
    by_name = {c.name: c for c in constraints}
    dependences = []
    for section in sections.get(":positive-dependence", ()):
        pair = [
            token(names.document, item, "the name of a constraint") for item in section.items[1:]
        ]
        if len(pair) != 2:
            raise names.document.fail(
                "expected '(:positive-dependence V W)'",
                section,
                remedy="Both are names of constraints: whoever matches W needs "
                "somebody who matches V.",
            )
        for item in pair:
            if item.text not in by_name:
                remedy = known(by_name, item.text, "constraint")
                raise names.document.fail(f"unknown constraint {echoed(item.text)}", item, remedy)
        first, second = (by_name[item.text] for item in pair)
        if len(first.parameters) != len(second.parameters):
            raise names.document.fail(
                "the two constraints have different numbers of parameters",
                section,
                remedy="They are bound to the same objects: give both as many :parameters.",
            )
        dependences.append((first.name, second.name))
    return tuple(constraints), tuple(dependences)


def _constraint(names: Names, arities: dict[str, int], section: Group) -> Constraint:
    document = names.document
    if len(section) < 2:
        raise document.fail("expected the name of the constraint", section, remedy=_FORM)
    name = token(document, section.items[1], "the name of the constraint").text
    fields: dict[str, Expression] = {}
    items = section.items[2:]
    for key, value in zip(items[::2], items[1::2], strict=False):
        fields[token(document, key, "a keyword").text] = value
    missing = {":parameters", ":bounds", ":actions"} - set(fields)
    if missing or len(items) % 2:
        raise document.fail(
            "a constraint has :parameters, :bounds and :actions"
            + (f"; missing: {', '.join(sorted(missing))}" if missing else ""),
            section,
            remedy=_FORM,
        )
    parameters = names.read_variables(
        group(document, fields[":parameters"], "a list of variables").items
    )
    low, high = _bounds(names, group(document, fields[":bounds"], "'(LOW HIGH)'"))
    actions, offsets = [], []
    for item in group(document, fields[":actions"], "a list of actions").items:
        entry = group(document, item, "'(action POSITION ..)'")
        if entry.head not in arities:
            raise names.unknown("action", entry, arities)
        positions = tuple(_number(names, part) for part in entry.items[1:])
        if len(positions) != len(parameters) or any(p >= arities[entry.head] for p in positions):
            raise document.fail(
                f"expected {len(parameters)} argument positions below {arities[entry.head]} (the "
                "agent is argument 0)",
                entry,
                remedy="Each number says which argument of the action a "
                "parameter of the constraint is.",
            )
        actions.append((entry.head, positions))
        offsets.append(entry.offset)
    return Constraint(name, parameters, low, high, tuple(actions), tuple(offsets))


def _bounds(names: Names, item: Group) -> tuple[int, int | None]:
    if len(item) != 2:
        raise names.document.fail(
            "expected '(LOW HIGH)'",
            item,
            remedy="As in (2 inf): at least two robots do it together, or none.",
        )
    low = _number(names, item.items[0])
    high = item.items[1]
    if isinstance(high, Token) and high.text in ("inf", "infinity"):
        return low, None
    most = _number(names, high)
    if most < low or most == 0:
        raise names.document.fail(
            f"no robots can meet the bounds ({low} {most})",
            item,
            "HIGH is at least 1 and at least LOW; inf is no upper bound.",
        )
    return low, most


def _number(names: Names, item: Expression) -> int:
    text = token(names.document, item, "a number").text
    if not re.fullmatch(r"[0-9]+", text):
        raise names.document.fail(
            f"expected a number from 0, found {echoed(text)}",
            item,
            remedy="Arguments of an action are counted from 0, bounds are numbers of robots.",
        )
    digits = text.lstrip("0") or "0"
    return int(digits) if len(digits) <= len(str(_MANY)) else _MANY
