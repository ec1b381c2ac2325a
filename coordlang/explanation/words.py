# SPDX-License-Identifier: GPL-3.0-or-later
"""The words of a language as formulas: each by itself, or one after the other."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import compress, product
from typing import Any

import numpy as np

from coordlang.explanation.minimise import Points, minimise
from coordlang.explanation.variables import Variable, valuation
from coordlang.language.words import Language, Partition
from coordlang.lifted.features import Feature, condition, english, feature_of, formula
from coordlang.lifted.language import LiftedLanguage, Vector, read_values, vectors
from coordlang.lifted.world import States, World
from coordlang.sites.coordinates import Point
from planners.joint.model import JointModel
from planners.joint.tables import Bools, Ints, Rows, find_rows, unique_rows
from planners.pddl.lifted import Atom, Domain, Problem
from planners.system.errors import note

#: A conjunction of literals: atom -> its truth value.
Conjunction = dict[Atom, bool]


@dataclass(frozen=True, slots=True)
class Literal:
    """The variable has one of these values of its own, in their order.

    Values are atoms; None: none of the variable's atoms is true.
    """

    variable: Variable
    values: tuple[Atom | None, ...]

    @property
    def others(self) -> tuple[Atom | None, ...]:
        """The variable's other values, in their order."""
        return tuple(value for value in self.variable.values if value not in self.values)

    @property
    def is_negative(self) -> bool:
        """Whether it is shorter to list the values that it excludes."""
        return self.length < len(self.values)

    @property
    def length(self) -> int:
        """The number of values that its text mentions."""
        return min(len(self.values), len(self.variable.values) - len(self.values))

    def conjunctions(self) -> list[Conjunction]:
        """The same as a disjunction of conjunctions of ground literals.

        One conjunction where one value is allowed, or where excluding the others is the same; else
        one for each atom.
        """
        always_one = None not in self.variable.values
        if None in self.values or (always_one and len(self.values) > 1):
            return [{atom: False for atom in self.others if atom is not None}]
        return [{atom: True} for atom in self.values if atom is not None]


#: A conjunction.  The empty term is true.
Term = tuple[Literal, ...]


@dataclass(frozen=True, slots=True)
class Cover:
    """A formula that is true in all states of one word and false in those of all other words.

    It is a disjunction of terms.  ``counts[k]`` is the number of the word's ``states`` in which
    ``terms[k]`` is true (one state may satisfy several).  ``fewest``: it is proved that no
    disjunction of fewer terms does it.
    """

    terms: tuple[Term, ...]
    counts: tuple[int, ...]
    states: int
    fewest: bool

    @property
    def length(self) -> int:
        """The values that its text mentions, and one more for each term after the first."""
        values = sum(literal.length for term in self.terms for literal in term)
        return values + max(0, len(self.terms) - 1)

    def conjunctions(self) -> list[Conjunction]:
        """The same as a disjunction of conjunctions of ground literals.

        ``[{}]`` is true, ``[]`` false.  Exact wherever the variables' invariants hold, so in all
        mapped states, and in reachable ones as far as looked at
        (`coordlang.explanation.variables`).
        """
        found: dict[tuple[tuple[Atom, bool], ...], None] = {}
        for term in self.terms:
            for parts in product(*(literal.conjunctions() for literal in term)):
                found[tuple(pair for part in parts for pair in part.items())] = None
        return [dict(pairs) for pairs in found]


@dataclass(frozen=True, slots=True)
class MappedStates:
    """The states that formulas must be exact on.

    In all other states the formulas are arbitrary: several may be true there, or none.

    ``value`` are the states as values of ``variables`` (`valuation`), and ``word`` has the number
    in ``words`` of each state's word.
    """

    words: tuple[str, ...]
    variables: tuple[Variable, ...]
    value: Ints
    word: Ints

    @property
    def states(self) -> dict[str, int]:
        """Word -> how many of the states it holds."""
        numbers = np.bincount(self.word, minlength=len(self.words)).tolist()
        return dict(zip(self.words, numbers, strict=True))


