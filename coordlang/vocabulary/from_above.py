# SPDX-License-Identifier: GPL-3.0-or-later
"""Languages with fewer words, looked for in places where they are found soon.

Words that an abstraction of the states decides, words that go to words under symmetries, and in
large spaces local search.  **What is not found is no bound**: only a `Refutation` is.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from coordlang.vocabulary.abstract_words import AbstractSearch
from coordlang.vocabulary.equivariant import EquivariantSearch
from coordlang.vocabulary.job import Assignment
from coordlang.vocabulary.local_search import LocalSearch
from coordlang.vocabulary.refuter import Refuter
from planners.tables import Ints

#: States from which on words are also looked for by local search.
LOCAL_FROM = 200
#: Refuted partitions that symmetric words may take the first time that a number of words is tried.
_FIRST = 500
#: Refuted partitions by which the other searches are ahead of local search.
_AHEAD = 6_000


class SearchFromAbove:
    """All searches for languages that prove nothing, with effort that grows from call to call.

    Parameters
    ----------
    states
        Numbers of the states that need words.
    refuter
        Tells what is wrong with a partition.
    abstractions
        (states) the abstract state of each state, of each abstraction.
    seed
        Of what is drawn at random.
    """

    def __init__(
        self, states: Sequence[int], refuter: Refuter, abstractions: Sequence[Ints], seed: int
    ) -> None:
        self._abstract = AbstractSearch(abstractions, states, refuter, seed)
        self._equivariant = EquivariantSearch(states, refuter, seed)
        self._local = LocalSearch(states, refuter, seed) if len(states) > LOCAL_FROM else None
        self._passes: dict[int, int] = {}

    def find(self, size: int, progress: Callable[[str], None]) -> Assignment | None:
        """A language with at most ``size`` words, None if none was found with some effort.

        Abstractions are asked first, then symmetric words.  Local search goes on when it has done
        much less than these.
        """
        progress(f"words of abstract states: trying {size}")
        found = self._abstract.find(size)
        if found is None:
            progress(f"symmetric words: trying {size}")
            rounds = self._passes.get(size, _FIRST)
            self._passes[size] = 2 * rounds
            found = self._equivariant.find(size, rounds)
        if found is None and self._local is not None:
            behind = self._local.rounds + _AHEAD <= self.rounds
            if behind or self._is_over(size):
                progress(f"local search: trying {size}")
                found = self._local.find(size, self._equivariant.undecided(size))
        return found

    @property
    def rounds(self) -> int:
        """Refuted partitions, local search apart."""
        return self._abstract.rounds + self._equivariant.rounds

    def _is_over(self, size: int) -> bool:
        """Whether neither abstractions nor symmetries leave words to look at."""
        return self._abstract.is_over(size) and not self._equivariant.undecided(size)

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
