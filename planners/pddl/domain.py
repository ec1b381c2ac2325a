# SPDX-License-Identifier: GPL-3.0-or-later
"""A domain file -> `Domain`, with its concurrency network (Crosby, Jonsson, Rovatsos 2014)."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

from planners.pddl.formulas import read_effects, read_formula
from planners.pddl.lifted import (
    TRUE,
    Constraint,
    Domain,
    Formula,
    Part,
    Schema,
    Signatures,
    have_common,
)
from planners.pddl.names import (
    Names,
    Sections,
    is_token,
    known,
    read_header,
    read_objects,
    typed_list,
)
from planners.pddl.sexpr import (
    SUBACTION,
    Document,
    Expression,
    Group,
    Source,
    Token,
    parse,
    read_source,
)
from planners.system.files import require_seen
from planners.system.limits import reaching
from planners.system.messages import echoed

#: What an action looks like.
_FORM = "As in (:action move :parameters (?r - robot ?to - place) :precondition .. :effect ..)."
_AGENT_FORM = "As in (:action move :agent ?r - robot :parameters (?to - place) ..)."
_PART = re.compile(
    r"subaction\b\s*(?P<robot>[^\s()]+)(?:\s+idle|\s*\(\s*(?P<subaction>[^()]+?)\s*\))\s*$"
)


_FIELDS = (":agent", ":parameters", ":precondition", ":effect")


def read_domain(path: str | Path) -> Domain:
    """Read a domain file; see `parse_domain`."""
    with reaching(lambda: f"reading {path}", "a shorter file"):
        return parse_domain(read_source(path))


def parse_domain(source: Source) -> Domain:
    """Read a domain: plain PDDL, MA-PDDL (``:agent``, ``:private``) or joint-action PDDL.

    Raises
    ------
    BadInput
        With file, line and column, what was found and what was expected.
    Unsupported
        For durative actions, numeric fluents, derived predicates and other non-classical features.
    """
    document = parse(source)
    name, sections = read_header(document, "domain")
    types = _read_types(document, sections)
    predicates = _without_privacy(_entries(sections, ":predicates"))
    signatures = _read_signatures(document, predicates, types)
    # "- number" may stand behind functions.
    functions = [i for i in _entries(sections, ":functions") if isinstance(i, Group)]
    names = Names(document, types, _arities(signatures), signatures)
    constants: dict[str, tuple[str, ...]] = {}
    for section in sections.get(":constants", ()):
        read_objects(names, section.items[1:], constants)
    actions = _read_actions(document, sections)
    if not actions:
        raise document.fail(
            "this domain has no action",
            document.root,
            remedy="Write at least one '(:action NAME :parameters (..) :precondition "
            ".. :effect ..)'.",
        )
    names = replace(
        names,
        functions=_arities(_read_signatures(document, functions, types)),
        actions={name: arity_of(names, item) for name, item in actions.items()},
        objects=constants,
    )
    schemas = tuple(read_schema(names, item) for item in actions.values())
    check_parts(document, schemas, actions)
    constraints, dependences = read_network(names, schemas, sections)
    if constraints and any(schema.parts for schema in schemas):
        raise document.fail(
            "a concurrency network in a joint-action domain",
            sections[":concurrency-constraint"][0],
            "A joint action already says what every robot does.",
        )
    return Domain(
        name,
        source,
        types,
        constants,
        dict(names.predicates),
        dict(names.functions),
        schemas,
        constraints,
        dependences,
        signatures,
    )


def _read_types(document: Document, sections: Sections) -> dict[str, tuple[str, ...]]:
    """Type -> direct supertypes.  Supertypes need no declaration of their own."""
    types: dict[str, tuple[str, ...]] = {}
    offsets: dict[str, Token] = {}
    for section in sections.get(":types", ()):
        for token, above in typed_list(document, section.items[1:], "a type"):
            name = token.text
            offsets.setdefault(name, token)
            parents = tuple(p for p in above if p not in ("object", name) and name != "object")
            types[name] = tuple(dict.fromkeys((*types.get(name, ()), *parents)))
            for parent in parents:
                types.setdefault(parent, ())
    types.pop("object", None)
    try:
        TopologicalSorter(types).prepare()
    except CycleError as error:
        cycle = error.args[1][::-1]
        raise document.fail(
            "the types form a cycle: " + " - ".join(cycle),
            offsets.get(cycle[0], document.root),
            "Remove one of these supertypes.",
        ) from None
    return types


def _read_signatures(
    document: Document, items: Iterable[Expression], types: Mapping[str, object]
) -> Signatures:
    """The types of the arguments of predicates or functions; ``object`` for undeclared ones."""
    signatures: Signatures = {}
    for item in items:
        entry = document.group(item, "a predicate in parentheses")
        if len(entry) == 0:
            remedy = "As in (at ?r - robot ?x - place)."
            raise document.fail("expected a name, found '()'", entry, remedy)
        name = document.token(entry.items[0], "the name of a predicate").text
        if name == "=":  # some domains declare it; it stays the equality of objects
            continue
        listed = typed_list(document, entry.items[1:], "a variable")
        own = [frozenset(t if t in types else "object" for t in given) for _, given in listed]
        known = signatures.get((name, len(own)), own)
        signatures[name, len(own)] = tuple(a | b for a, b in zip(known, own, strict=True))
    return signatures


def _without_privacy(items: Iterable[Expression]) -> Iterator[Expression]:
    """Predicates, also those in ``(:private ?agent - position (p ..) ..)``, agent or none."""
    for item in items:
        if isinstance(item, Group) and item.head == ":private":
            yield from _without_privacy(part for part in item.items[1:] if isinstance(part, Group))
        else:
            yield item


def _entries(sections: Sections, head: str) -> Iterator[Expression]:
    return (item for section in sections.get(head, ()) for item in section.items[1:])


def _arities(found: Iterable[tuple[str, int]]) -> dict[str, frozenset[int]]:
    """Names with all their numbers of arguments."""
    arities: dict[str, frozenset[int]] = {}
    for name, arity in found:
        arities[name] = arities.get(name, frozenset()) | {arity}
    return arities


def _read_actions(document: Document, sections: Sections) -> dict[str, Group]:
    """The sections of the actions by their names."""
    actions: dict[str, Group] = {}
    for item in sections.get(":action", ()):
        name = section_name(document, item)
        if actions.setdefault(name.text, item) is not item:
            what = f"action {echoed(name.text)} is declared twice"
            raise document.fail(what, name, "Rename or remove one of them.")
    return actions


def section_name(document: Document, item: Group, form: str = _FORM) -> Token:
    """The name behind a section's keyword; raises `BadInput` if there is none."""
    what = f"the name of the {item.head[1:]}"
    if len(item) < 2:
        raise document.fail(f"expected {what}", item, form)
    return document.token(item.items[1], what)


