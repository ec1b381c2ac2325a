"""A domain file -> `Domain`."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from planners.errors import Unsupported
from planners.limits import reaching
from planners.pddl.formulas import read_effects, read_formula
from planners.pddl.lifted import TRUE, Domain, Formula, Part, Schema
from planners.pddl.names import Names, group, typed_list, word
from planners.pddl.network import read_network
from planners.pddl.sexpr import Document, Expression, Group, Source, Word, parse, read_source

_PART = re.compile(r"subaction\b\s*(?P<robot>[^\s()]*)\s*(?P<what>.*)$")
_UNSUPPORTED = {
    ":durative-action": "durative actions",
    ":derived": "derived predicates (axioms)",
    ":constraints": "trajectory constraints",
    ":process": "processes (PDDL+)",
    ":event": "events (PDDL+)",
}


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
    names = Names(document, frozenset(types), _read_predicates(document, sections))
    constants: dict[str, tuple[str, ...]] = {}
    for section in _all(sections, ":constants"):
        read_objects(names, section.items[1:], constants)
    actions = {_action_name(document, item).text: item for item in _all(sections, ":action")}
    if len(actions) < len(_all(sections, ":action")):
        _complain_about_double_action(document, sections)
    if not actions:
        raise document.fail("this domain has no action", document.root)
    names = Names(
        document,
        names.types,
        names.predicates,
        _read_functions(document, sections),
        {name: _arity(names, item) for name, item in actions.items()},
        frozenset(constants),
    )
    schemas = tuple(_read_schema(names, item) for item in actions.values())
    _check_parts(document, schemas, actions)
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
        names.predicates,
        names.functions,
        schemas,
        constraints,
        dependences,
    )


def read_header(document: Document, kind: str) -> tuple[str, dict[str, list[Group]]]:
    """The name in ``(define (kind name) ..)`` and the sections behind it, by keyword.

    Raises `Unsupported` for a section that coordlang cannot read and `BadInput` for one that PDDL
    does not have.
    """
    root = document.root
    if root.head != "define":
        raise document.fail(f"expected '(define ({kind} ..) ..)'", root)
    title = root.items[1] if len(root) > 1 else root
    if not isinstance(title, Group) or title.head != kind or len(title) != 2:
        other = title.head if isinstance(title, Group) else ""
        raise document.fail(
            f"expected '({kind} NAME)' after 'define'",
            title,
            f"This is a {other} file: the order is DOMAIN PROBLEM."
            if {kind, other} == {"domain", "problem"}
            else None,
        )
    sections: dict[str, list[Group]] = {}
    for item in root.items[2:]:
        section = group(document, item, "a section such as '(:action ..)'")
        head = section.head
        if head in _UNSUPPORTED:
            raise Unsupported(
                f"{_UNSUPPORTED[head]} ({head}) are not supported",
                position=document.source.position(section.offset),
                remedy="coordlang reads classical PDDL with instantaneous actions.",
            )
        if head not in _SECTIONS[kind]:
            raise document.fail(
                f"unknown section {head!r} in a {kind}",
                section,
                "Known here: " + ", ".join(sorted(_SECTIONS[kind])) + ".",
            )
        sections.setdefault(head, []).append(section)
    return word(document, title.items[1], f"the name of the {kind}").text, sections


_SECTIONS = {
    "domain": {
        ":requirements",
        ":types",
        ":constants",
        ":predicates",
        ":functions",
        ":action",
        ":concurrency-constraint",
        ":positive-dependence",
    },
    "problem": {
        ":domain",
        ":requirements",
        ":objects",
        ":init",
        ":goal",
        ":metric",
        ":length",
    },
}


def read_objects(
    names: Names, items: Sequence[Expression], into: dict[str, tuple[str, ...]]
) -> None:
    """Add a typed list of objects, with ``(:private ..)`` groups, to ``into`` (name -> types)."""
    document = names.document
    plain = [item for item in items if isinstance(item, Word)]
    private = [item for item in items if isinstance(item, Group) and item.head == ":private"]
    either = [item for item in items if isinstance(item, Group) and item.head != ":private"]
    entries = typed_list(
        document, [i for i in items if i not in private] if either else plain, "an object"
    )
    declared = {entry.word.text for entry in entries}
    for section in private:
        inner = list(section.items[1:])
        # Unfactored MA-PDDL writes the owner first: "(:private depot0 hoist0 - hoist)".
        first = inner[0].text if inner and isinstance(inner[0], Word) else ""
        repeated = sum(isinstance(i, Word) and i.text == first for i in inner) > 1
        entries += typed_list(
            document, inner[1:] if repeated or first in declared else inner, "an object"
        )
    for entry in entries:
        names.check_types(entry)
        if entry.word.text.startswith("?"):
            raise document.fail("a variable cannot be an object", entry.word)
        old = into.get(entry.word.text, ())
        into[entry.word.text] = (*old, *(t for t in entry.types if t not in old))


def _all(sections: dict[str, list[Group]], key: str) -> list[Group]:
    return sections.get(key, [])


def _read_types(document: Document, sections: dict[str, list[Group]]) -> dict[str, tuple[str, ...]]:
    """Type -> direct supertypes.  Supertypes need no declaration of their own."""
    types: dict[str, tuple[str, ...]] = {}
    offsets: dict[str, Word] = {}
    for section in _all(sections, ":types"):
        for entry in typed_list(document, section.items[1:], "a type"):
            name = entry.word.text
            offsets.setdefault(name, entry.word)
            parents = tuple(
                p for p in entry.types if p not in ("object", name) and name != "object"
            )
            types[name] = tuple(dict.fromkeys((*types.get(name, ()), *parents)))
            for parent in parents:
                types.setdefault(parent, ())
    types.pop("object", None)
    for name in types:
        cycle = _cycle(types, name)
        if cycle:
            raise document.fail(
                "the types form a cycle: " + " - ".join(cycle), offsets.get(name, document.root)
            )
    return types


def _cycle(types: dict[str, tuple[str, ...]], start: str) -> list[str] | None:
    """A chain of supertypes that leads from ``start`` back to it."""
    came: dict[str, str] = {}
    todo = [start]
    while todo:
        name = todo.pop()
        for parent in types.get(name, ()):
            if parent == start:
                chain = [name]
                while chain[-1] != start:
                    chain.append(came[chain[-1]])
                return [*reversed(chain), start]
            if parent not in came:
                came[parent] = name
                todo.append(parent)
    return None


def _read_predicates(
    document: Document, sections: dict[str, list[Group]]
) -> dict[str, frozenset[int]]:
    predicates: dict[str, frozenset[int]] = {}

    def declare(items: Sequence[Expression]) -> None:
        for item in items:
            if isinstance(item, Group) and item.head == ":private":
                # "(:private ?agent - position (p ..) ..)" or, factored, "(:private (p ..) ..)".
                declare([part for part in item.items[1:] if isinstance(part, Group)])
                continue
            entry = group(document, item, "a predicate in parentheses")
            if len(entry) == 0:
                raise document.fail("expected a predicate, found '()'", entry)
            name = word(document, entry.items[0], "the name of a predicate").text
            if name == "=":  # some domains declare it; it stays the equality of objects
                continue
            arity = len(typed_list(document, entry.items[1:], "a variable"))
            predicates[name] = predicates.get(name, frozenset()) | {arity}

    for section in _all(sections, ":predicates"):
        declare(section.items[1:])
    return predicates


def _read_functions(
    document: Document, sections: dict[str, list[Group]]
) -> dict[str, frozenset[int]]:
    functions: dict[str, frozenset[int]] = {}
    for section in _all(sections, ":functions"):
        for item in section.items[1:]:
            if isinstance(item, Word):  # "- number" behind a function
                continue
            name = word(document, item.items[0], "the name of a function").text if len(item) else ""
            arity = len(typed_list(document, item.items[1:], "a variable"))
            functions[name] = functions.get(name, frozenset()) | {arity}
    return functions


def _action_name(document: Document, item: Group) -> Word:
    if len(item) < 2:
        raise document.fail("expected the name of the action", item)
    return word(document, item.items[1], "the name of the action")


def _complain_about_double_action(document: Document, sections: dict[str, list[Group]]) -> None:
    seen: set[str] = set()
    for item in _all(sections, ":action"):
        name = _action_name(document, item)
        if name.text in seen:
            raise document.fail(f"action {name.text!r} is declared twice", name)
        seen.add(name.text)


_FIELDS = (":agent", ":parameters", ":precondition", ":effect")


def _fields(document: Document, item: Group) -> dict[str, tuple[Expression, ...]]:
    """The parts of an action by keyword, in any order."""
    fields: dict[str, tuple[Expression, ...]] = {}
    key = ""
    for part in item.items[2:]:
        if isinstance(part, Word) and part.text.startswith(":"):
            key = part.text
            if key not in _FIELDS:
                raise document.fail(
                    f"unknown keyword {key!r} in an action",
                    part,
                    "Known here: " + ", ".join(_FIELDS) + ".",
                )
            if key in fields:
                raise document.fail(f"{key} occurs twice in one action", part)
            fields[key] = ()
        elif not key:
            raise document.fail("expected a keyword such as ':parameters'", part)
        else:
            fields[key] = (*fields[key], part)
    for key in (":parameters", ":precondition", ":effect"):
        if len(fields.get(key, ())) > 1:
            raise document.fail(
                f"expected one expression after {key}, found {len(fields[key])}", fields[key][1]
            )
    return fields


def _parameter_items(  # noqa: C901 - one case for each place of the agent
    document: Document, fields: dict[str, tuple[Expression, ...]]
) -> tuple[tuple[Expression, ...], str | None]:
    """The full typed list of parameters, the agent's first unless it stands among them.

    The agent's name.
    """
    listed: tuple[Expression, ...] = ()
    if fields.get(":parameters"):
        listed = group(document, fields[":parameters"][0], "a list of parameters").items
    agent_items = fields.get(":agent", ())
    for number, item in enumerate(listed):
        if isinstance(item, Word) and item.text == ":agent":
            before, behind = listed[:number], listed[number + 1 :]
            if not behind or not isinstance(behind[0], Word):
                raise document.fail("expected a variable after ':agent'", item)
            return before + behind, behind[0].text
    if ":agent" not in fields:
        return listed, None
    if len(agent_items) == 1 and isinstance(agent_items[0], Group):  # ":agent (?a - robot)"
        agent_items = agent_items[0].items
    if not agent_items or not isinstance(agent_items[0], Word):
        raise document.fail("expected a variable after ':agent'", document.root)
    name = agent_items[0].text
    if any(isinstance(item, Word) and item.text == name for item in listed):
        return listed, name
    if len(agent_items) > 1 and not (
        isinstance(agent_items[1], Word) and agent_items[1].text == "-"
    ):
        raise document.fail(
            "expected '- TYPE' or nothing after the agent's variable", agent_items[1]
        )
    if len(agent_items) == 1:  # an untyped agent must not take the type of the parameters behind it
        at = agent_items[0].offset
        agent_items = (agent_items[0], Word("-", at), Word("object", at))
    return (*agent_items, *listed), name


def _arity(names: Names, item: Group) -> int:
    items, _ = _parameter_items(names.document, _fields(names.document, item))
    return len(typed_list(names.document, items, "a variable"))


def _read_schema(names: Names, item: Group) -> Schema:
    document = names.document
    name = _action_name(document, item)
    fields = _fields(document, item)
    items, agent_name = _parameter_items(document, fields)
    parameters = names.read_variables(items)
    agent = next((i for i, v in enumerate(parameters) if v.name == agent_name), None)
    if agent_name is not None and agent is None:
        raise document.fail(f"expected a variable after ':agent', found {agent_name!r}", item)
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
    document = names.document
    parts: dict[str, Part] = {}
    for comment in document.comments:
        if not item.offset < comment.offset < item.end or comment.text.split(maxsplit=1)[:1] != [
            "subaction"
        ]:
            continue
        found = _PART.match(comment.text)
        expected = "Expected '; subaction ROBOT (name args)' or '; subaction ROBOT idle'."
        if not found or not found["robot"]:
            raise document.fail("this subaction comment cannot be read", comment, expected)
        robot, what = found["robot"], found["what"].strip()
        if robot in parts:
            raise document.fail(f"robot {robot!r} has two subactions in one action", comment)
        template: tuple[str, ...] | None = None
        if what != "idle":
            words = re.fullmatch(r"\(\s*([^()]+?)\s*\)", what)
            if not words:
                raise document.fail("this subaction comment cannot be read", comment, expected)
            template = tuple(words[1].split())
            for term in template[1:]:
                names.term(Word(term, comment.offset))
        parts[robot] = Part(robot, template)
    return tuple(parts.values())


def _check_parts(
    document: Document, schemas: tuple[Schema, ...], actions: dict[str, Group]
) -> None:
    if not any(schema.parts for schema in schemas):
        return
    for schema in schemas:
        item = actions[schema.name]
        if not schema.parts:
            raise document.fail(
                f"action {schema.name!r} has no '; subaction' comment, but others in this "
                "domain have",
                item,
                "In joint-action PDDL every action says what each robot does in it.",
            )
        if schema.agent is not None:
            raise document.fail(
                f"action {schema.name!r} has both ':agent' and subaction comments", item
            )
