# SPDX-License-Identifier: GPL-3.0-or-later
"""A domain file -> `Domain`, with its concurrency network (Crosby, Jonsson, Rovatsos 2014)."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from graphlib import CycleError, TopologicalSorter
from itertools import chain
from os import PathLike
from typing import NamedTuple

from planners.pddl.formula_tree import step_atoms
from planners.pddl.formulas import read_effects, read_formula
from planners.pddl.lifted import TRUE, Constraint, Domain, Part, Schema, Signatures, Variable
from planners.pddl.names import Names, Sections, is_token, known, read_header, typed_list, unknown
from planners.pddl.sexpr import Expression, Group, Source, Token, first_text, parse, read_source
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


def read_domain(path: str | PathLike[str]) -> Domain:
    """Read a domain file; see `parse_domain`."""
    with reaching(lambda: f"reading {path}", "a shorter file"):
        return parse_domain(read_source(path))


def parse_domain(source: Source) -> Domain:
    """Read a domain: plain PDDL, MA-PDDL (``:agent``, ``:private``) or joint-action PDDL.

    Raises `BadInput` with file, line and column, what was found and what was expected, and
    `Unsupported` for durative actions, numeric fluents, derived predicates and other non-classical
    features.
    """
    return parse_domains([source])[0]


def parse_domains(sources: Sequence[Source]) -> list[Domain]:
    """Read domains as `parse_domain` does; formulas may speak of the actions of all of them."""
    begun = [_begin(source) for source in sources]
    actions = {h.name.text: len(h.parameters) for *_, heads in begun for h in heads}
    return [_finish(actions, *parts) for parts in begun]


def _begin(source: Source) -> tuple[str, Sections, Names, list[_Head]]:
    """A domain's name, its sections, and its actions, without their formulas."""
    root = parse(source)
    name, sections = read_header(root, "domain")
    types = _read_types(root, sections)
    predicates = _without_privacy(_entries(sections, ":predicates"))
    # "- number" may stand behind functions.
    functions = (i for i in _entries(sections, ":functions") if isinstance(i, Group))
    names = Names(types, _read_signatures(predicates, types), in_domain=True)
    constants = names.read_objects(sections.get(":constants", ()), {})
    names = replace(names, functions=_read_signatures(functions, types), objects=constants)
    return name, sections, names, _read_heads(names, root, sections)


def _finish(
    actions: Mapping[str, int], name: str, sections: Sections, names: Names, heads: list[_Head]
) -> Domain:
    """A domain whose formulas may speak of ``actions``, too."""
    own = {head.name.text: len(head.parameters) for head in heads}
    names = replace(names, actions={**actions, **own})
    schemas = tuple(_read_schema(names, head) for head in heads)
    is_joint_action = any(schema.parts for schema in schemas)
    if is_joint_action:
        _check_parts(schemas, heads)
    constraints, dependences = _read_network(names, schemas, sections)
    if constraints and is_joint_action:
        raise sections[":concurrency-constraint"][0].fail(
            "a concurrency network in a joint-action domain",
            "A joint action already says what every robot does.",
        )
    declared = names.types, names.objects, names.predicates, names.functions
    return Domain(name, heads[0].item.source, *declared, schemas, constraints, dependences)


def _read_types(root: Group, sections: Sections) -> dict[str, tuple[str, ...]]:
    """Type -> direct supertypes.  Supertypes need no declaration of their own."""
    types: dict[str, tuple[str, ...]] = {}
    tokens: dict[str, Token] = {}
    entries = (typed_list(section.items[1:], "a type") for section in sections.get(":types", ()))
    for token, above in chain.from_iterable(entries):
        name = token.text
        tokens.setdefault(name, token)
        parents = tuple(p for p in above if p not in ("object", name) and name != "object")
        types[name] = tuple(dict.fromkeys((*types.get(name, ()), *parents)))
        for parent in parents:
            types.setdefault(parent, ())
    types.pop("object", None)
    try:
        TopologicalSorter(types).prepare()
    except CycleError as error:
        cycle = error.args[1][::-1]
        what = f"the types form a cycle: {' - '.join(cycle)}"
        raise tokens.get(cycle[0], root).fail(what, "Remove one of these supertypes.") from None
    return types


def _read_signatures(items: Iterable[Expression], types: Mapping[str, object]) -> Signatures:
    """The types of the arguments of predicates or functions; ``object`` for undeclared ones."""
    signatures: Signatures = {}
    for item in items:
        entry = item.group("a predicate in parentheses")
        if len(entry) == 0:
            raise entry.fail("expected a name, found '()'", "As in (at ?r - robot ?x - place).")
        token = entry.items[0].token("the name of a predicate")
        if (name := token.text) == "=":  # some domains declare it; it stays the equality of objects
            continue
        listed = typed_list(entry.items[1:], "a variable")
        own = [frozenset(t if t in types else "object" for t in given) for _, given in listed]
        _require_told_apart(token, len(own))
        of_name = signatures.setdefault(name, {})
        known = of_name.get(len(own), own)
        of_name[len(own)] = tuple(a | b for a, b in zip(known, own, strict=True))
    return signatures


