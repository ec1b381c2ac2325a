"""A coordination language: states -> words, plans -> sentences."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import islice
from typing import Any, NoReturn

import numpy as np

from coordlang.language.keys import keys_of, read_keys
from planners.errors import BadInput
from planners.joint.model import JointModel
from planners.tables import Ints, Rows, find_rows, unique_rows


@dataclass(frozen=True, slots=True)
class Guarantee:
    """What is known of a language.

    How it was made, its size, and the proved lower bound on the size of any.
    """

    method: str
    size: int
    lower_bound: int
    proved_minimal: bool


@dataclass(frozen=True, slots=True)
class Language:
    """A partition ``f: states -> words`` (the paper, section 4), with what is needed to use it.

    ``states`` maps state keys (see `planners.joint.states.StateCodec`) to words; all other states
    have the word ``default``. ``domain``, ``model``, ``tasks`` and ``producer`` are recorded as in
    a language file (docs/formats.md).  ``also`` maps states to further words where words overlap
    (`coordlang.language.overlapping`); without it this is still a language.
    """

    words: tuple[str, ...]
    states: Mapping[str, str]
    default: str
    robots: tuple[str, ...]
    guarantee: Guarantee
    domain: Mapping[str, Any]
    model: Mapping[str, Any]
    tasks: Mapping[str, Any]
    producer: Mapping[str, Any]
    also: Mapping[str, tuple[str, ...]] = field(default_factory=dict)

    def sizes(self) -> dict[str, int]:
        """How many of the mapped states each word holds."""
        counts = Counter(self.states.values())
        return {word: counts[word] for word in self.words}


@dataclass(frozen=True, slots=True)
class WordTable:
    """A language over one joint model: word numbers for whole tables of states."""

    words: tuple[str, ...]
    rows: Rows
    word: Ints
    default: int

    @classmethod
    def of(cls, language: Language, model: JointModel) -> WordTable:
        """Raises `BadInput` for a state that the model cannot have."""
        if not language.states:
            none = np.zeros((0, model.codec.width), np.uint64)
            return cls(
                language.words, none, np.zeros(0, np.int64), language.words.index(language.default)
            )
        number = {word: n for n, word in enumerate(language.words)}
        table, place = unique_rows(_rows(model, language.states))
        word = np.zeros(len(table), np.int64)
        word[place] = np.fromiter(
            map(number.__getitem__, language.states.values()), np.int64, len(place)
        )
        return cls(language.words, table, word, number[language.default])

    def of_rows(self, rows: Rows) -> Ints:
        """The word number of each state of a table."""
        if not len(self.rows):
            return np.full(len(rows), self.default, np.int64)
        found = find_rows(self.rows, rows)
        return np.where(found >= 0, self.word[np.maximum(found, 0)], self.default)


def words_of_states(language: Language, model: JointModel, rows: Rows) -> list[frozenset[int]]:
    """All words of each state of a table: its own one and those of ``also``.

    Raises `BadInput` as `WordTable.of` does.
    """
    own = WordTable.of(language, model).of_rows(rows).tolist()
    words = [frozenset((word,)) for word in own]
    number = {word: n for n, word in enumerate(language.words)}
    if language.also:
        table, place = unique_rows(_rows(model, language.also))
        further = dict(zip(place.tolist(), language.also.values(), strict=True))
        for state, at in enumerate(find_rows(table, rows).tolist()):
            if at >= 0:
                words[state] |= {number[word] for word in further[at]}
    return words


def _rows(model: JointModel, keys: Iterable[str]) -> Rows:
    rows, wrong = read_keys(model.codec, keys)
    if len(wrong):
        _refuse(model, next(islice(keys, int(wrong[0]), None)))
    return rows


def _refuse(model: JointModel, key: str) -> NoReturn:
    try:
        row = model.codec.parse_key(key)
    except BadInput as error:
        raise BadInput(
            f"the language maps a state that this problem cannot have: {error.what}",
            remedy="Give the problem that the language was built for.",
        ) from None
    raise BadInput(
        f"{key!r} is no key of a state; it would be {model.codec.key(row)!r}",
        remedy="A key lists the true fluents, sorted, joined by one space.",
    )


def sentence(words: Iterable[int]) -> tuple[int, ...]:
    """The words of a state sequence, repeated neighbours collapsed.

    The paper's temporal-state constraint (TSC) of a plan.
    """
    result: list[int] = []
    for word in words:
        if not result or result[-1] != word:
            result.append(word)
    return tuple(result)


def name_words(
    model: JointModel, rows: Rows, partition: Mapping[int, int]
) -> tuple[tuple[str, ...], dict[str, str], str]:
    """Words ``w0, w1, ..`` for a partition of state numbers.

    (words, state key -> word, default word).

    Words are named in the order of their first state; the default is the word with most states.
    """
    order: dict[int, int] = {}
    for state in sorted(partition):
        order.setdefault(partition[state], len(order))
    words = tuple(f"w{n}" for n in range(max(1, len(order))))
    keys = keys_of(model.codec, rows[sorted(partition)]) if partition else []
    states = {
        key: words[order[partition[state]]]
        for key, state in zip(keys, sorted(partition), strict=True)
    }
    counts: Sequence[int] = np.bincount(
        [order[w] for w in partition.values()], minlength=len(words)
    ).tolist()
    return words, dict(sorted(states.items())), words[counts.index(max(counts))]