def mapped_states(table: Partition, model: JointModel, also: Rows | None = None) -> MappedStates:
    """The states that a language maps, and ``also`` these, which have its default word.

    States that the language does not map are on no optimal plan of a candidate task; ``also``
    (states, blocks) are for tasks that are no candidates.
    """
    rows = table.rows
    if also is not None:
        more, _ = unique_rows(also)
        rows = np.concatenate((rows, more[find_rows(rows, more) < 0]))
    return MappedStates(table.words, *valuation(model, rows), table.word_of(rows))


def all_covers(mapped: MappedStates) -> dict[str, Cover]:
    """Each word as a disjunction of few short terms over multi-valued variables.

    In every mapped state exactly one of the formulas is true, that of its word.  Elsewhere they are
    arbitrary.
    """
    return {word: cover(mapped, number) for number, word in enumerate(mapped.words)}


def cover(
    mapped: MappedStates, word: int, against: Sequence[int] | None = None, quick: bool = False
) -> Cover:
    """The formula of a word that is false in all states of the words ``against``; None: all others.

    ``quick``: look for few terms in one pass only, without proof.
    """
    value, variables = mapped.value, mapped.variables
    mine = mapped.word == word
    other = ~mine if against is None else np.isin(mapped.word, list(against)) & ~mine
    points = Points(tuple(len(v.values) for v in variables), value[mine], value[other])
    found = minimise(points, quick)
    boxes = found.prime.copy()
    terms = [_shortest(variables, points, *both) for both in zip(found.least, boxes, strict=True)]
    counts = points.inside(boxes, points.on).sum(axis=1).tolist()
    return Cover(tuple(terms), tuple(counts), int(mine.sum()), found.fewest)


def _shortest(variables: Sequence[Variable], points: Points, least: Bools, box: Bools) -> Term:
    """The shortest term between the least box and the prime one, which becomes the term's box."""
    literals = []
    for variable, span in zip(variables, points.spans, strict=True):
        if box[span].all():
            continue
        limits = [
            (Literal(variable, tuple(compress(variable.values, values))), values)
            for values in (least[span], box[span].copy())
        ]
        literal, box[span] = min(limits, key=lambda one: (one[0].length, one[0].is_negative))
        literals.append(literal)
    return tuple(literals)


# ---- in which form words are described: each by itself, or one after the other

#: Formulas of up to this length need no order, and those of over that length are beyond reading in
#: any order.
_SHORT, _LONG = 3, 300
#: An order is worth it where it takes at most this part of the length.
_SHORTER = 0.6
#: Words tried at each place of the order.
_TRIED = 4


@dataclass(frozen=True, slots=True)
class WordDescriptions:
    """The words with their formulas, in the order in which they are described.

    A formula None means "every other state".  ``in_order``: each formula is about the states only
    that no earlier one holds; otherwise each is exact by itself, in all mapped states.
    """

    rules: tuple[tuple[str, Cover | None], ...]
    in_order: bool

    @property
    def length(self) -> int:
        """The lengths of the formulas, and one for "every other state"."""
        return sum(formula.length if formula else 1 for _, formula in self.rules)


def describe_words(mapped: MappedStates, formulas: dict[str, Cover]) -> WordDescriptions:
    """The shorter way to describe the words."""
    apart = WordDescriptions(tuple(formulas.items()), False)
    if len(formulas) < 2:
        return apart
    # The longest formula, if it mentions more than one value, is "every other state".
    longest = max(formulas, key=lambda word: (formulas[word].length, formulas[word].states))
    if formulas[longest].length > 1:
        others = tuple((word, own) for word, own in formulas.items() if word != longest)
        apart = WordDescriptions((*others, (longest, None)), False)
    if not _SHORT * len(formulas) < apart.length <= _LONG * len(formulas):
        return apart
    ordered = _in_order(mapped, formulas)
    return ordered if ordered.length <= _SHORTER * apart.length else apart