def _require_told_apart(name: Token, arguments: int) -> None:
    """Raise `BadInput` for ``(and)`` and ``(or)``, which are formulas: always and never true."""
    if not arguments and name.text in ("and", "or"):
        what = f"({name.text}) is a formula, and names nothing else"
        raise name.fail(what, "Give it another name, or arguments.")


def _without_privacy(items: Iterable[Expression]) -> Iterator[Expression]:
    """Predicates, also those in ``(:private ?agent - position (p ..) ..)``, agent or none."""
    for item in items:
        if isinstance(item, Group) and item.head == ":private":
            yield from _without_privacy(part for part in item.items[1:] if isinstance(part, Group))
        else:
            yield item


def _entries(sections: Sections, head: str) -> Iterator[Expression]:
    return (item for section in sections.get(head, ()) for item in section.items[1:])


def _fields(
    item: Group, keys: Collection[str], form: str
) -> tuple[Token, dict[str, tuple[Expression, ...]]]:
    """The name of a section, and one expression behind each keyword (several for ``:agent``)."""
    what = f"the name of the {item.head[1:]}"
    if len(item) < 2:
        raise item.fail(f"expected {what}", form)
    name = item.items[1].token(what)
    fields: dict[str, tuple[Expression, ...]] = {}
    key = ""
    for part in item.items[2:]:
        if isinstance(part, Token) and part.text.startswith(":"):
            key = part.text
            if key not in keys:
                what = f"unknown keyword {echoed(key)} in '({item.head} ..)'"
                raise part.fail(what, f"Known here: {', '.join(keys)}.")
            if key in fields:
                remedy = "Join the two by (and ..), or remove one."
                raise part.fail(f"{key} occurs twice in one {item.head[1:]}", remedy)
            fields[key] = ()
        elif not key:
            raise part.fail("expected a keyword such as ':parameters'", form)
        else:
            fields[key] = (*fields[key], part)
            if len(fields[key]) > 1 and key != ":agent":
                remedy = "Join several conditions or effects by (and ..)."
                raise part.fail(f"expected one expression after {key}", remedy)
    return name, fields


class _Head(NamedTuple):
    """An action as far as formulas of others need it: what a literal about it has to look like."""

    item: Group
    name: Token
    fields: dict[str, tuple[Expression, ...]]
    parameters: tuple[Variable, ...]
    agent: int | None


def _read_heads(names: Names, root: Group, sections: Sections) -> list[_Head]:
    heads = [_read_head(names, item) for item in sections.get(":action", ())]
    if not heads:
        remedy = "Write at least one '(:action NAME :parameters (..) :precondition .. :effect ..)'."
        raise root.fail("this domain has no action", remedy)
    by_name: dict[str, _Head] = {}
    for head in heads:
        _require_told_apart(head.name, len(head.parameters))
        if by_name.setdefault(head.name.text, head) is not head:
            what = f"action {echoed(head.name.text)} is declared twice"
            raise head.name.fail(what, "Rename or remove one of them.")
    return heads


def _read_head(names: Names, item: Group) -> _Head:
    name, fields = _fields(item, _FIELDS, _FORM)
    lists, clause = _parameter_lists(fields)
    parameters = names.variables_of(*lists)
    if clause is None:
        return _Head(item, name, fields, parameters, None)
    first = first_text(clause)
    agent = next((i for i, v in enumerate(parameters) if v.name == first), None)
    if agent is None:
        found = f", found {echoed(first)}" if first else ""
        raise item.fail(f"expected a variable after ':agent'{found}", _AGENT_FORM)
    if clause not in lists:
        (own,) = names.variables_of(clause)
        parameters = tuple(_one(clause[0], own, p) if p.name == first else p for p in parameters)
    return _Head(item, name, fields, parameters, agent)


def _one(place: Expression, own: Variable, listed: Variable) -> Variable:
    """The agent of an ``:agent`` clause that is listed among the parameters, too."""
    given = [v.types for v in (own, listed) if v.types != ("object",)]
    if len({frozenset(types) for types in given}) > 1:
        here, there = (" or ".join(types) for types in given)
        what = f"{own.name} is of type {here} behind :agent, but {there} among the :parameters"
        raise place.fail(what, f"Write ({own.name} - {here} ..) there.")
    return Variable(own.name, given[0]) if given else own


