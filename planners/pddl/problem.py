# SPDX-License-Identifier: GPL-3.0-or-later
"""A problem file -> `Problem`."""

from __future__ import annotations

from dataclasses import replace
from os import PathLike

from planners.pddl.formulas import NUMBER, read_formula
from planners.pddl.lifted import Atom, Domain, Formula, Problem
from planners.pddl.names import Names, Sections, read_header
from planners.pddl.sexpr import Group, Source, Token, parse, read_source
from planners.system.limits import reaching
from planners.system.messages import echoed


def read_problem(path: str | PathLike[str], domain: Domain) -> Problem:
    """Read a problem file of ``domain``; see `parse_problem`."""
    with reaching(lambda: f"reading {path}", "a shorter file"):
        return parse_problem(read_source(path), domain)


def parse_problem(source: Source, domain: Domain) -> Problem:
    """Read a problem.

    Raises `BadInput` (with position and remedy) for anything that ``domain`` does not declare, a
    problem of another domain, or a missing goal; `Unsupported` for timed literals and the like.
    """
    root = parse(source)
    name, sections = read_header(root, "problem")
    for section in sections.get(":domain", ()):
        given = section.items[1:2]
        other = given[0].token("the name of the domain").text if given else ""
        if other != domain.name:
            raise section.fail(
                f"this is a problem for domain {echoed(other)}, not for {echoed(domain.name)}",
                f"The domain was read from {domain.source.name}.",
            )
    names = Names(domain.types, domain.predicates, domain.functions)
    objects = names.read_objects(sections.get(":objects", ()), domain.constants)
    names = replace(names, objects=objects)
    init: set[Atom] = set()
    values: dict[Atom, float] = {}
    for section in sections.get(":init", ()):
        for item in section.items[1:]:
            _read_init(names, item.group("an atom in parentheses"), init, values)
    goal = _read_goal(names, root, sections)
    return Problem(name, source, objects, frozenset(init), goal, values)


def _read_goal(names: Names, root: Group, sections: Sections) -> Formula:
    goals = sections.get(":goal", [])
    if len(goals) != 1 or len(goals[0]) != 2:
        found = f"found {len(goals) or 'none'}"
        if len(goals) == 1:
            found = "this one has no formula, or several"
        raise (goals[-1] if goals else root).fail(
            f"expected one '(:goal FORMULA)', {found}",
            "Write (:goal (and ..)) with all that must hold at the end, once; (:goal (and)) asks "
            "for nothing.",
        )
    return read_formula(names, goals[0].items[1])


def _read_init(names: Names, item: Group, init: set[Atom], values: dict[Atom, float]) -> None:
    word = names.word(item)
    if word == "and":
        for part in item.items[1:]:
            _read_init(names, part.group("an atom in parentheses"), init, values)
    elif word == "not" and len(item) == 2:
        read_formula(names, item.items[1])  # closed world: checked, and nothing to add
    elif word == "=" and len(item) == 3 and isinstance(item.items[1], Group):
        _read_value(names, item, item.items[1], values)
    else:
        _refuse_other_states(item)
        atom = read_formula(names, item)
        if not isinstance(atom, Atom):
            remedy = "As in (at r1 a): what is not listed is false."
            raise item.fail("expected an atom in the initial state", remedy)
        init.add(atom)


def _read_value(names: Names, item: Group, term: Group, values: dict[Atom, float]) -> None:
    function, number = names.function(term), item.items[2]
    if not isinstance(number, Token) or not NUMBER.match(number.text):
        what, remedy = "a function value that is no number is", "As in (= (distance a b) 3)."
        raise item.unsupported(what, remedy)
    if values.setdefault(function, float(number.text)) != float(number.text):
        raise item.fail("this function has another value already", "Leave one of the two.")


def _refuse_other_states(item: Group) -> None:
    """Raise `Unsupported` for what is said of a later state or of one of several states."""
    if any(isinstance(part, Group) for part in item.items[1:]):
        if item.head == "at":
            raise item.unsupported("timed initial literals are")
        if item.head in ("oneof", "unknown", "or"):
            raise item.unsupported(f"an uncertain initial state '({item.head} ..)' is")