def _in_order(mapped: MappedStates, formulas: dict[str, Cover]) -> WordDescriptions:
    """One word after another, each with its formula against the words still to come.

    Next is the word with the shortest formula, of the few that look shortest.
    """
    left = dict(formulas)
    rules: list[tuple[str, Cover | None]] = []
    while len(left) > 1:
        numbers = [mapped.words.index(word) for word in left]
        for word in sorted(left, key=lambda w: left[w].length)[:_TRIED]:
            left[word] = cover(mapped, mapped.words.index(word), numbers, quick=True)
        best = min(left, key=lambda w: left[w].length)
        rules.append((best, cover(mapped, mapped.words.index(best), numbers)))
        del left[best]
    return WordDescriptions((*rules, (next(iter(left)), None)), True)


@dataclass(frozen=True, slots=True)
class LiftedWords:
    """Words as formulas over features, the same in every problem of the domain.

    ``terms``: word -> the terms of its formula, a disjunction.  It is exact for all values that the
    lifted language knows and those that states here have.
    """

    features: tuple[Feature, ...]
    terms: Mapping[str, tuple[str, ...]]

    def data(self) -> dict[str, Any]:
        """Return features and formulas as JSON data."""
        return {
            "features": [
                {"definition": str(one), "formula": formula(one), "text": english(one)}
                for one in self.features
            ],
            "words": {word: list(terms) for word, terms in self.terms.items()},
        }

    def text(self) -> str:
        """The formulas and what their features are, as text."""
        lines = ["As functions of features, which other problems of the domain have, too:"]
        for word, terms in self.terms.items():
            lines.append(f"  {word}: {' or '.join(terms)}")
        lines += [f"  {formula(one)} is {english(one)}." for one in self.features]
        return "\n".join(lines)


def lifted_words(
    language: Language,
    declared: tuple[Domain, Problem],
    model: JointModel,
    known: Mapping[str, Point],
) -> LiftedWords | None:
    """The formulas of a language's words over the features that it records.

    None where it records none, and, with a note, where the features do not give the states the
    words that the language gives them.  ``declared`` are domain and problem, ``known`` coordinates
    of places.

    Raises `BadInput` for features or values that are none.
    """
    origin, position = language.provenance.lifted, language.position
    if not origin:
        return None
    features = tuple(feature_of(text, position) for text in origin["features"])
    values = read_values(origin["values"], len(features), position)
    table = language.partition(model)
    states = States(World(*declared, model, known), table.rows)
    lifted = LiftedLanguage(features, language.words, values, model.robots)
    given = [language.words[number] for number in table.word.tolist()]
    if lifted.words_of(states) != given:
        note(
            "the features that the language records do not give its states their words",
            position=position,
            remedy="If it was grounded with --coordinates, give them as coordinates.json beside "
            "the problem.",
        )
        return None
    occurring = dict(zip(map(tuple, vectors(features, states).tolist()), given, strict=True))
    return LiftedWords(features, _terms(features, {**values, **occurring}, language.words))


def _terms(
    features: Sequence[Feature], values: Mapping[Vector, str], words: Sequence[str]
) -> dict[str, tuple[str, ...]]:
    """Word -> terms, of the words that have values."""
    vectors = sorted(values)
    word = np.array([values[vector] for vector in vectors], object)
    number = np.array(vectors, np.int64).reshape(len(vectors), len(features))
    domains = [np.unique(column) for column in number.T]
    for own, column in zip(domains, number.T, strict=True):  # values become numbers of values
        column[:] = np.searchsorted(own, column)
    found = {}
    for name in words:
        mine = word == name
        if mine.any():
            points = Points(tuple(map(len, domains)), number[mine], number[~mine])
            found[name] = tuple(
                _term(features, domains, [box[span] for span in points.spans])
                for box in minimise(points).prime
            )
    return found


def _term(features: Sequence[Feature], domains: Sequence[Ints], allowed: Sequence[Bools]) -> str:
    """A conjunction of limits on features; the empty one is ``true``."""
    parts = []
    for feature, values, own in zip(features, domains, allowed, strict=True):
        if not own.all():
            limits = [condition(feature, value) for value in values[own].tolist()]
            parts.append(limits[0] if len(limits) == 1 else f"({' or '.join(limits)})")
    return " and ".join(parts) or "true"
