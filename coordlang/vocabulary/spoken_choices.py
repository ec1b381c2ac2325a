# SPDX-License-Identifier: GPL-3.0-or-later
"""What each robot can do from a node, together with what is said meanwhile: sets, not plans.

Step by step a robot has its label, and the plan enters a word or stays in one: a sequence of pairs
(label, word).  Of plan i a mixture and its sentences depend on these of robot i alone, and far
fewer of them differ than plans.
"""

from __future__ import annotations

from collections.abc import Sequence
from random import Random

import numpy as np

from coordlang.required.choices import END, Choices, LabelSets
from planners.joint.tables import Ints

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

    def common(self, one: int, other: int) -> int:
        """The intersection of two sets."""
        if one == other:
            return one
        key = (one, other) if one < other else (other, one)
        known = self._common.get(key)
        if known is None:
            mine, theirs = self.moves(one), self.moves(other)
            both = {}
            for word in mine.keys() & theirs.keys():
                rest = self.common(mine[word], theirs[word])
                if word == _MARK or rest != NOTHING:
                    both[word] = rest
            known = self._common[key] = self.of_moves(both)
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
        for word in sentence:
            number = self.moves(number).get(word, NOTHING)
        return _MARK in self.moves(number)


#: A step of a robot: its code, its label, the word that is entered, if any, and what may follow.
Step = tuple[int, int, Words, int]


class SpokenChoices:
    """The sets of robots' (label, word) sequences over the optimal plans from each node.

    O(edges) set operations, each on a different pair of sets once.

    ``choices``: the robots' choices without words.  ``words``: the sets of sentences.
    """

    def __init__(self, choices: Choices) -> None:
        self.space, self.words = choices.space, SentenceSets()
        self._of_node: dict[int, tuple[int, ...]] = {}
        self.word: list[int] = []
        self.labels: list[list[int]] = self.space.labels.tolist()
        self.targets: list[int] = self.space.targets().tolist()
        self._choices, self._sets = choices, LabelSets()
        self._spoken = len(self.space.rows) + 1
        self._sentences = {END: SILENCE}
        self._projection = {END: END}

    def __len__(self) -> int:
        """Count the different sets."""
        return len(self._sets)

    def say(self, word: Ints) -> None:
        """Set the words (nodes).

        A word is called by the least of its states: sets without a word that has changed are the
        same as before.
        """
        words, number = np.unique(word, return_inverse=True)
        least = np.full(len(words), len(self.space.rows))
        np.minimum.at(least, number, self.space.state)
        self.word = least[number].tolist()
        self._of_node = {}

    def of_node(self, node: int) -> tuple[int, ...]:
        """For a node the number of each robot's set, found from those of the nodes below it."""
        known = self._of_node.get(node)
        if known is None:
            moves: list[dict[int, int]] = [{} for _ in range(self.space.robots)]
            for edge in self.space.out_edges(node):
                below = self.of_node(self.targets[edge])
                for robot, own in enumerate(moves):
                    code, after = self.code(robot, edge, node), below[robot]
                    own[code] = self._sets.union(own.get(code, after), after)
            known = self._of_node[node] = tuple(map(self._sets.of_moves, moves))
        return known

    def entered(self, edge: int, node: int) -> Words:
        """The word that a plan enters by an edge out of a node, if it does."""
        word = self.word[self.targets[edge]]
        return () if word == self.word[node] else (word,)

    def code(self, robot: int, edge: int, node: int) -> int:
        """A robot's label on an edge out of a node and the word entered, as one number."""
        entered = self.entered(edge, node)
        return self.labels[edge][robot] * self._spoken + (entered[0] + 1 if entered else 0)

    def steps(self, number: int) -> list[Step]:
        """The first steps of a set."""
        return [
            (code, code // self._spoken, self.entered_by(code), after)
            for code, after in self._sets.moves(number).items()
        ]

    def after(self, number: int, codes: list[int]) -> int | None:
        """What may follow some steps of a set; None if it has no sequence that begins so."""
        for code in codes:
            following = self._sets.moves(number).get(code)
            if following is None:
                return None
            number = following
        return number

    def entered_by(self, code: int) -> Words:
        """The word that is entered by a step, if one is."""
        entered = code % self._spoken
        return (entered - 1,) if entered else ()

    def label_set(self, number: int) -> int:
        """The label sequences of a set, without what is said, in the sets of the choices."""
        known = self._projection.get(number)
        if known is None:
            moves: dict[int, int] = {}
            for _, label, _, after in self.steps(number):
                below = self.label_set(after)
                moves[label] = self._choices.sets.union(moves.get(label, below), below)
            known = self._projection[number] = self._choices.sets.of_moves(moves)
        return known

    def sentences(self, number: int) -> int:
        """What can be said along a set, in ``words``."""
        known = self._sentences.get(number)
        if known is None:
            known = NOTHING
            for _, _, entered, after in self.steps(number):
                said = self.words.before(entered, self.sentences(after))
                known = self.words.union(known, said)
            self._sentences[number] = known
        return known
