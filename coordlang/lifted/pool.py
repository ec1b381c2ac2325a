# SPDX-License-Identifier: GPL-3.0-or-later
"""All features up to a complexity that are defined in given problems; equal ones once."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import chain, combinations, product
from typing import Any

import numpy as np

from coordlang.lifted.features import (
    Attribute,
    Both,
    Concept,
    Count,
    Distance,
    Feature,
    Gap,
    Least,
    Named,
    Number,
    One,
    Residue,
    Role,
    Same,
    Sign,
    Size,
    Some,
    Term,
    Without,
)
from coordlang.lifted.world import ANY, States, World, named_objects, positions
from planners.joint.tables import Ints

#: Objects that a count names, at most.
_NAMED = 2
#: More complex concepts are left out where there are so many, or where their tables have so many
#: entries.
_CONCEPTS = 1_000
_ENTRIES = 200_000_000
#: What the numbers of features are divided by, and cut at.
_MODULI = (2, 3, 4)
_MOSTS = (1, 2, 3)


@dataclass(frozen=True, slots=True)
class Pool:
    """Features that differ in given states, simple ones first.

    Of all ``features`` that tell the same states apart the simplest one.  ``values`` is what they
    are: (features, states), states of all tables one after another.  ``tried`` counts the features
    looked at, and the concepts and numbers of which they are made.
    """

    features: tuple[Feature, ...]
    values: Ints
    tried: int


def pool_of(states: Sequence[States], most: int, landmarks: bool = False) -> Pool:
    """The features up to a complexity that tell some of these states apart.

    With ``landmarks`` they may name places that all problems have, however different their maps.
    """
    vocabulary = _Vocabulary([own.world for own in states], landmarks)
    concepts = _concepts(vocabulary, states, most)
    found = set(_numbers(vocabulary, concepts, most))
    numbers = _different_numbers(found, states)
    features = {one for one in _features(vocabulary, numbers, most) if one.complexity <= most}
    kept: dict[bytes, tuple[Feature, Ints]] = {}
    for feature in sorted(features, key=_simplest):
        # Not kept in states: there are many features, of which few are used.
        values = np.concatenate([feature(own) for own in states])
        key, classes = _partition(values)
        if classes > 1:
            kept.setdefault(key, (feature, values))
    table = np.array([values for _, values in kept.values()], np.int64)
    tried = len(concepts) + len(found) + len(features)
    simplest = tuple(feature for feature, _ in kept.values())
    return Pool(simplest, table.reshape(len(kept), sum(map(len, states))), tried)


def _simplest(one: Feature | Number) -> tuple[int, str]:
    return one.complexity, str(one)


def _partition(values: Ints) -> tuple[bytes, int]:
    """What states values tell apart: classes numbered by first occurrence, and how many."""
    _, first, number = np.unique(values, return_index=True, return_inverse=True)
    return np.argsort(np.argsort(first))[number].astype(np.int16).tobytes(), len(first)


class _Vocabulary:
    """What features may mention.

    ``named`` objects that all problems have, ``fluents`` with their numbers of arguments, static
    ``relations``, those ``paths`` of them along which all problems have positions, and ``sets``:
    types, and predicates with one argument.
    """

    def __init__(self, worlds: Sequence[World], landmarks: bool) -> None:
        self.named = named_objects(worlds, landmarks)
        self.fluents = sorted({*chain(*(world.fluents for world in worlds))})
        self.relations = sorted({*chain(*(world.relations for world in worlds))})
        self.paths = [
            name
            for name in self.relations
            if all(positions(world.relations.get(name, ())) for world in worlds)
        ]
        sets = {name for name, arity in self.fluents if arity == 1}.union(*map(_sets, worlds))
        self.sets = sorted(sets)

    def terms(self) -> Iterator[Term]:
        for (predicate, arity), name in product(self.fluents, self.named):
            if arity == 2:
                yield Term(predicate, name)
                yield Term(predicate, name, inverse=True)

    def roles(self) -> Iterator[Role]:
        binary = [name for name, arity in self.fluents if arity == 2]
        for closure, names in ((False, [*binary, *self.relations]), (True, self.relations)):
            for name in names:
                yield Role(name, closure=closure)
                yield Role(name, inverse=True, closure=closure)


def _sets(world: World) -> set[str]:
    """The types of a world, ``all`` among them, and its static predicates with one argument."""
    unary = {name for name, tuples in world.statics.items() if any(len(a) == 1 for a in tuples)}
    return unary.union(world.types)


def _features(vocabulary: _Vocabulary, numbers: Sequence[Number], most: int) -> Iterator[Feature]:
    for number in numbers:
        yield from (Residue(number, modulus) for modulus in _MODULI)
        yield from (Least(number, cut) for cut in _MOSTS)
    yield from (Sign(*pair) for pair in _pairs(numbers, most - 1) if _comparable(*pair))
    yield from (Same(one, other) for one, other in combinations(vocabulary.terms(), 2))


def _pairs(found: Sequence[Any], most: int) -> Iterator[tuple[Any, Any]]:
    """Pairs that together have no more than this complexity."""
    known = [(one.complexity, one) for one in found]
    return ((a, b) for (one, a), (other, b) in combinations(known, 2) if one + other <= most)


def _comparable(one: Number, other: Number) -> bool:
    if isinstance(one, Attribute) and isinstance(other, Attribute):
        return (one.name, one.relation) == (other.name, other.relation)
    if isinstance(one, Count) and isinstance(other, Count):
        return (one.predicate, one.args.count(ANY)) == (other.predicate, other.args.count(ANY))
    return isinstance(one, Size) and isinstance(other, Size)


def _numbers(vocabulary: _Vocabulary, concepts: Sequence[Concept], most: int) -> Iterator[Number]:
    terms = list(vocabulary.terms())
    kinds = [("row", ""), ("column", "")]
    kinds += product(["degree"], vocabulary.relations)
    kinds += product(["position"], vocabulary.paths)
    yield from (Attribute(*kind, term) for kind, term in product(kinds, terms))
    for relation, (one, other) in product(vocabulary.relations, combinations(terms, 2)):
        yield Distance(relation, one, other)
    for predicate, arity in vocabulary.fluents:
        for args in product((ANY, *vocabulary.named), repeat=arity):
            if arity - args.count(ANY) <= _NAMED:
                yield Count(predicate, args)
    # A feature adds two to the complexity of its number.
    yield from (Size(concept) for concept in concepts if 3 + concept.complexity <= most)
    for pair in _pairs(concepts, most - 3):
        yield from (Gap(relation, *pair) for relation in vocabulary.relations)


def _different_numbers(found: Iterable[Number], states: Sequence[States]) -> list[Number]:
    """The simplest of equal numbers; none that is the same in all states."""
    kept: dict[bytes, Number] = {}
    for number in sorted(found, key=_simplest):
        values = np.concatenate([number(own) for own in states])
        key = values.astype(np.int32).tobytes()
        if key not in kept and len(values) and (values != values[0]).any():
            kept[key] = number
    return [*kept.values()]


def _concepts(vocabulary: _Vocabulary, states: Sequence[States], most: int) -> list[Concept]:
    """Concepts that differ, simple ones first; the rest is left out where they are too many."""
    seen: set[bytes] = set()
    levels: list[list[Concept]] = [[]]
    entries = sum(len(own) * len(own.world.objects) for own in states)
    for complexity in range(1, most - 2):
        if complexity > 1 and not any(levels[(complexity - 1) // 2 :]):
            break  # larger ones would be made of these
        levels.append([])
        for concept in sorted(_next_concepts(vocabulary, levels, complexity), key=str):
            key = b"".join(np.packbits(concept(own)).tobytes() for own in states)
            if key not in seen:
                seen.add(key)
                levels[-1].append(concept)
            if len(seen) > _CONCEPTS or len(seen) * entries > _ENTRIES:
                return [*chain(*levels)]
    return [*chain(*levels)]


def _next_concepts(
    vocabulary: _Vocabulary, levels: Sequence[Sequence[Concept]], complexity: int
) -> Iterator[Concept]:
    """Concepts of a complexity, made of those of less."""
    if complexity == 1:
        yield from map(Named, vocabulary.sets)
        yield from map(One, vocabulary.named)
    yield from map(Without, levels[complexity - 1])
    for role in vocabulary.roles():
        if role.complexity < complexity:
            yield from (Some(role, concept) for concept in levels[complexity - role.complexity])
    for left in range(1, complexity - 1):
        right = complexity - 1 - left
        if left < right:
            yield from (Both(*pair) for pair in product(levels[left], levels[right]))
        elif left == right:
            yield from (Both(*pair) for pair in combinations(levels[left], 2))
