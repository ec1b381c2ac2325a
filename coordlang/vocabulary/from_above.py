# SPDX-License-Identifier: GPL-3.0-or-later
"""Languages with fewer and fewer words, looked for in places where they are found soon.

Words that an abstraction of the states decides, words that go to words under symmetries, and in
large spaces local search.  **What is not found is no bound**: only a `Refutation` is.

It is a conversation (`planners.pieces.conversation`): it may go on in a process of its own while
bounds are proved from below.
"""

from __future__ import annotations

from collections.abc import Generator, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from math import isqrt

import numpy as np

from coordlang.vocabulary.abstract_words import AbstractSearch
from coordlang.vocabulary.equivariant import EquivariantSearch
from coordlang.vocabulary.job import Assignment, word_count
from coordlang.vocabulary.local_search import LocalSearch
from coordlang.vocabulary.merging import merged
from coordlang.vocabulary.refuter import Refuter
from planners.tables import Ints

#: States from which on words are also looked for by local search.
LOCAL_FROM = 200
#: Refuted partitions that symmetric words may take the first time that a number of words is tried.
_FIRST = 500
#: Refuted partitions by which the other searches are ahead of local search.
_AHEAD = 6_000


@dataclass(frozen=True, slots=True)
class Start:
    """What is known where the search from above begins.

    Attributes
    ----------
    states
        Numbers of the states that need words.
    refuter
        Tells what is wrong with a partition; it is changed.
    abstractions
        (states) the abstract state of each state, of each abstraction.
    upper
        A number of words that suffices.
    seed
        Of what is drawn at random.
    """

    states: Sequence[int]
    refuter: Refuter
    abstractions: Sequence[Ints]
    upper: int
    seed: int


@dataclass(frozen=True, slots=True)
class Trying:
    """What the search does next, in words."""

    what: str


@dataclass(frozen=True, slots=True)
class Fewer:
    """A language with fewer words: (states) the word of each of `Start.states`."""

    words: Ints


@dataclass(frozen=True, slots=True)
class TurnOver:
    """Nothing is found any more with the effort of this turn; ``figures``: the work done so far."""

    figures: Mapping[str, float]


#: What the search answers; a turn ends with `TurnOver`.
Answer = Trying | Fewer | TurnOver


def from_above(start: Start, lowers: Iterator[int]) -> Generator[Answer]:
    """Languages with fewer and fewer words, turn by turn, each with more effort; a conversation.

    Parameters
    ----------
    start
        What is known.
    lowers
        For each turn a number of words that is needed: fewer are not tried.
    """
    upper = start.upper
    with closing(SearchFromAbove(start)) as search:
        for lower in lowers:
            while lower < upper and (fewer := (yield from _descend(search, start, lower, upper))):
                upper = fewer
                if upper == lower + 1:
                    break  # the number that is left is mostly refuted before the next turn
            yield TurnOver(search.figures())


def _descend(
    search: SearchFromAbove, start: Start, lower: int, upper: int
) -> Generator[Answer, None, int | None]:
    """Look for a language with fewer words than ``upper``; how many it has, None without one."""
    # The number that is not refuted yet is tried last: mostly there is no such language.
    size = isqrt(min(lower + 1, upper - 1) * upper)
    while size < upper:
        found = yield from search.find(size, symmetric=size > lower)
        if found is not None:
            return (yield from _with_merged_words(found, start))
        size = (size + upper + 1) // 2
    return None


def _with_merged_words(found: Assignment, start: Start) -> Generator[Answer, None, int]:
    """A language, and those with merged words, while it stays one; small ones have none to spare.

    How many words the last one has.
    """
    yield Fewer(_words(found, start))
    if len(start.states) > LOCAL_FROM:
        for fewer in merged(found, start.states, start.refuter, start.seed):
            found = fewer
            yield Trying("merging words")
            yield Fewer(_words(found, start))
    return word_count(found)


def _words(found: Assignment, start: Start) -> Ints:
    return np.array([found[state] for state in start.states])


class SearchFromAbove:
    """All searches for languages that prove nothing, with effort that grows from call to call."""

    def __init__(self, start: Start) -> None:
        states, refuter, seed = start.states, start.refuter, start.seed
        self._abstract = AbstractSearch(start.abstractions, states, refuter, seed)
        self._equivariant = EquivariantSearch(states, refuter, seed)
        self._local = LocalSearch(states, refuter, seed) if len(states) > LOCAL_FROM else None
        self._passes: dict[int, int] = {}

    def find(self, size: int, symmetric: bool) -> Generator[Trying, None, Assignment | None]:
        """A language with at most ``size`` words, None if none was found with some effort.

        ``symmetric`` says whether symmetric words are looked for, abstractions apart.

        Abstractions are asked first, then those whose words are symmetric, then symmetric words.
        Local search goes on when it has done much less than these.
        """
        rounds = self._passes.get(size, _FIRST)
        self._passes[size] = 2 * rounds
        yield Trying(f"words of abstract states: trying {size}")
        found = self._abstract.find(size)
        if found is None:
            yield Trying(f"symmetric words of abstract states: trying {size}")
            found = self._equivariant.find(size, rounds, self._abstract.left(size))
        if found is None and symmetric:
            yield Trying(f"symmetric words: trying {size}")
            found = self._equivariant.find(size, rounds)
        if found is None and self._local is not None:
            behind = self._local.rounds + _AHEAD <= self.rounds
            if behind or self._is_over(size):
                yield Trying(f"local search: trying {size}")
                found = self._local.find(size, self._equivariant.undecided(size))
        return found

    @property
    def rounds(self) -> int:
        """Refuted partitions, local search apart."""
        return self._abstract.rounds + self._equivariant.rounds

    def _is_over(self, size: int) -> bool:
        """Whether neither abstractions nor symmetries leave words to look at."""
        return not self._abstract.left(size) and not self._equivariant.undecided(size)

    def figures(self) -> dict[str, float]:
        """The work done."""
        figures: dict[str, float] = {
            "abstract_rounds": self._abstract.rounds,
            "equivariant_rounds": self._equivariant.rounds,
        }
        if self._local is not None:
            figures |= {"local_rounds": self._local.rounds, "local_moves": self._local.moves}
        return figures

    def close(self) -> None:
        """Give back what the solvers hold."""
        self._abstract.close()
        self._equivariant.close()
