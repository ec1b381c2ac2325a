# SPDX-License-Identifier: GPL-3.0-or-later
"""Partitions of states into words, which builders make and verifiers check; keys of states."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from planners.joint.states import StateCodec
from planners.joint.tables import Ints, Rows, find_rows, unique_rows

#: States whose keys are made at a time.
_BLOCK = 50_000


def read_keys(codec: StateCodec, keys: Collection[str]) -> tuple[Rows, Ints]:
    """Read keys into rows (keys, blocks), and list the positions of what is no key of a state.

    The rows of these mean nothing.
    """
    atoms = {text[1:-1]: (n, *own) for n, (text, *own) in enumerate(sorted(_atoms(codec)))}
    facts: list[bytes] = []
    labels: list[dict[int, int]] = []
    wrong: list[int] = []
    for number, key in enumerate(keys):
        is_right = not key or (key[0] == "(" and key[-1] == ")")
        before, true, last = -1, 0, {}
        for text in key[1:-1].split(") (") if key else ():
            atom, robot, value = atoms.get(text, (-1, -1, 0))
            is_right &= atom > before and robot not in last  # of the model, sorted, each once
            before = atom
            if robot < 0:
                true |= 1 << value
            else:
                last[robot] = value
        if not is_right or (codec.memory is not None and len(last) < len(codec.robots)):
            wrong.append(number)
        facts.append(true.to_bytes(8 * codec.fact_blocks, "little"))
        labels.append(last)
    rows = np.frombuffer(b"".join(facts), "<u8").astype(np.uint64)
    rows = rows.reshape(len(keys), codec.fact_blocks)
    if codec.memory is not None:
        robots = range(len(codec.robots))
        table = [[own.get(robot, -1) for robot in robots] for own in labels]
        rows = codec.remembering(rows, np.array(table, np.int64).reshape(len(keys), len(robots)))
    return rows, np.array(wrong, np.int64)


def keys_of(codec: StateCodec, rows: Rows) -> list[str]:
    """The keys of states: `StateCodec.key` of each row."""
    texts = codec.facts.texts  # sorted, as the facts are
    said = {(robot, value): text for text, robot, value in _atoms(codec)}
    keys: list[str] = []
    for start in range(0, len(rows), _BLOCK):
        block = rows[start : start + _BLOCK]
        state, fact = np.nonzero(codec.truth(block))
        bounds = np.searchsorted(state, np.arange(len(block) + 1)).tolist()
        true = [texts[n] for n in fact.tolist()]
        states = [true[a:b] for a, b in pairwise(bounds)]
        if codec.memory is not None:
            for own, labels in zip(states, codec.last_labels(block).tolist(), strict=True):
                own += [said[last] for last in enumerate(labels)]
                own.sort()
        keys += map(" ".join, states)
    return keys


def _atoms(codec: StateCodec) -> Iterator[tuple[str, int, int]]:
    """All atoms that a key may have: facts with -1 and their number, and remembered subactions.

    Those with the number of the robot and that of its label, -1 for none yet.
    """
    for number, text in enumerate(codec.facts.texts):
        yield text, -1, number
    for robot, labels in enumerate(codec.memory or ()):
        for number, label in enumerate(("none", *labels), -1):
            yield f"(last {codec.robots[robot]} {label})", robot, number


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