def _fields(
    document: Document, item: Group, keys: Collection[str], form: str
) -> dict[str, tuple[Expression, ...]]:
    """What stands behind each keyword of a section with a name, in any order.

    One expression each, but for ``:agent``.
    """
    fields: dict[str, tuple[Expression, ...]] = {}
    key = ""
    for part in item.items[2:]:
        if isinstance(part, Token) and part.text.startswith(":"):
            key = part.text
            if key not in keys:
                what = f"unknown keyword {echoed(key)} in '({item.head} ..)'"
                raise document.fail(what, part, f"Known here: {', '.join(keys)}.")
            if key in fields:
                remedy = "Join the two by (and ..), or remove one."
                raise document.fail(f"{key} occurs twice in one {item.head[1:]}", part, remedy)
            fields[key] = ()
        elif not key:
            raise document.fail("expected a keyword such as ':parameters'", part, form)
        else:
            fields[key] = (*fields[key], part)
            if len(fields[key]) > 1 and key != ":agent":
                remedy = "Join several conditions or effects by (and ..)."
                raise document.fail(f"expected one expression after {key}", part, remedy)
    return fields


def _parameter_items(
    document: Document, fields: dict[str, tuple[Expression, ...]]
) -> tuple[tuple[Expression, ...], str | None]:
    """The full typed list of parameters, and the agent's name ("" if it has none).

    The agent comes first unless it stands among the parameters.
    """
    listed: tuple[Expression, ...] = ()
    if fields.get(":parameters"):
        listed = document.group(fields[":parameters"][0], "a list of parameters").items
    inside = next((n for n, item in enumerate(listed) if is_token(item, ":agent")), None)
    if inside is not None:
        before, behind = listed[:inside], listed[inside + 1 :]
        return before + behind, _first_name(behind)
    if ":agent" not in fields:
        return listed, None
    clause = fields[":agent"]
    if len(clause) == 1 and isinstance(clause[0], Group):  # ":agent (?a - robot)"
        clause = clause[0].items
    name = _first_name(clause)
    if any(is_token(item, name) for item in listed):
        return listed, name
    if len(clause) == 1:  # an untyped agent must not take the type of the parameters behind it
        at = clause[0].offset
        clause = (*clause, Token("-", at), Token("object", at))
    if clause and not is_token(clause[1], "-"):
        what = "expected '- TYPE' or nothing after the agent's variable"
        raise document.fail(what, clause[1], _AGENT_FORM)
    return clause + listed, name


def _first_name(items: Sequence[Expression]) -> str:
    return items[0].text if items and isinstance(items[0], Token) else ""


def arity_of(names: Names, item: Group) -> int:
    """The number of arguments of an action, with the agent."""
    items, _ = _parameter_items(names.document, _fields(names.document, item, _FIELDS, _FORM))
    return len(typed_list(names.document, items, "a variable"))


def read_schema(names: Names, item: Group) -> Schema:
    """Read an action section; raises `BadInput` or `Unsupported` with the position."""
    document = names.document
    name = section_name(document, item)
    fields = _fields(document, item, _FIELDS, _FORM)
    items, agent_name = _parameter_items(document, fields)
    parameters = names.variables_of(items)
    agent = next((i for i, v in enumerate(parameters) if v.name == agent_name), None)
    if agent_name is not None and agent is None:
        found = f", found {echoed(agent_name)}" if agent_name else ""
        raise document.fail(f"expected a variable after ':agent'{found}", item, _AGENT_FORM)
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
        document.source.position(item.offset),
    )


