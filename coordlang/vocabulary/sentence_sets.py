# SPDX-License-Identifier: GPL-3.0-or-later
"""Sets of sentences, each kept once, as sets of sequences that end with a mark."""

from __future__ import annotations

from collections.abc import Sequence
from random import Random

from coordlang.required.choices import END, LabelSets

#: Words, one after another.
Words = tuple[int, ...]
#: The set without a sentence, and the set of the empty sentence alone.
NOTHING, SILENCE = END, 1
#: In place of a word: the sentence ends, so that one may begin another.
_MARK = -1


class SentenceSets(LabelSets):
    """All sets of sentences that were met, by number."""

    def __init__(self) -> None:
        super().__init__()
        self._common: dict[tuple[int, int], int] = {}
        silence = self.of_moves({_MARK: END})
        assert silence == SILENCE, "it is the first set"

    def before(self, words: Sequence[int], number: int) -> int:
        """The sentences that say these words and then one of a set."""
        for word in reversed(words):
            number = self.of_moves({word: number})
        return number

    def after(self, words: Sequence[int], number: int) -> int:
        """What follows these words in the sentences of a set that begin with them."""
        for word in words:
            number = self.moves(number).get(word, NOTHING)
        return number

    def common(self, one: int, other: int) -> int:
        """The intersection of two sets."""
        if one == other:
            return one
        key = (one, other) if one < other else (other, one)
        known = self._common.get(key)
        if known is None:
            mine, theirs = self.moves(one), self.moves(other)
            both = {
                word: self.common(rest, theirs[word])
                for word, rest in mine.items()
                if word in theirs
            }
            known = self._common[key] = self.of_moves(
                {word: rest for word, rest in both.items() if word == _MARK or rest != NOTHING}
            )
        return known

    def drawn(self, number: int, random: Random) -> Words:
        """A sentence of a set that is not empty."""
        said: list[int] = []
        while True:
            ends, *moves = self.moves(number).items()
            if ends[0] != _MARK:
                moves.insert(0, ends)
            elif random.randrange(len(moves) + 1) == 0:
                return tuple(said)
            word, number = random.choice(moves)
            said.append(word)

    def has(self, number: int, sentence: Sequence[int]) -> bool:
        """Whether a sentence is one of a set."""
        return _MARK in self.moves(self.after(sentence, number))
