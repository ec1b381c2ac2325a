# SPDX-License-Identifier: GPL-3.0-or-later
"""A coordination language as its file holds it: states and words as text, and where it is from."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from os import PathLike, fspath
from typing import Any

import numpy as np

from coordlang.language.provenance import Guarantee, Provenance, Tolerance, UnknownFailures
from planners.joint.model import JointModel
from planners.joint.states import StateCodec
from planners.joint.tables import Ints, Rows, find_rows, unique_rows
from planners.system.errors import BadInput, Position
from planners.system.messages import Presented, echoed


def read_key(codec: StateCodec, key: str) -> Rows:
    """The row of a state's key in a language file; raises `BadInput` for any other text."""
    try:
        row = codec.parse_key(key)
    except BadInput as error:
        raise BadInput(
            f"the language maps a state that this problem cannot have: {error.what}",
            remedy="Give the problem that the language was built for.",
        ) from None
    if (right := codec.key(row)) != key:
        raise BadInput(
            f"{echoed(key)} is no key of a state; it would be {echoed(right)}",
            remedy="A key lists the true fluents, sorted, joined by one space.",
        )
    return row


@dataclass(frozen=True, slots=True)
class Partition:
    """A partition ``f: states -> words`` of the states of a joint model (the paper, section 4).

    ``words`` are the names of the words, a word's number is its position there; ``rows`` the states
    that are listed, a sorted table (states, blocks), and ``word`` the number of each one's word;
    ``default`` that of every other state.
    """

    words: tuple[str, ...]
    rows: Rows
    word: Ints
    default: int

    @classmethod
    def of_states(cls, rows: Rows, words: Mapping[int, int]) -> Partition:
        """Name the words of an assignment ``state number in rows -> word number``.

        Words are called ``w0, w1, ..`` in the order of their first state; the default is the word
        with most states.
        """
        states = sorted(words)
        order = {word: n for n, word in enumerate(dict.fromkeys(words[s] for s in states))}
        word = np.array([order[words[state]] for state in states], np.int64)
        names = tuple(f"w{n}" for n in range(max(1, len(order))))
        most = int(np.bincount(word, minlength=1).argmax())
        return cls.of_table(names, rows[states], word, most)

    @classmethod
    def of_table(cls, words: Sequence[str], rows: Rows, word: Ints, default: int = 0) -> Partition:
        """Give each of different states, in any order, its word number."""
        table, number = unique_rows(rows)
        sorted_word = np.zeros(len(table), np.int64)
        sorted_word[number] = word
        return cls(tuple(words), table, sorted_word, default)

    def word_of(self, rows: Rows) -> Ints:
        """Return the word number of each state of a table."""
        if not len(self.rows):
            return np.full(len(rows), self.default, np.int64)
        found = find_rows(self.rows, rows)
        return np.where(found >= 0, self.word[np.maximum(found, 0)], self.default)


@dataclass(frozen=True, slots=True, repr=False)
class Language(Presented):
    """A partition of states as text, and where it comes from.

    ``states``: state key (`planners.joint.states.StateCodec.key`) -> word; ``default`` is the word
    of every other state; ``provenance`` the model, tasks and method that it was made with;
    ``position`` is what messages call the language.
    """

    words: tuple[str, ...]
    states: Mapping[str, str]
    default: str
    provenance: Provenance = field(default_factory=Provenance)
    position: Position = field(default=Position("the language"), compare=False)

    @classmethod
    def of(
        cls, partition: Partition, model: JointModel, provenance: Provenance | None = None
    ) -> Language:
        """The language that gives the states of ``model`` the words of a partition."""
        words = partition.words
        keys = map(model.codec.key, partition.rows)
        states = zip(keys, (words[word] for word in partition.word.tolist()), strict=True)
        return cls(
            words,
            dict(sorted(states)),
            words[partition.default],
            provenance or Provenance(model.robots),
        )

    @property
    def guarantee(self) -> Guarantee:
        """What is known, or claimed by a file, of the number of words."""
        size = len(self.words)
        return self.provenance.guarantee or Guarantee("unknown", size, 1, size == 1)

    @property
    def tolerance(self) -> Tolerance | None:
        """What may go wrong, or be longer, under these words; None: nothing."""
        known = self.provenance.tolerance
        if self.guarantee.coordination_language or (known is not None and known.may_fail):
            return known
        return UnknownFailures(slack=self.provenance.slack)

    @property
    def may_fail(self) -> bool:
        """Whether the file says that plans of one sentence may miscoordinate."""
        claimed = self.tolerance is not None and self.tolerance.may_fail
        return claimed or not self.guarantee.coordination_language

    def sizes(self) -> dict[str, int]:
        """How many of the listed states each word holds."""
        counts = Counter(self.states.values())
        return {word: counts[word] for word in self.words}

    def data(self) -> dict[str, Any]:
        """Return the JSON data of the language's file (docs/formats.md)."""
        from coordlang.language.file import to_data  # the file format builds on this module

        return to_data(self)

    def save(self, path: str | PathLike[str]) -> None:
        """Write a language file (gzip for ``.gz``); the file is complete or not there at all.

        Raises `UsageError` where the path cannot be written.
        """
        from coordlang.language.file import write_language  # the file format builds on this module

        write_language(self, fspath(path))

    def summary(self) -> dict[str, object]:
        """The numbers of words and states, and what is known of them: there may be millions."""
        guarantee = self.guarantee
        return {
            "words": len(self.words),
            "lower_bound": guarantee.lower_bound,
            "method": guarantee.method,
            "states": len(self.states),
            "robots": self.provenance.robots,
        }

    def partition(self, model: JointModel) -> Partition:
        """Read the keys as states of a joint model; raises `BadInput` for a key that is none."""
        number = {word: n for n, word in enumerate(self.words)}
        word = np.fromiter(
            map(number.__getitem__, self.states.values()), np.int64, len(self.states)
        )
        rows = np.zeros((len(self.states), model.codec.width), np.uint64)
        for state, key in enumerate(self.states):
            rows[state] = read_key(model.codec, key)
        return Partition.of_table(self.words, rows, word, number[self.default])
