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
#: Refuted partitions by which abstractions are ahead of the other searches.
_AHEAD = 3_000


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
        self._equivariant = EquivariantSearch(states, refuter)
        self._local = LocalSearch(states, refuter, seed) if len(states) > LOCAL_FROM else None

    def find(self, size: int, progress: Callable[[str], None]) -> Assignment | None:
        """A language with at most ``size`` words, None if none was found with some effort.

        Abstractions are asked first.  The others go on when they have done much less than these.
        """
        progress(f"words of abstract states: trying {size}")
        found = self._abstract.find(size)
        spent = self._abstract.rounds
        over = self._abstract.is_over(size)
        if found is None and (over or self._equivariant.rounds + _AHEAD <= spent):
            progress(f"symmetric words: trying {size}")
            found = self._equivariant.find(size)
        if found is None and self._local and (over or self._local.rounds + _AHEAD <= spent):
            progress(f"local search: trying {size}")
            found = self._local.find(size, self._equivariant.undecided(size))
        return found

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
