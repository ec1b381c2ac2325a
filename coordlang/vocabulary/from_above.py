# SPDX-License-Identifier: GPL-3.0-or-later
"""Languages with fewer and fewer words, looked for in places where they are found soon.

Words that an abstraction of the states decides, words that go to words under symmetries, and in
large spaces local search.  **What is not found is no bound**: only a `Refutation` is.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from math import isqrt

from coordlang.vocabulary.abstract_words import AbstractSearch
from coordlang.vocabulary.equivariant import EquivariantSearch
from coordlang.vocabulary.job import Assignment, word_count
from coordlang.vocabulary.local_search import LocalSearch
from coordlang.vocabulary.merging import merged
from coordlang.vocabulary.refuter import Refuter
from planners.joint.tables import Ints

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
    seed
        Of what is drawn at random.
    """

    states: Sequence[int]
    refuter: Refuter
    abstractions: Sequence[Ints]
    seed: int


class SearchFromAbove:
    """All searches for languages that prove nothing, with effort that grows from call to call."""

    def __init__(self, start: Start, progress: Callable[[str], None] = lambda _: None) -> None:
        states, refuter, seed = start.states, start.refuter, start.seed
        self._start, self._progress = start, progress
        self._abstract = AbstractSearch(start.abstractions, states, refuter, seed)
        self._equivariant = EquivariantSearch(states, refuter, seed)
        self._local = LocalSearch(states, refuter, seed) if len(states) > LOCAL_FROM else None
        self._passes: dict[int, int] = {}

    def turn(self, lower: int, upper: int) -> Iterator[Assignment]:
        """Languages with fewer and fewer words, until the effort of this turn finds no more.

        Parameters
        ----------
        lower
            A number of words that is needed: fewer are not tried.
        upper
            A number of words that suffices.
        """
        start = self._start
        while lower < upper and (found := self._fewer(lower, upper)) is not None:
            yield found
            upper = word_count(found)
            if len(start.states) > LOCAL_FROM:  # small ones have no words to spare
                self._progress("merging words")
                for coarser in merged(found, start.states, start.refuter, start.seed):
                    yield coarser
                    upper = word_count(coarser)
            if upper == lower + 1:
                break  # the number that is left is mostly refuted before the next turn

    def _fewer(self, lower: int, upper: int) -> Assignment | None:
        """A language with fewer words than ``upper``; None if none is found."""
        # The number that is not refuted yet is tried last: mostly there is no such language.
        size = isqrt(min(lower + 1, upper - 1) * upper)
        while size < upper:
            found = self.find(size, symmetric=size > lower)
            if found is not None:
                return found
            size = (size + upper + 1) // 2
        return None

    def find(self, size: int, symmetric: bool) -> Assignment | None:
        """A language with at most ``size`` words, None if none was found with some effort.

        ``symmetric`` says whether symmetric words are looked for, abstractions apart.

        Abstractions are asked first, then those whose words are symmetric, then symmetric words.
        Local search goes on when it has done much less than these.
        """
        rounds = self._passes.get(size, _FIRST)
        self._passes[size] = 2 * rounds
        self._progress(f"words of abstract states: trying {size}")
        found = self._abstract.find(size)
        if found is None:
            self._progress(f"symmetric words of abstract states: trying {size}")
            found = self._equivariant.find(size, rounds, self._abstract.left(size))
        if found is None and symmetric:
            self._progress(f"symmetric words: trying {size}")
            found = self._equivariant.find(size, rounds)
        if found is None and self._local is not None:
            behind = self._local.rounds + _AHEAD <= self.rounds
            if behind or self._is_over(size):
                self._progress(f"local search: trying {size}")
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
