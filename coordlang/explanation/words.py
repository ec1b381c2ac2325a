"""The words of a language as formulas."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from coordlang.explanation.boxes import Bits, Points
from coordlang.explanation.cover import Cover, Literal, Term
from coordlang.explanation.minimise import minimise
from coordlang.explanation.variables import Valuation, valuation
from coordlang.language.words import Language
from planners.joint.model import JointModel
from planners.tables import Ints, Rows, find_rows, unique_rows


@dataclass(frozen=True, slots=True)
class MappedStates:
    """The states that formulas must be exact on: their values and word numbers.

    For all other states the formulas say nothing: several may be true there, or none.
    """

    words: tuple[str, ...]
    valuation: Valuation
    word: Ints

    @property
    def states(self) -> list[int]:
        """How many states each word has."""
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
    language does not map are on no optimal plan of a candidate task: what the formulas say there is
    left open, unless the states are given as ``also`` (a table of rows), for tasks that are no
    candidates.

    Raises `BadInput` for a language of another model.
    """
    return all_covers(mapped_states(language, model, also))


def all_covers(mapped: MappedStates) -> dict[str, Cover]:
    """Each word's formula; see `word_formulas`."""
    return {word: cover(mapped, number) for number, word in enumerate(mapped.words)}


def cover(
    mapped: MappedStates, word: int, against: Sequence[int] | None = None, quick: bool = False
) -> Cover:
    """The formula of a word that is false in all states of the words ``against``.

    By default these are all others.
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
    """What is shortest to say between the least box and the prime one."""
    literals = []
    for variable, start in zip(mapped.valuation.variables, points.offset.tolist(), strict=True):
        places = range(len(variable.values))
        if all(prime[start + p] for p in places):
            continue
        choices = [
            Literal(variable, frozenset(variable.values[p] for p in places if box[start + p]))
            for box in (least, prime)
        ]
        literals.append(min(choices, key=lambda c: (c.length, c.is_negative)))
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
