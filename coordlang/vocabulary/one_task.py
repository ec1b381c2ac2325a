# SPDX-License-Identifier: GPL-3.0-or-later
"""Words of one task by formulas of all pairs of its plans of which a mixture fails.

Clauses tell such plans apart pair by pair, round after round; a formula of the graph of all pairs
does it at once.  Two words are decided by how often plans change them
(`coordlang.vocabulary.two_words`), more by all warping paths (`coordlang.vocabulary.warped_pairs`).
Where these are too many, stutter-free words are looked for step by step: that finds few words, and
proves nothing of numbers of words.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import cached_property, partial
from itertools import chain
from math import inf

import numpy as np

from coordlang.required.choices import Choices
from coordlang.vocabulary.job import Assignment, Job
from coordlang.vocabulary.languages import Languages
from coordlang.vocabulary.loop import Budget, between, find
from coordlang.vocabulary.plan_pairs import PlanPairs
from coordlang.vocabulary.sat import Undecided
from coordlang.vocabulary.two_words import TwoWords
from coordlang.vocabulary.warped_pairs import (
    PairsApart,
    WarpedPairs,
    failing_pairs,
    joined_states,
    steps_apart,
)
from planners.joint.tables import Ints
from planners.system.limits import memory_left

#: Steps of mixtures of two plans that count as a conflict, and steps of formulas; each takes so
#: many bytes at most.
_PAIRS, _STEPS, _BYTES = 200, 100, 200
#: For each round of a budget so many steps of mixtures are looked at for two words, and so many
#: conflicts allowed: small formulas may need many.
_PAIRS_OF_ROUND, _FOR_TWO = 60_000, 40_000
#: Steps of mixtures that are looked at, in some ten seconds, for words that tell plans apart along
#: all warping paths, and step by step.
_FEW_PAIRS, _MOST_PAIRS = 1_200_000, 26_000_000
#: Steps of a formula of all warping paths, in some 20 seconds, and the part of them with which it
#: is made soon; conflicts for each round of a budget.
_MOST_STEPS, _SOON, _FOR_MORE = 11_000_000, 5, 3_000
#: Steps by which the plans are apart at most: more make larger graphs and refute hardly more.
_APART = 3
#: A solver has so many words more than it is asked for at first: larger sizes are asked for next.
_FURTHER = 2
#: Clauses of a formula of words that tell plans apart step by step, in some 20 seconds; that within
#: two steps after a mixture has failed, not one, where it has so many times less for one; and
#: what may be spent on each number for a unit of effort.
_MOST_CLAUSES, _SMALL, _IN_STEP = 20_000_000, 4, Budget(rounds=8, conflicts=2_000)


class OneTask:
    """The searches for words of one task that ask for all pairs of its plans at once.

    ``bounds`` gives the number of words proved to be needed and the number known to suffice,
    ``left`` the conflicts that may still be spent; ``holds`` says whether a partition is a
    language, ``report`` tells what is looked for.
    """

    def __init__(
        self,
        job: Job,
        languages: Languages,
        bounds: Callable[[], tuple[int, int]],
        left: Callable[[], int],
        holds: Callable[[dict[int, int]], bool],
        report: Callable[[str], None],
    ) -> None:
        (space,) = job.candidates.spaces
        self._states, self._clauses, self._seed = job.states, languages.clauses, job.seed
        self._bounds, self._left, self._holds, self._report = bounds, left, holds, report
        self._pairs = PlanPairs(Choices(space))
        self._two_words = TwoWords(self._pairs, self._states, self._clauses)
        #: Searches for stutter-free words, made one after another.
        self._in_step: list[PairsApart] = []
        self._next_in_step = self._more_in_step()

    @property
    def work(self) -> int:
        """What was done so far: the conflicts of the solvers, and what is counted as some."""
        work = self._two_words.conflicts + self._pairs.looked_at // _PAIRS
        return work + sum(made.conflicts + made.steps // _STEPS for made in self._formulas)

    @property
    def is_large(self) -> bool:
        """Whether it takes long to make the formula for more than two words."""
        return steps_apart(self._pairs.space, _MOST_STEPS // _SOON) < _APART

    @property
    def has_formula(self) -> bool:
        """Whether the formula for more than two words was made."""
        return self.__dict__.get("_apart") is not None

    def can_decide(self, size: int) -> bool:
        """Whether so many words have a formula; for more than two it is made."""
        return size == 2 or self._apart is not None

    def find(self, size: int, budget: Budget) -> dict[int, int] | None:
        """A language of so many words, None if there is none.

        Raises `Undecided` where the ``budget`` is not enough, or there is no formula.
        """
        rounds, left = budget.rounds, self._left()
        if size == 2:
            own = Budget(rounds, min(_FOR_TWO * rounds, left))
            room = self._room(_PAIRS_OF_ROUND * rounds, _PAIRS)
            return self._two_words.find(self._holds, own, room)
        if (apart := self._apart) is None:
            raise Undecided
        own = Budget(rounds, min(_FOR_MORE * rounds, left))
        return find(partial(apart.find, size, size + _FURTHER), self._holds, own)

    def in_step(self, effort: int) -> Iterator[Assignment]:
        """Languages of fewer and fewer stutter-free words, that tell all pairs apart step by step.

        From below, at most twice the number that was tried last: small ones are soon decided.
        """
        for search in chain(self._in_step[:], self._next_in_step):
            least, upper = self._bounds()
            most = 2 * least
            while least < upper and self._left():
                size = min(most, between(least, upper))
                self._report(f"trying {size} words that tell plans apart step by step")
                own = Budget(_IN_STEP.rounds, min(_IN_STEP.conflicts * effort, self._left()))
                room = min(4 * size, upper - 1)
                if search.number_of_clauses(room) > self._room(_MOST_CLAUSES, _STEPS):
                    room = size
                found = None
                with suppress(Undecided):
                    found = find(partial(search.find, size, room), self._holds, own)
                if found is None:
                    least, most = size + 1, 2 * size
                else:
                    yield found
                    _, upper = self._bounds()

    def close(self) -> None:
        """Give back what the solvers hold."""
        self._two_words.close()
        for formula in self._formulas:
            formula.close()

    @cached_property
    def _apart(self) -> PairsApart | None:
        """Partitions that tell pairs of plans apart along all warping paths; None for large tasks.

        Of the pairs that are soon looked at.
        """
        apart = min(_APART, steps_apart(self._pairs.space, self._room(_MOST_STEPS, _STEPS)))
        if apart < 1:
            return None
        self._pairs.grow(self._room(_FEW_PAIRS, _PAIRS))
        steps = WarpedPairs(self._pairs, apart).steps()
        return PairsApart(self._states, self._clauses, steps, np.random.default_rng(self._seed))

    @property
    def _formulas(self) -> list[PairsApart]:
        """Those made so far for more than two words."""
        apart = self.__dict__.get("_apart")
        return self._in_step if apart is None else [*self._in_step, apart]

    def _more_in_step(self) -> Iterator[PairsApart]:
        """Stutter-free words that tell pairs of plans apart: soon after one fails, then always."""
        self._report("looking at pairs of plans")
        if not self._pairs.complete(self._room(_MOST_PAIRS, _PAIRS)):
            return
        joined, most = joined_states(self._pairs.space), self._room(_MOST_CLAUSES, _STEPS)

        def tables() -> Iterator[Ints]:
            soon = failing_pairs(self._pairs, 1, most)
            yield soon if _SMALL * len(soon) > most else failing_pairs(self._pairs, 2, most)
            yield failing_pairs(self._pairs, inf, most)

        with suppress(Undecided):
            for steps in tables():
                search = PairsApart(self._states, self._clauses, steps, joined=joined)
                if search.number_of_clauses(2 * self._bounds()[0]) > most:
                    return
                self._in_step.append(search)
                yield search

    def _room(self, most: int, of_conflict: int) -> int:
        """Steps or clauses that may be made: at most so many, so many counted as a conflict."""
        return min(most, of_conflict * self._left(), memory_left() // _BYTES)
