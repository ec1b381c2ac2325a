# SPDX-License-Identifier: GPL-3.0-or-later
"""A domain file -> `Domain`."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

from planners.pddl.lifted import Domain, Signatures
from planners.pddl.names import Names, group, read_objects, token, typed_list
from planners.pddl.network import read_network
from planners.pddl.schemas import action_name, arity_of, check_parts, read_schema
from planners.pddl.sections import Sections, read_header
from planners.pddl.sexpr import Document, Expression, Group, Source, Token, parse, read_source
from planners.system.limits import reaching
from planners.system.messages import echoed


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
    signatures = _read_predicates(document, sections, types)
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
        functions=_read_functions(document, sections),
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
        for entry in typed_list(document, section.items[1:], "a type"):
            name = entry.token.text
            offsets.setdefault(name, entry.token)
            parents = tuple(
                p for p in entry.types if p not in ("object", name) and name != "object"
            )
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


def _read_predicates(
    document: Document, sections: Sections, types: Mapping[str, object]
) -> Signatures:
    """The types of arguments; ``object`` for those without a declared type."""
    signatures: Signatures = {}

    def declare(items: Sequence[Expression]) -> None:
        for item in items:
            if isinstance(item, Group) and item.head == ":private":
                # "(:private ?agent - position (p ..) ..)" or, factored, "(:private (p ..) ..)".
                declare([part for part in item.items[1:] if isinstance(part, Group)])
                continue
            entry = group(document, item, "a predicate in parentheses")
            if len(entry) == 0:
                raise document.fail(
                    "expected a predicate, found '()'",
                    entry,
                    remedy="As in (at ?r - robot ?x - place).",
                )
            name = token(document, entry.items[0], "the name of a predicate").text
            if name == "=":  # some domains declare it; it stays the equality of objects
                continue
            entries = typed_list(document, entry.items[1:], "a variable")
            own = [frozenset(t if t in types else "object" for t in one.types) for one in entries]
            known = signatures.get((name, len(own)), own)
            signatures[name, len(own)] = tuple(a | b for a, b in zip(known, own, strict=True))

    for section in sections.get(":predicates", ()):
        declare(section.items[1:])
    return signatures


def _read_functions(document: Document, sections: Sections) -> dict[str, frozenset[int]]:
    found: list[tuple[str, int]] = []
    for section in sections.get(":functions", ()):
        for item in section.items[1:]:
            if isinstance(item, Token):  # "- number" behind a function
                continue
            name = (
                token(document, item.items[0], "the name of a function").text if len(item) else ""
            )
            found.append((name, len(typed_list(document, item.items[1:], "a variable"))))
    return _arities(found)


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
        name = action_name(document, item)
        if actions.setdefault(name.text, item) is not item:
            what = f"action {echoed(name.text)} is declared twice"
            raise document.fail(what, name, "Rename or remove one of them.")
    return actions