_Items = tuple[Expression, ...]


def _parameter_lists(fields: Mapping[str, _Items]) -> tuple[list[_Items], _Items | None]:
    """The typed lists of the parameters, and the one that begins with the agent (None: no agent).

    The agent comes first, unless it stands among the parameters.
    """
    listed: _Items = ()
    if fields.get(":parameters"):
        listed = fields[":parameters"][0].group("a list of parameters").items
    for at, item in enumerate(listed):
        if is_token(item, ":agent"):
            if ":agent" in fields:
                what = "':agent' stands among the :parameters and outside of them"
                raise item.fail(what, f"Name the agent once. {_AGENT_FORM}")
            return [listed[:at], listed[at + 1 :]], listed[at + 1 :]
    clause = _agent_clause(fields)
    if clause is None:
        return [listed], None
    is_listed = len(clause) in (1, 3) and any(is_token(i, first_text(clause)) for i in listed)
    return [listed] if is_listed else [clause, listed], clause


def _agent_clause(fields: Mapping[str, _Items]) -> _Items | None:
    """What stands behind the keyword ``:agent``, perhaps in parentheses; None without it."""
    if ":agent" not in fields:
        return None
    clause = fields[":agent"]
    if len(clause) == 1 and isinstance(clause[0], Group):
        clause = clause[0].items
    if len(clause) > 1 and not is_token(clause[1], "-"):
        raise clause[1].fail("expected '- TYPE' or nothing after the agent's variable", _AGENT_FORM)
    return clause


def _read_schema(names: Names, head: _Head) -> Schema:
    inner, fields = names.with_variables(head.parameters), head.fields
    conditions, effect = fields.get(":precondition"), fields.get(":effect")
    precondition = read_formula(inner, conditions[0]) if conditions else TRUE
    effects, cost = read_effects(inner, effect[0]) if effect else ((), None)
    parts: dict[str, Part] = {}
    for comment in head.item.comments:
        part = _read_part(inner, comment)
        if parts.setdefault(part.robot, part) is not part:
            what = f"robot {echoed(part.robot)} has two subactions in one action"
            raise comment.fail(what, "Remove one of the two comments.")
    return Schema(
        head.name.text,
        head.parameters,
        head.agent,
        precondition,
        effects,
        tuple(parts.values()),
        cost,
        head.item.position,
    )


def _read_part(names: Names, comment: Token) -> Part:
    """A ``; subaction ROBOT (name args)`` comment inside an action."""
    require_seen(comment.text, comment.position, "comment")
    found = _PART.match(comment.text)
    if not found:
        remedy = "Expected '; subaction ROBOT (name args)' or '; subaction ROBOT idle'."
        raise comment.fail("this subaction comment cannot be read", remedy)
    if found["subaction"] is None:
        return Part(found["robot"], None)
    template = tuple(found["subaction"].split())
    for term in template[1:]:
        names.term(replace(comment, text=term))
    return Part(found["robot"], template)


def _check_parts(schemas: Sequence[Schema], heads: Sequence[_Head]) -> None:
    """Raise `BadInput` for a domain that says what robots do in comments and in other ways.

    Such as comments outside of actions: they would be silently ignored.
    """
    read = {comment.offset for head in heads for comment in head.item.comments}
    for comment in heads[0].item.source.subaction_comments():
        if comment.offset not in read:
            remedy = (
                "Write '; subaction ROBOT ..' inside of the action, or begin with another word."
            )
            raise comment.fail("this subaction comment is not read", remedy)
    for schema, head in zip(schemas, heads, strict=True):
        what = f"action {echoed(schema.name)}"
        if not schema.parts:
            what += " has no '; subaction' comment, but others in this domain have"
            remedy = "In joint-action PDDL every action says what each robot does in it."
            raise head.item.fail(what, remedy)
        if schema.agent is not None:
            what += " has both ':agent' and subaction comments"
            remedy = "Remove ':agent', or the comments: a joint action says what every robot does."
            raise head.item.fail(what, remedy)
        for atom in step_atoms(schema):
            raise head.item.fail(
                f"action {echoed(atom.action)} is used as a formula in a joint-action domain",
                "A joint action already says what every robot does: use predicates only.",
            )


#: What a constraint looks like.
_NETWORK_FORM = (
    "As in (:concurrency-constraint v :parameters (?b - boat) :bounds (2 inf) :actions ((row 1)))."
)
_NETWORK_FIELDS = (":parameters", ":bounds", ":actions")
_FROM_0 = "Arguments are counted from 0; if the action has an :agent, it is argument 0."


