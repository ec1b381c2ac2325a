# SPDX-License-Identifier: GPL-3.0-or-later
"""Sets of sentences, each kept once: canonical, deterministic, acyclic automata.

Equal sets have one number, and every operation is done once for each different pair of numbers.
"""

from __future__ import annotations

from collections.abc import Sequence
from random import Random

#: Words, one after another.
Words = tuple[int, ...]
#: The set without a sentence, and the set of the empty sentence alone.
NOTHING, SILENCE = 0, 1


class SentenceSets:
    """All sets of sentences that were met, by number."""

    def __init__(self) -> None:
        #: Of each set, whether it has the empty sentence, and its first words with what follows.
        self._sets: list[tuple[bool, dict[int, int]]] = [(False, {}), (True, {})]
        self._number: dict[tuple[bool, tuple[tuple[int, int], ...]], int] = {
            (False, ()): NOTHING,
            (True, ()): SILENCE,
        }
        self._union: dict[tuple[int, int], int] = {}
        self._common: dict[tuple[int, int], int] = {}

    def __len__(self) -> int:
        """Count the different sets."""
        return len(self._sets)

    def before(self, words: Sequence[int], number: int) -> int:
        """The sentences that say these words and then one of a set."""
        for word in reversed(words):
            number = self._of(False, {word: number})
        return number

    def after(self, words: Sequence[int], number: int) -> int:
        """What follows these words in the sentences of a set that begin with them."""
        for word in words:
            number = self._sets[number][1].get(word, NOTHING)
        return number

    def union(self, one: int, other: int) -> int:
        """The union of two sets."""
        if one == other or NOTHING in (one, other):
            return max(one, other)
        key = (one, other) if one < other else (other, one)
        known = self._union.get(key)
        if known is None:
            (ends, moves), (also_ends, more) = self._sets[one], self._sets[other]
            together = dict(moves)
            for word, rest in more.items():
                together[word] = self.union(together.get(word, NOTHING), rest)
            known = self._union[key] = self._of(ends or also_ends, together)
        return known

    def common(self, one: int, other: int) -> int:
        """The intersection of two sets."""
        if one == other or NOTHING in (one, other):
            return min(one, other)
        key = (one, other) if one < other else (other, one)
        known = self._common.get(key)
        if known is None:
            (ends, moves), (also_ends, more) = self._sets[one], self._sets[other]
            both = {
                word: self.common(rest, more[word]) for word, rest in moves.items() if word in more
            }
            known = self._common[key] = self._of(ends and also_ends, both)
        return known

    def drawn(self, number: int, random: Random) -> Words:
        """A sentence of a set that is not empty."""
        said: list[int] = []
        while True:
            ends, moves = self._sets[number]
            if ends and random.randrange(len(moves) + 1) == 0:
                return tuple(said)
            word, number = random.choice(tuple(moves.items()))
            said.append(word)

    def has(self, number: int, sentence: Sequence[int]) -> bool:
        """Whether a sentence is one of a set."""
        return self._sets[self.after(sentence, number)][0]

    def _of(self, ends: bool, following: dict[int, int]) -> int:
        """The set of sentences that go on as it says after a word, and of the empty one or not."""
        moves = tuple(sorted(item for item in following.items() if item[1] != NOTHING))
        known = self._number.get((ends, moves))
        if known is None:
            known = self._number[ends, moves] = len(self._sets)
            self._sets.append((ends, dict(moves)))
        return known
