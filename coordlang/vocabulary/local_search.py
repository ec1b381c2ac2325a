# SPDX-License-Identifier: GPL-3.0-or-later
"""Languages by local search: tabu search on violated clauses, over equivariant partitions.

For spaces in which a solver finds no partition any more.  A partition that violates no known clause
is refuted by failing plans that it does not tell apart, whose clauses are added, until it is a
language.  Kinds of partitions (`coordlang.vocabulary.orbit_words`) race: those in which the search
gets far go on with more moves.  **What is not found proves nothing about numbers of words.**
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from coordlang.symmetry.subgroups import WordAction, group_table
from coordlang.vocabulary.clause_table import ClauseTable
from coordlang.vocabulary.job import Assignment
from coordlang.vocabulary.orbit_words import OrbitWords
from coordlang.vocabulary.recent_tuples import RecentTuples
from coordlang.vocabulary.refuter import Refuter
from coordlang.vocabulary.tabu import TabuSearch
from planners.joint.tables import Ints

#: Kinds that race at most, evenly over those that there are: the first heat must not take long.
_KINDS = 64
#: Kinds that are left when the others have been outrun, and searches that are kept in memory.
_LEAST_KINDS, _KEPT = 3, 24
#: The share of the orbits that are changed where the search is stuck.
_SHAKEN = 0.1
#: Failing tuples after which longer ones are not looked for, and clauses that are taken of them.
_ENOUGH, _AT_ONCE = 500, 300


@dataclass(frozen=True, slots=True)
class Effort:
    """What a kind may spend: moves without a partition that violates no clause, refutations."""

    moves: int = 200
    rounds: int = 10

    def raised(self) -> Effort:
        """What a kind that got far may spend next."""
        return Effort(2 * self.moves, 4 * self.rounds)


class _Race:
    """The kinds of partitions into some number of words that are still looked at."""

    def __init__(self, runners: list[_Runner]) -> None:
        self.runners = runners
        self.effort = Effort()

    def next_heat(self) -> None:
        """A quarter, those that got farthest with the fewest moves, go on with more effort."""
        self.runners.sort(key=_Runner.lag)
        self.runners = self.runners[: max(_LEAST_KINDS, len(self.runners) // 4)]
        self.effort = self.effort.raised()


class LocalSearch:
    """Looks for languages by tabu search; deterministic for a seed.

    Parameters
    ----------
    states
        Numbers of the states that need words.
    refuter
        Tells what is wrong with a partition.
    seed
        Of what is drawn at random.

    Attributes
    ----------
    rounds, moves
        Refuted partitions, and changes of an orbit's words.
    """

    def __init__(self, states: Sequence[int], refuter: Refuter, seed: int) -> None:
        self._states, self._refuter, self._seed = states, refuter, seed
        self._races: dict[int, _Race] = {}
        self.rounds = self.moves = 0

    def find(self, size: int, actions: Sequence[WordAction]) -> Assignment | None:
        """A language with at most ``size`` words, None if none was found with some effort.

        The next call with this size goes on with the kinds that got farthest.

        Parameters
        ----------
        size
            The number of words.
        actions
            The kinds of partitions that are looked at, besides all partitions; some of many.
        """
        race = self._races.get(size)
        if race is None:
            race = self._races[size] = _Race(list(self._runners(size, actions)))
        kept: list[_Runner] = []
        for runner in race.runners:
            word = runner.run(race.effort)
            self.rounds += runner.rounds
            self.moves += runner.moves
            if word is not None:
                return {state: int(word[state]) for state in self._states}
            kept = _keep_the_farthest([*kept, runner])
        race.next_heat()
        return None

    def _runners(self, size: int, actions: Sequence[WordAction]) -> Iterator[_Runner]:
        group = group_table(self._refuter.pool.images)
        some = actions[:: -(-len(actions) // _KINDS) or 1]
        for action in (*some, WordAction({0: tuple(range(size))})):
            kind = OrbitWords.of(self._states, group, action, size)
            if kind is not None:
                images = group.right_cosets(frozenset(action.words))
                yield _Runner(self._refuter, kind, images, self._seed)


def _keep_the_farthest(runners: list[_Runner]) -> list[_Runner]:
    """Only so many runners go on where they are: the others will begin again."""
    runners.sort(key=_Runner.lag)
    for runner in runners[_KEPT:]:
        runner.forget()
    return runners[:_KEPT]


class _Runner:
    """The search in one kind of partition.

    Attributes
    ----------
    depth
        The partitions that violated no clause in the last run.
    rounds, moves
        The partitions that were refuted in it, and the changes.
    """

    def __init__(
        self, refuter: Refuter, kind: OrbitWords, images: Sequence[Ints], seed: int
    ) -> None:
        self._refuter, self._kind, self._images = refuter, kind, images
        self._random = np.random.default_rng(seed)
        self._search: TabuSearch | None = None
        self._table, self._recent = ClauseTable(kind, images), RecentTuples(refuter, _ENOUGH)
        self.depth = self.rounds = self.moves = 0

    def lag(self) -> tuple[int, int]:
        """By which runners are compared: the least is that of the one that got farthest."""
        return -self.depth, self.moves

    def forget(self) -> None:
        """Give back what the search holds: it will begin again."""
        self._search = None
        self._table = ClauseTable(self._kind, self._images)
        self._recent = RecentTuples(self._refuter, _ENOUGH)

    def run(self, effort: Effort) -> Ints | None:
        """The words of a language, None if none was found with an effort."""
        if self._search is None:
            choice = self._kind.random_choice(self._random)
            self._search = TabuSearch(self._table, choice, self._random)
        search, pool = self._search, self._refuter.pool
        before, self.rounds, self.depth = search.moves, 0, 0
        while self.rounds < effort.rounds:
            agreeing = self._recent.agreeing(search.word, self._images)
            if not agreeing:
                return search.word
            self.rounds += 1
            self._table.add(pool.codes(search.word, agreeing, _AT_ONCE, self._random))
            search.count()
            if search.run(effort.moves):
                self._shake(search)
                break
            self.depth += 1
        self.moves = search.moves - before
        return None

    def _shake(self, search: TabuSearch) -> None:
        """Change some of the words at random."""
        drawn = self._kind.random_choice(self._random)
        changed = self._random.random(len(drawn)) < _SHAKEN
        search.begin(np.where(changed, drawn, search.choice))