def _read_network(
    names: Names, schemas: Sequence[Schema], sections: Sections
) -> tuple[tuple[Constraint, ...], tuple[tuple[str, str], ...]]:
    """The ``:concurrency-constraint`` and ``:positive-dependence`` sections of a domain.

    Raises `BadInput` for unknown actions, positions outside the arguments, impossible bounds,
    unknown constraints, and two of one name.
    """
    by_action = {schema.name: schema for schema in schemas}
    by_name: dict[str, Constraint] = {}
    for section in sections.get(":concurrency-constraint", ()):
        constraint = _constraint(names, by_action, section)
        if by_name.setdefault(constraint.name, constraint) is not constraint:
            what = f"constraint {echoed(constraint.name)} is declared twice"
            raise section.fail(what, "Rename or remove one of them, or list all :actions in one.")
    dependences = (_dependence(by_name, s) for s in sections.get(":positive-dependence", ()))
    return tuple(by_name.values()), tuple(dependences)


def _dependence(by_name: Mapping[str, Constraint], section: Group) -> tuple[str, str]:
    pair = [item.token("the name of a constraint") for item in section.items[1:]]
    if len(pair) != 2:
        remedy = "V and W are constraints: whoever matches W needs somebody who matches V."
        raise section.fail("expected '(:positive-dependence V W)'", remedy)
    for item in pair:
        if item.text not in by_name:
            remedy = known(by_name, item.text, "constraint")
            raise item.fail(f"unknown constraint {echoed(item.text)}", remedy)
    first, second = (by_name[item.text] for item in pair)
    if len(first.parameters) != len(second.parameters):
        remedy = "They are bound to the same objects: give both as many :parameters."
        raise section.fail("the two constraints have different numbers of parameters", remedy)
    return first.name, second.name


def _constraint(names: Names, schemas: Mapping[str, Schema], section: Group) -> Constraint:
    name, fields = _fields(section, _NETWORK_FIELDS, _NETWORK_FORM)
    if missing := sorted(key for key in _NETWORK_FIELDS if not fields.get(key)):
        what = f"a constraint has {', '.join(_NETWORK_FIELDS)}; missing: {', '.join(missing)}"
        raise section.fail(what, _NETWORK_FORM)
    listed, bounds, actions = (fields[key][0] for key in _NETWORK_FIELDS)
    parameters = names.read_variables(listed)
    low, high = _bounds(bounds.group("'(LOW HIGH)'"))
    constraint = Constraint(name.text, parameters, low, high, ())
    bound = []
    for item in actions.group("a list of actions").items:
        entry = item.group("'(action POSITION ..)'")
        if entry.head not in schemas:
            raise unknown("action", entry, schemas)
        bound.append((entry.head, _positions(names, constraint, schemas[entry.head], entry)))
    return replace(constraint, actions=tuple(bound))


def _positions(
    names: Names, constraint: Constraint, schema: Schema, entry: Group
) -> tuple[int, ...]:
    """Which argument of an action each parameter of a constraint is."""
    parameters, own = constraint.parameters, schema.parameters
    positions = tuple(map(_number, entry.items[1:]))
    if len(positions) != len(parameters) or any(p >= len(own) for p in positions):
        raise entry.fail(
            f"expected {len(parameters)} argument positions below {len(own)}",
            f"Each says which argument a parameter of the constraint is. {_FROM_0}",
        )
    for parameter, position in zip(parameters, positions, strict=True):
        if not names.have_common(parameter.types, own[position].types):
            here, there = (
                f"{one.name} - {' or '.join(one.types)}" for one in (own[position], parameter)
            )
            what = f"argument {position} of {entry.head} is {here}, which is never {there}"
            what += f": the constraint {echoed(constraint.name)} would never match"
            raise entry.fail(what, _FROM_0)
    return positions


def _bounds(item: Group) -> tuple[int, int | None]:
    if len(item) != 2:
        remedy = "As in (2 inf): at least two robots do it together, or none."
        raise item.fail("expected '(LOW HIGH)'", remedy)
    low = _number(item.items[0])
    if is_token(item.items[1], "inf", "infinity"):
        return low, None
    most = _number(item.items[1])
    if most < low or most == 0:
        remedy = "HIGH is at least 1 and at least LOW; inf is no upper bound."
        raise item.fail(f"no robots can meet the bounds ({low} {most})", remedy)
    return low, most


def _number(item: Expression) -> int:
    text = item.token("a number").text
    if not re.fullmatch(r"[0-9]+", text):
        remedy = f"Bounds are numbers of robots. {_FROM_0}"
        raise item.fail(f"expected a number from 0, found {echoed(text)}", remedy)
    return int(min(float(text), 1e9))  # larger ones mean the same: there are fewer robots
