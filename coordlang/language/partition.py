# SPDX-License-Identifier: GPL-3.0-or-later
"""Partitions of states into words, which builders make and verifiers check; keys of states."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from planners.joint.states import StateCodec
from planners.joint.tables import Ints, Rows, find_rows, unique_rows
from planners.system.errors import BadInput
from planners.system.messages import echoed


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
        order: dict[int, int] = {}
        states = sorted(words)
        for state in states:
            order.setdefault(words[state], len(order))
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
