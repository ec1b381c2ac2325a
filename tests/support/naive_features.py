# SPDX-License-Identifier: GPL-3.0-or-later
"""Features by their definitions: one state, given as a set of atoms, and lists of objects."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from itertools import product

import networkx as nx

from coordlang.lifted import features as f

#: The argument tuples of the atoms that are true, by predicate.
State = Mapping[str, Sequence[tuple[str, ...]]]


#: Types of objects, by name.
Objects = Mapping[str, frozenset[str]]


def value(feature: f.Feature, objects: Objects, statics: State, state: State) -> int:
    """What a feature is in a state."""

    def number(asked: f.Number) -> int | None:
        return _number(asked, objects, statics, state)

    match feature:
        case f.Same(one, other):
            here, there = _object(one, state), _object(other, state)
            return f.UNDEFINED if here is None or there is None else here == there
        case f.Sign(one, other):
            left, right = number(one), number(other)
            if left is None or right is None:
                return f.UNDEFINED
            return (left > right) - (left < right)
    found = number(feature.number)
    if found is None:
        return f.UNDEFINED
    return found % feature.modulus if isinstance(feature, f.Residue) else min(found, feature.most)


def _number(number: f.Number, objects: Objects, statics: State, state: State) -> int | None:
    match number:
        case f.Size():
            return len(members(number.concept, objects, statics, state))
        case f.Gap():
            linked = _linked(number.relation, statics)
            ends = (members(c, objects, statics, state) for c in (number.one, number.other))
            found = [_steps(a, b, linked) for a, b in product(*ends)]
            return min((steps for steps in found if steps is not None), default=None)
        case f.Count():
            return sum(
                len(args) == len(number.args)
                and all(wanted in ("_", own) for wanted, own in zip(number.args, args, strict=True))
                for args in state.get(number.predicate, ())
            )
        case f.Distance():
            here, there = _object(number.one, state), _object(number.other, state)
            if here is None or there is None:
                return None
            return _steps(here, there, _linked(number.relation, statics))
        case f.Attribute():
            place = _object(number.term, state)
            return None if place is None else _attribute(number, place, statics)


def members(concept: f.Concept, objects: Objects, statics: State, state: State) -> set[str]:
    """The objects in a concept."""
    match concept:
        case f.Named("all"):
            return set(objects)
        case f.Named(name):
            atoms = [*statics.get(name, ()), *state.get(name, ())]
            own = {args[0] for args in atoms if len(args) == 1}
            return own | {o for o, types in objects.items() if name in types}
        case f.One(name):
            return {name} & set(objects)
        case f.Without(inner):
            return set(objects) - members(inner, objects, statics, state)
        case f.Both(one, other):
            left, right = (members(c, objects, statics, state) for c in (one, other))
            return left & right
        case f.Some(role, inner):
            ends = members(inner, objects, statics, state)
            return {a for a, b in related(role, statics, state) if b in ends}


def related(role: f.Role, statics: State, state: State) -> set[tuple[str, str]]:
    """The pairs in a role."""
    atoms = [*statics.get(role.predicate, ()), *state.get(role.predicate, ())]
    pairs = {(args[0], args[1]) for args in atoms if len(args) == 2}
    if role.inverse:
        pairs = {(b, a) for a, b in pairs}
    while role.closure:
        more = pairs | {(a, d) for a, b in pairs for c, d in pairs if b == c}
        if more == pairs:
            break
        pairs = more
    return pairs


def _object(term: f.Term, state: State) -> str | None:
    atoms = [args for args in state.get(term.predicate, ()) if len(args) == 2]
    found = [a for a, b in atoms if b == term.named] if term.inverse else []
    if not term.inverse:
        found = [b for a, b in atoms if a == term.named]
    return min(found, default=None)


def _attribute(number: f.Attribute, place: str, statics: State) -> int | None:
    if not number.relation:
        cell = re.fullmatch(r"[a-z_]*(\d+)[-_](\d+)", place)
        return int(cell[1 if number.name == "row" else 2]) if cell else None
    pairs = statics.get(number.relation, ())
    if number.name == "degree":
        near = {a for a, b in pairs if b == place} | {b for a, b in pairs if a == place}
        return len(near) if near else None
    before = place
    steps = 0
    while earlier := [a for a, b in pairs if b == before]:
        (before,), steps = earlier, steps + 1
    return steps if any(place in pair for pair in pairs) else None


def _linked(relation: str, statics: State) -> nx.Graph[str]:
    return nx.Graph(statics.get(relation, ()))


def _steps(start: str, end: str, linked: nx.Graph[str]) -> int | None:
    if start not in linked or end not in linked or not nx.has_path(linked, start, end):
        return None
    return int(nx.shortest_path_length(linked, start, end))
