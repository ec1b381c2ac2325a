# SPDX-License-Identifier: GPL-3.0-or-later
"""Words that are functions of features, as formulas over these features."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from coordlang.explanation.minimise import Points, minimise
from coordlang.language.words import Language
from coordlang.lifted.features import Feature
from coordlang.lifted.language import LiftedLanguage, Vector, read_values, vectors
from coordlang.lifted.notation import condition, english, feature_of, formula
from coordlang.lifted.world import States, World
from coordlang.sites.coordinates import Point
from planners.joint.model import JointModel
from planners.joint.tables import Bools, Ints
from planners.pddl.lifted import Domain, Problem
from planners.system.errors import Position, note


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
    domain: Domain,
    problem: Problem,
    model: JointModel,
    known: Mapping[str, Point],
    position: Position,
) -> LiftedWords | None:
    """The formulas of a language's words over the features that it records.

    None where it records none, and, with a note, where the features do not give the states the
    words that the language gives them.  ``known`` are coordinates of places.

    Raises `BadInput` for features or values that are none.
    """
    origin = language.provenance.lifted
    if not origin:
        return None
    features = tuple(feature_of(text, position) for text in origin["features"])
    values = read_values(origin["values"], len(features), position)
    table = language.partition(model)
    states = States(World.of(domain, problem, model, known), table.rows)
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
    table = np.array(vectors, np.int64).reshape(len(vectors), len(features))
    domains = [np.unique(column) for column in table.T]
    columns = zip(domains, table.T, strict=True)
    number = np.array([np.searchsorted(own, column) for own, column in columns], np.int64)
    number = number.reshape(table.T.shape).T
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
