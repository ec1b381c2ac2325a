# SPDX-License-Identifier: GPL-3.0-or-later
"""A problem file -> `Problem`."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from planners.pddl.formulas import NUMBER, read_formula
from planners.pddl.lifted import Atom, Domain, Formula, Problem
from planners.pddl.names import Names, Sections, read_header, read_objects
from planners.pddl.sexpr import Document, Group, Source, Token, parse, read_source
from planners.system.limits import reaching
from planners.system.messages import echoed


def read_problem(path: str | Path, domain: Domain) -> Problem:
    """Read a problem file of ``domain``; see `parse_problem`."""
    with reaching(lambda: f"reading {path}", "a shorter file"):
        return parse_problem(read_source(path), domain)


def parse_problem(source: Source, domain: Domain) -> Problem:
    """Read a problem.

    Raises `BadInput` (with position and remedy) for anything that ``domain`` does not declare, a
    problem of another domain, or a missing goal; `Unsupported` for timed literals and the like.
    """
    document = parse(source)
    name, sections = read_header(document, "problem")
    for section in sections.get(":domain", ()):
        given = section.items[1:2]
        other = document.token(given[0], "the name of the domain").text if given else ""
        if other != domain.name:
            raise document.fail(
                f"this is a problem for domain {echoed(other)}, not for {echoed(domain.name)}",
                section,
                f"The domain was read from {domain.source.name}.",
            )
    names = Names.of(document, domain)
    objects = dict(domain.constants)
    for section in sections.get(":objects", ()):
        read_objects(names, section.items[1:], objects)
    names = replace(names, objects=objects)
    init: set[Atom] = set()
    values: dict[Atom, float] = {}
    for section in sections.get(":init", ()):
        for item in section.items[1:]:
            _read_init(names, document.group(item, "an atom in parentheses"), init, values)
    return Problem(
        name, source, objects, frozenset(init), _read_goal(names, document, sections), values
    )


def _read_goal(names: Names, document: Document, sections: Sections) -> Formula:
    goals = sections.get(":goal", [])
    if len(goals) != 1 or len(goals[0]) != 2:
        found = "found none" if not goals else "this one has no formula, or several"
        if len(goals) > 1:
            found = f"found {len(goals)}"
        raise document.fail(
            f"expected one '(:goal FORMULA)', {found}",
            goals[-1] if goals else document.root,
            "Write (:goal (and ..)) with all that must hold at the end, once; (:goal (and)) asks "
            "for nothing.",
        )
    return read_formula(names, goals[0].items[1])


def _read_init(names: Names, item: Group, init: set[Atom], values: dict[Atom, float]) -> None:
    document = names.document
    if item.head == "and":
        for part in item.items[1:]:
            _read_init(names, document.group(part, "an atom in parentheses"), init, values)
    elif item.head == "not" and len(item) == 2:
        read_formula(names, item.items[1])  # closed world: checked, and nothing to add
    elif item.head == "=" and len(item) == 3 and isinstance(item.items[1], Group):
        _read_value(names, item, values)
    else:
        _refuse_other_states(document, item)
        atom = read_formula(names, item)
        if not isinstance(atom, Atom):
            raise document.fail(
                "expected an atom in the initial state",
                item,
                remedy="As in (at r1 a): what is not listed is false.",
            )
        init.add(atom)


def _refuse_other_states(document: Document, item: Group) -> None:
    """Raise `Unsupported` for what is said of a later state or of one of several states."""
    if any(isinstance(part, Group) for part in item.items[1:]):
        if item.head == "at":
            raise document.unsupported("timed initial literals are", item)
        if item.head in ("oneof", "unknown", "or"):
            what = f"an uncertain initial state '({item.head} ..)' is"
            raise document.unsupported(what, item)


def _read_value(names: Names, item: Group, values: dict[Atom, float]) -> None:
    document = names.document
    function = names.function(document.group(item.items[1], "a function in parentheses"))
    number = item.items[2]
    if not isinstance(number, Token) or not NUMBER.match(number.text):
        what, remedy = "a function value that is no number is", "As in (= (distance a b) 3)."
        raise document.unsupported(what, item, remedy)
    values[function] = float(number.text)
