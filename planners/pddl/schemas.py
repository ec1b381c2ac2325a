# SPDX-License-Identifier: GPL-3.0-or-later
"""An ``(:action ..)`` section -> `Schema`: plain PDDL, MA-PDDL and joint-action PDDL."""

from __future__ import annotations

import re

from planners.pddl.formulas import read_effects, read_formula
from planners.pddl.lifted import TRUE, Formula, Part, Schema
from planners.pddl.names import Names, group, is_token, token, typed_list
from planners.pddl.sexpr import SUBACTION, Document, Expression, Group, Token
from planners.system.files import require_seen
from planners.system.messages import echoed

#: What an action looks like.
_FORM = "As in (:action move :parameters (?r - robot ?to - place) :precondition .. :effect ..)."
_AGENT_FORM = "As in (:action move :agent ?r - robot :parameters (?to - place) ..)."
_PART = re.compile(
    r"subaction\b\s*(?P<robot>[^\s()]+)(?:\s+idle|\s*\(\s*(?P<subaction>[^()]+?)\s*\))\s*$"
)


def action_name(document: Document, item: Group) -> Token:
    """The name of an action section; raises `BadInput` if it has none."""
    if len(item) < 2:
        raise document.fail("expected the name of the action", item, remedy=_FORM)
    return token(document, item.items[1], "the name of the action")


_FIELDS = (":agent", ":parameters", ":precondition", ":effect")


def _fields(document: Document, item: Group) -> dict[str, tuple[Expression, ...]]:
    """The parts of an action by keyword, in any order."""
    fields: dict[str, tuple[Expression, ...]] = {}
    key = ""
    for part in item.items[2:]:
        if isinstance(part, Token) and part.text.startswith(":"):
            key = part.text
            if key not in _FIELDS:
                raise document.fail(
                    f"unknown keyword {echoed(key)} in an action",
                    part,
                    "Known here: " + ", ".join(_FIELDS) + ".",
                )
            if key in fields:
                raise document.fail(
                    f"{key} occurs twice in one action",
                    part,
                    remedy="Join the two by (and ..), or remove one.",
                )
            fields[key] = ()
        elif not key:
            raise document.fail("expected a keyword such as ':parameters'", part, remedy=_FORM)
        else:
            fields[key] = (*fields[key], part)
    for key in (":parameters", ":precondition", ":effect"):
        if len(fields.get(key, ())) > 1:
            raise document.fail(
                f"expected one expression after {key}, found {len(fields[key])}",
                fields[key][1],
                remedy="Join several conditions or effects by (and ..).",
            )
    return fields


def _parameter_items(
    document: Document, fields: dict[str, tuple[Expression, ...]]
) -> tuple[tuple[Expression, ...], str | None]:
    """The full typed list of parameters, and the agent's name.

    The agent comes first unless it stands among the parameters.
    """
    listed: tuple[Expression, ...] = ()
    if fields.get(":parameters"):
        listed = group(document, fields[":parameters"][0], "a list of parameters").items
    for number, item in enumerate(listed):
        if is_token(item, ":agent"):
            before, behind = listed[:number], listed[number + 1 :]
            if not behind or not isinstance(behind[0], Token):
                raise document.fail("expected a variable after ':agent'", item, remedy=_AGENT_FORM)
            return before + behind, behind[0].text
    if ":agent" not in fields:
        return listed, None
    variable, declaration = _agent(document, fields[":agent"])
    if any(is_token(item, variable.text) for item in listed):
        return listed, variable.text
    if not declaration:  # an untyped agent must not take the type of the parameters behind it
        at = variable.offset
        declaration = (Token("-", at), Token("object", at))
    if not is_token(declaration[0], "-"):
        raise document.fail(
            "expected '- TYPE' or nothing after the agent's variable",
            declaration[0],
            remedy=_AGENT_FORM,
        )
    return (variable, *declaration, *listed), variable.text


def _agent(
    document: Document, items: tuple[Expression, ...]
) -> tuple[Token, tuple[Expression, ...]]:
    """What stands behind ``:agent``: a variable, and what declares its type."""
    if len(items) == 1 and isinstance(items[0], Group):  # ":agent (?a - robot)"
        items = items[0].items
    if not items or not isinstance(items[0], Token):
        raise document.fail("expected a variable after ':agent'", document.root, remedy=_AGENT_FORM)
    return items[0], items[1:]


def arity_of(names: Names, item: Group) -> int:
    """The number of arguments of an action, with the agent."""
    items, _ = _parameter_items(names.document, _fields(names.document, item))
    return len(typed_list(names.document, items, "a variable"))


def read_schema(names: Names, item: Group) -> Schema:
    """Read an action section; raises `BadInput` or `Unsupported` with the position."""
    document = names.document
    name = action_name(document, item)
    fields = _fields(document, item)
    items, agent_name = _parameter_items(document, fields)
    parameters = names.read_variables(items)
    agent = next((i for i, v in enumerate(parameters) if v.name == agent_name), None)
    if agent_name is not None and agent is None:
        raise document.fail(
            f"expected a variable after ':agent', found {echoed(agent_name)}",
            item,
            remedy=_AGENT_FORM,
        )
    inner = names.with_variables(parameters)
    precondition: Formula = TRUE
    if fields.get(":precondition"):
        precondition = read_formula(inner, fields[":precondition"][0])
    effects, cost = (
        read_effects(inner, fields[":effect"][0]) if fields.get(":effect") else ((), None)
    )
    return Schema(
        name.text,
        parameters,
        agent,
        precondition,
        effects,
        _read_parts(inner, item),
        cost,
        item.offset,
    )


def _read_parts(names: Names, item: Group) -> tuple[Part, ...]:
    """The ``; subaction ROBOT (name args)`` comments inside an action."""
    parts: dict[str, Part] = {}
    for comment in names.document.comments:
        if item.offset < comment.offset < item.end and comment.text.split()[:1] == [SUBACTION]:
            part = _read_part(names, comment)
            if part.robot in parts:
                raise names.document.fail(
                    f"robot {echoed(part.robot)} has two subactions in one action",
                    comment,
                    remedy="Remove one of the two comments.",
                )
            parts[part.robot] = part
    return tuple(parts.values())


def _read_part(names: Names, comment: Token) -> Part:
    require_seen(comment.text, names.document.source.position(comment.offset), "comment")
    found = _PART.match(comment.text)
    if not found:
        raise names.document.fail(
            "this subaction comment cannot be read",
            comment,
            "Expected '; subaction ROBOT (name args)' or '; subaction ROBOT idle'.",
        )
    if found["subaction"] is None:
        return Part(found["robot"], None)
    template = tuple(found["subaction"].split())
    for term in template[1:]:
        names.term(Token(term, comment.offset))
    return Part(found["robot"], template)


def check_parts(document: Document, schemas: tuple[Schema, ...], actions: dict[str, Group]) -> None:
    """Raise `BadInput` where some schemas have subaction comments and others have none."""
    if not any(schema.parts for schema in schemas):
        return
    for schema in schemas:
        item = actions[schema.name]
        if not schema.parts:
            raise document.fail(
                f"action {echoed(schema.name)} has no '; subaction' comment, but others in this "
                "domain have",
                item,
                "In joint-action PDDL every action says what each robot does in it.",
            )
        if schema.agent is not None:
            raise document.fail(
                f"action {echoed(schema.name)} has both ':agent' and subaction comments",
                item,
                remedy="Remove ':agent', or the comments: a joint action says "
                "what every robot does.",
            )
