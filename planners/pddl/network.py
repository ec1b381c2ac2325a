# SPDX-License-Identifier: GPL-3.0-or-later
"""Concurrency networks (Crosby, Jonsson, Rovatsos 2014).

Constraints on how many do an action together.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

from planners.pddl.lifted import Constraint, Schema
from planners.pddl.names import Names, known
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
    document = names.document
    arities = {schema.name: len(schema.parameters) for schema in schemas}
    constraints = [
        _constraint(names, arities, s) for s in sections.get(":concurrency-constraint", ())
    ]
    by_name = {c.name: c for c in constraints}
    dependences = []
    for section in sections.get(":positive-dependence", ()):
        pair = [document.token(item, "the name of a constraint") for item in section.items[1:]]
        if len(pair) != 2:
            remedy = (
                "Both are names of constraints: whoever matches W needs somebody who matches V."
            )
            raise document.fail("expected '(:positive-dependence V W)'", section, remedy)
        for item in pair:
            if item.text not in by_name:
                remedy = known(by_name, item.text, "constraint")
                raise document.fail(f"unknown constraint {echoed(item.text)}", item, remedy)
        first, second = (by_name[item.text] for item in pair)
        if len(first.parameters) != len(second.parameters):
            what = "the two constraints have different numbers of parameters"
            remedy = "They are bound to the same objects: give both as many :parameters."
            raise document.fail(what, section, remedy)
        dependences.append((first.name, second.name))
    return tuple(constraints), tuple(dependences)


def _constraint(names: Names, arities: dict[str, int], section: Group) -> Constraint:
    document = names.document
    if len(section) < 2:
        raise document.fail("expected the name of the constraint", section, _FORM)
    name = document.token(section.items[1], "the name of the constraint").text
    items = section.items[2:]
    fields = {
        document.token(key, "a keyword").text: value
        for key, value in zip(items[::2], items[1::2], strict=False)
    }
    missing = {":parameters", ":bounds", ":actions"} - set(fields)
    if missing or len(items) % 2:
        what = "a constraint has :parameters, :bounds and :actions"
        what += f"; missing: {', '.join(sorted(missing))}" if missing else ""
        raise document.fail(what, section, _FORM)
    parameters = names.read_variables(fields[":parameters"])
    low, high = _bounds(names, document.group(fields[":bounds"], "'(LOW HIGH)'"))
    actions, offsets = [], []
    for item in document.group(fields[":actions"], "a list of actions").items:
        entry = document.group(item, "'(action POSITION ..)'")
        if entry.head not in arities:
            raise names.unknown("action", entry, arities)
        arity = arities[entry.head]
        positions = tuple(_number(names, part) for part in entry.items[1:])
        if len(positions) != len(parameters) or any(p >= arity for p in positions):
            what = (
                f"expected {len(parameters)} argument positions below {arity} (the agent is "
                "argument 0)"
            )
            remedy = (
                "Each number says which argument of the action a parameter of the constraint is."
            )
            raise document.fail(what, entry, remedy)
        actions.append((entry.head, positions))
        offsets.append(entry.offset)
    return Constraint(name, parameters, low, high, tuple(actions), tuple(offsets))


def _bounds(names: Names, item: Group) -> tuple[int, int | None]:
    if len(item) != 2:
        remedy = "As in (2 inf): at least two robots do it together, or none."
        raise names.document.fail("expected '(LOW HIGH)'", item, remedy)
    low = _number(names, item.items[0])
    high = item.items[1]
    if isinstance(high, Token) and high.text in ("inf", "infinity"):
        return low, None
    most = _number(names, high)
    if most < low or most == 0:
        what = f"no robots can meet the bounds ({low} {most})"
        remedy = "HIGH is at least 1 and at least LOW; inf is no upper bound."
        raise names.document.fail(what, item, remedy)
    return low, most


def _number(names: Names, item: Expression) -> int:
    text = names.document.token(item, "a number").text
    if not re.fullmatch(r"[0-9]+", text):
        what = f"expected a number from 0, found {echoed(text)}"
        remedy = "Arguments of an action are counted from 0, bounds are numbers of robots."
        raise names.document.fail(what, item, remedy)
    digits = text.lstrip("0") or "0"
    return int(digits) if len(digits) <= len(str(_MANY)) else _MANY