def _read_parts(names: Names, item: Group) -> tuple[Part, ...]:
    """The ``; subaction ROBOT (name args)`` comments inside an action."""
    parts: dict[str, Part] = {}
    for comment in names.document.comments:
        if item.offset < comment.offset < item.end and comment.text.split()[:1] == [SUBACTION]:
            part = _read_part(names, comment)
            if parts.setdefault(part.robot, part) is not part:
                what = f"robot {echoed(part.robot)} has two subactions in one action"
                raise names.document.fail(what, comment, "Remove one of the two comments.")
    return tuple(parts.values())


def _read_part(names: Names, comment: Token) -> Part:
    require_seen(comment.text, names.document.source.position(comment.offset), "comment")
    found = _PART.match(comment.text)
    if not found:
        what = "this subaction comment cannot be read"
        remedy = "Expected '; subaction ROBOT (name args)' or '; subaction ROBOT idle'."
        raise names.document.fail(what, comment, remedy)
    if found["subaction"] is None:
        return Part(found["robot"], None)
    template = tuple(found["subaction"].split())
    for term in template[1:]:
        names.term(Token(term, comment.offset))
    return Part(found["robot"], template)


def check_parts(document: Document, schemas: tuple[Schema, ...], actions: dict[str, Group]) -> None:
    """Raise `BadInput` where some schemas have subaction comments and others have none."""
    for schema in schemas if any(schema.parts for schema in schemas) else ():
        what = f"action {echoed(schema.name)}"
        if not schema.parts:
            what += " has no '; subaction' comment, but others in this domain have"
            remedy = "In joint-action PDDL every action says what each robot does in it."
            raise document.fail(what, actions[schema.name], remedy)
        if schema.agent is not None:
            what += " has both ':agent' and subaction comments"
            remedy = "Remove ':agent', or the comments: a joint action says what every robot does."
            raise document.fail(what, actions[schema.name], remedy)


#: What a constraint looks like.
_NETWORK_FORM = (
    "As in (:concurrency-constraint v :parameters (?b - boat) :bounds (2 inf) :actions ((row 1)))."
)
_NETWORK_FIELDS = (":parameters", ":bounds", ":actions")
_FROM_0 = "Arguments are counted from 0; if the action has an :agent, it is argument 0."


def read_network(
    names: Names, schemas: Sequence[Schema], sections: dict[str, list[Group]]
) -> tuple[tuple[Constraint, ...], tuple[tuple[str, str], ...]]:
    """The ``:concurrency-constraint`` and ``:positive-dependence`` sections of a domain.

    Raises `BadInput` for unknown actions, positions outside the arguments, impossible bounds,
    unknown constraints.
    """
    document = names.document
    by_action = {schema.name: schema for schema in schemas}
    constraints = [
        _constraint(names, by_action, s) for s in sections.get(":concurrency-constraint", ())
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


def _constraint(names: Names, schemas: Mapping[str, Schema], section: Group) -> Constraint:
    document = names.document
    name = section_name(document, section, _NETWORK_FORM).text
    fields = _fields(document, section, _NETWORK_FIELDS, _NETWORK_FORM)
    if missing := sorted(key for key in _NETWORK_FIELDS if not fields.get(key)):
        what = f"a constraint has {', '.join(_NETWORK_FIELDS)}; missing: {', '.join(missing)}"
        raise document.fail(what, section, _NETWORK_FORM)
    listed, bounds, actions = (fields[key][0] for key in _NETWORK_FIELDS)
    parameters = names.read_variables(listed)
    low, high = _bounds(names, document.group(bounds, "'(LOW HIGH)'"))
    bound = []
    for item in document.group(actions, "a list of actions"):
        entry = document.group(item, "'(action POSITION ..)'")
        if entry.head not in schemas:
            raise names.unknown("action", entry, schemas)
        own = schemas[entry.head].parameters
        positions = tuple(_number(names, part) for part in entry.items[1:])
        if len(positions) != len(parameters) or any(p >= len(own) for p in positions):
            raise document.fail(
                f"expected {len(parameters)} argument positions below {len(own)}",
                entry,
                f"Each says which argument a parameter of the constraint is. {_FROM_0}",
            )
        for parameter, position in zip(parameters, positions, strict=True):
            if not have_common(names.types, parameter.types, own[position].types):
                here, there = (
                    f"{one.name} - {' or '.join(one.types)}" for one in (own[position], parameter)
                )
                what = f"argument {position} of {entry.head} is {here}, which is never {there}"
                what += f": the constraint {echoed(name)} would never match"
                raise document.fail(what, entry, _FROM_0)
        bound.append((entry.head, positions))
    return Constraint(name, parameters, low, high, tuple(bound))


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
        raise names.document.fail(what, item, f"Bounds are numbers of robots. {_FROM_0}")
    return int(min(float(text), 1e9))  # larger ones mean the same: there are fewer robots
