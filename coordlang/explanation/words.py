# SPDX-License-Identifier: GPL-3.0-or-later
"""The words of a language as formulas."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import compress

import numpy as np

from coordlang.explanation.boxes import Bits, Points
from coordlang.explanation.cover import Cover, Literal, Term
from coordlang.explanation.minimise import minimise
from coordlang.explanation.variables import Valuation, valuation
from coordlang.language.words import Language
from planners.joint.model import JointModel
from planners.joint.tables import Ints, Rows, find_rows, unique_rows


@dataclass(frozen=True, slots=True)
class MappedStates:
    """The states that formulas must be exact on.

    In all other states the formulas are arbitrary: several may be true there, or none.

    Parameters
    ----------
    words
        The words by number.
    valuation
        The states as values of variables.
    word
        The word number of each state.
    """

    words: tuple[str, ...]
    valuation: Valuation
    word: Ints

    @property
    def states(self) -> list[int]:
        """The number of states of each word."""
        return [int(n) for n in np.bincount(self.word, minlength=len(self.words))]


def mapped_states(language: Language, model: JointModel, also: Rows | None = None) -> MappedStates:
    """The states that a language maps, and ``also`` these, which have its default word."""
    table = language.partition(model)
    rows, word = table.rows, table.word
    if also is not None:
        more, _ = unique_rows(also)
        more = more[find_rows(rows, more) < 0] if len(rows) else more
        rows = np.concatenate((rows, more))
        word = np.concatenate((word, np.full(len(more), table.default)))
    return MappedStates(table.words, valuation(model, rows), word)


def word_formulas(
    language: Language, model: JointModel, also: Rows | None = None
) -> dict[str, Cover]:
    """Each word as a disjunction of few short terms over multi-valued variables.

    In every mapped state exactly one of the formulas is true, that of its word.  States that the
    language does not map are on no optimal plan of a candidate task; there the formulas are
    arbitrary, unless the states are given as ``also``, for tasks that are no candidates.

    Parameters
    ----------
    language
        The language.
    model
        The joint model that its states are of.
    also
        Further states, (states, blocks).

    Raises
    ------
    BadInput
        For a language of another model.
    """
    return all_covers(mapped_states(language, model, also))


def all_covers(mapped: MappedStates) -> dict[str, Cover]:
    """Each word's formula; see `word_formulas`."""
    return {word: cover(mapped, number) for number, word in enumerate(mapped.words)}


def cover(
    mapped: MappedStates, word: int, against: Sequence[int] | None = None, quick: bool = False
) -> Cover:
    """The formula of a word that is false in all states of some other words.

    Parameters
    ----------
    mapped
        The states.
    word
        The number of the word.
    against
        The numbers of the other words; None: all.
    quick
        Whether to look for few terms in one pass only, without proof.
    """
    value = mapped.valuation.value
    mine = mapped.word == word
    other = ~mine if against is None else np.isin(mapped.word, list(against)) & ~mine
    variables = mapped.valuation.variables
    points = Points(tuple(len(v.values) for v in variables), value[mine], value[other])
    boxes = minimise(points, quick)
    terms = tuple(
        _term(mapped, points, least, prime)
        for least, prime in zip(boxes.least, boxes.prime, strict=True)
    )
    counts = (
        points.inside(_box_of(mapped, terms), points.on).sum(axis=1)
        if terms
        else np.zeros(0, np.int64)
    )
    return Cover(terms, tuple(int(c) for c in counts), int(mine.sum()), boxes.fewest)


def _term(
    mapped: MappedStates, points: Points, least: Sequence[bool], prime: Sequence[bool]
) -> Term:
    """The shortest term between the least box and the prime one."""
    literals = []
    for variable, start in zip(mapped.valuation.variables, points.offset.tolist(), strict=True):
        stop = start + len(variable.values)
        if all(prime[start:stop]):
            continue
        limits = [
            Literal(variable, frozenset(compress(variable.values, box[start:stop])))
            for box in (least, prime)
        ]
        literals.append(min(limits, key=lambda limit: (limit.length, limit.is_negative)))
    return tuple(literals)


def _box_of(mapped: MappedStates, terms: Sequence[Term]) -> Bits:
    rows = []
    for term in terms:
        values = {literal.variable.name: literal.values for literal in term}
        rows.append(
            [
                value in values.get(variable.name, variable.values)
                for variable in mapped.valuation.variables
                for value in variable.values
            ]
        )
    return np.array(rows, np.bool_)
