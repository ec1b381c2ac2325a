# SPDX-License-Identifier: GPL-3.0-or-later
"""Overlapping words: a state may have several words, a plan several sentences.

The speaker chooses among them.

``words[s]`` is the set of words of state s, never empty.  A *reading* of a plan takes one of the
words of each of its states; repeated neighbours are collapsed, and what remains is a sentence of
the plan.  ``P(S)`` are the optimal plans of the task that have the sentence S.  S is *usable* for
the task if ``P(S)`` is RC-free.  The words are a coordination language iff every optimal plan of
every candidate task has a usable sentence (the paper's general definition; with one word for each
state it is the one for partitions).  A speaker says a usable sentence of his plan that leaves most
plans open, so a task's flexibility is ``E = (1/N) sum over plans x of max { |P(S)| : S usable, S a
sentence of x }``.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from planners.errors import OutOfMemory
from planners.search.plan_space import PlanSpace

#: State number -> its words.
Overlap = Mapping[int, frozenset[int]]
Sentence = tuple[int, ...]

#: Different sets of sentences that the plans from one node may have.
_MOST_SETS = 20_000
#: Sentences that one plan may have.
_MOST_SENTENCES = 2_000


class TooManySentences(OutOfMemory):
    """Words overlap so much that the sentences of a task are too many to hold."""

    def __init__(self, what: str) -> None:
        super().__init__(
            what, remedy="Give states fewer further words, or build without --overlap."
        )


def readings(states: Sequence[int], words: Overlap) -> frozenset[Sentence]:
    """The sentences of a plan through these states."""
    found: set[Sentence] = {(word,) for word in words[states[-1]]}
    for state in reversed(states[:-1]):
        found = _longer(found, words[state])
    return frozenset(found)


def _longer(sentences: Iterable[Sentence], words: Iterable[int]) -> set[Sentence]:
    """A state with these words in front."""
    here = tuple(words)
    found = {s if s[0] == word else (word, *s) for s in sentences for word in here}
    if len(found) > _MOST_SENTENCES:
        raise TooManySentences(f"a plan has more than {_MOST_SENTENCES:,} sentences")
    return found


class Readings:
    """The sentences of all plans from every node of a plan space.

    ``classes[node]`` counts the plans from the node by the set of their sentences; sets are
    numbers, see `sentences`. Computed backward over the plan graph, one pass for all tasks.  Plans
    with one set of sentences are never told apart, so there are few classes however many plans
    there are.
    """

    def __init__(self, space: PlanSpace, words: Overlap) -> None:
        self._space = space
        self._successors = [space.successors(node) for node in range(len(space))]
        self._sets: list[frozenset[Sentence]] = []
        self._number: dict[frozenset[Sentence], int] = {}
        self._before: dict[tuple[int, frozenset[int]], int] = {}
        self._state = space.state.tolist()
        self.classes: list[dict[int, int]] = [{} for _ in range(len(space))]
        self.update(range(len(space)), words)

    def sentences(self, number: int) -> frozenset[Sentence]:
        """The set of sentences with a number."""
        return self._sets[number]

    def update(self, nodes: Iterable[int], words: Overlap) -> None:
        """Read these nodes anew, in the order of their numbers.

        `TooManySentences` leaves some of them as they were.
        """
        for node in nodes:
            self.classes[node] = self._read(node, words[self._state[node]])

    def _read(self, node: int, words: frozenset[int]) -> dict[int, int]:
        successors = self._successors[node]
        if not successors:
            return {self._intern(frozenset((word,) for word in words)): 1}
        total: dict[int, int] = {}
        for below in successors:
            for number, plans in self.classes[below].items():
                here = self._before.get((number, words))
                if here is None:
                    here = self._intern(frozenset(_longer(self._sets[number], words)))
                    self._before[number, words] = here
                total[here] = total.get(here, 0) + plans
        if len(total) > _MOST_SETS:
            raise TooManySentences(
                f"the plans of a task have more than {_MOST_SETS:,} sets of sentences"
            )
        return total

    def _intern(self, sentences: frozenset[Sentence]) -> int:
        number = self._number.setdefault(sentences, len(self._sets))
        if number == len(self._sets):
            self._sets.append(sentences)
        return number

    def plans(self, node: int) -> dict[Sentence, int]:
        """``|P(S)|`` for every sentence S of the plans from a node; exact."""
        number: dict[Sentence, int] = {}
        for read, plans in self.classes[node].items():
            for sentence in self._sets[read]:
                number[sentence] = number.get(sentence, 0) + plans
        return number

    def expected(self, node: int) -> float:
        """E of a task from the node that does not require coordination.

        All its sentences are usable.
        """
        plans = self.plans(node)
        classes = self.classes[node].items()
        open_plans = sum(count * max(plans[s] for s in self._sets[read]) for read, count in classes)
        return open_plans / sum(count for _, count in classes)
