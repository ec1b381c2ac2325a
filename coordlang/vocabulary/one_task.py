# SPDX-License-Identifier: GPL-3.0-or-later
"""Words of one task by formulas of all pairs of its plans of which a mixture fails.

Clauses tell such plans apart pair by pair, round after round; a formula of the graph of all pairs
does it at once.  More than two words are decided by all warping paths
(`coordlang.vocabulary.warped_pairs`).  Where these are too many, stutter-free words are looked for
step by step: that finds few words, and proves nothing of numbers of words.

Two words are decided by how often plans change them: a sentence is no more than its first word and
a number of changes, so two plans of which a mixture fails must differ in that number (Proposition
30 of docs/concepts.md).  Clauses say the same in far more rounds: they are the pigeonhole
principle.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence
from contextlib import suppress
from functools import cached_property, partial
from itertools import chain, product
from math import inf
from typing import TYPE_CHECKING

import numpy as np

from coordlang.language.warping import Clause, pair
from coordlang.required.choices import Choices
from coordlang.vocabulary.job import Assignment, Job
from coordlang.vocabulary.languages import Languages
from coordlang.vocabulary.loop import Budget, between, find
from coordlang.vocabulary.plan_pairs import FAILED, PlanPairs
from coordlang.vocabulary.sat import PartitionProblem, Undecided
from coordlang.vocabulary.warped_pairs import (
    PairsApart,
    WarpedPairs,
    failing_pairs,
    joined_states,
    steps_apart,
)
from planners.joint.tables import Ints
from planners.system.limits import memory_left

if TYPE_CHECKING:
    from coordlang.vocabulary.minimal import MinimalSearch

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

    ``search`` has the bounds on the number of words, and says what may still be spent.
    """

    def __init__(self, job: Job, languages: Languages, search: MinimalSearch) -> None:
        (space,) = job.candidates.spaces
        self._states, self._clauses, self._seed = job.states, languages.clauses, job.seed
        self._search = search
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
        rounds, left, conflicts = budget.rounds, self._search.left(), _FOR_MORE
        if size == 2:
            room, conflicts = self._room(_PAIRS_OF_ROUND * rounds, _PAIRS), _FOR_TWO
            partition = partial(self._two_words.find, room)
        elif (apart := self._apart) is not None:
            partition = partial(apart.find, size, size + _FURTHER)
        else:
            raise Undecided
        return find(partition, self._search.holds, Budget(rounds, min(conflicts * rounds, left)))

    def in_step(self, effort: int) -> Iterator[Assignment]:
        """Languages of fewer and fewer stutter-free words, that tell all pairs apart step by step.

        From below, at most twice the number that was tried last: small ones are soon decided.
        """
        for search in chain(self._in_step[:], self._next_in_step):
            least = self._search.lower
            most = 2 * least
            while least < (upper := self._search.upper) and (left := self._search.left()):
                size = min(most, between(least, upper))
                self._search.report(f"trying {size} words that tell plans apart step by step")
                own = Budget(_IN_STEP.rounds, min(_IN_STEP.conflicts * effort, left))
                room = min(4 * size, upper - 1)
                if search.number_of_clauses(room) > self._room(_MOST_CLAUSES, _STEPS):
                    room = size
                found = None
                with suppress(Undecided):
                    found = find(partial(search.find, size, room), self._search.holds, own)
                if found is None:
                    least, most = size + 1, 2 * size
                else:
                    yield found

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
        self._search.report("looking at pairs of plans")
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
                if search.number_of_clauses(2 * self._search.lower) > most:
                    return
                self._in_step.append(search)
                yield search

    def _room(self, most: int, of_conflict: int) -> int:
        """Steps or clauses that may be made: at most so many, so many counted as a conflict."""
        return min(most, of_conflict * self._search.left(), memory_left() // _BYTES)


# ---- two words

#: Steps of mixtures that are looked at first, and how many times as many then: few of the pairs of
#: plans often suffice for a proof.
_FIRST, _MORE = 100_000, 5


class TwoWords:
    """The search for a language of two words; a call goes on where the last one stopped.

    ``states`` need words, ``clauses`` are satisfied by every language: a list that only grows.
    ``conflicts`` are those of the solvers so far.
    """

    def __init__(self, pairs: PlanPairs, states: Sequence[int], clauses: Sequence[Clause]) -> None:
        self._pairs, self._states, self._clauses = pairs, states, clauses
        self._formula: _Changes | None = None
        #: Whether the formula is of all pairs, and how many pairs of edges it is of.
        self._is_complete, self._known = False, 0
        #: Whether it has left a partition that more pairs may refute.
        self._is_answered = False
        self.conflicts = 0

    def find(self, most: int, conflicts: int) -> dict[int, int] | None:
        """A partition, None if there is none; the next one if it was refuted.

        ``most`` limits the pairs of edges that are looked at in all, ``conflicts`` those of the
        solver.  Raises `Undecided` where that is not enough.
        """
        if self._formula is None or (self._is_answered and not self._is_complete):
            self.close()
            wanted = max(_FIRST, _MORE * self._known)
            if wanted > most:
                raise Undecided
            self._is_complete, self._known = self._pairs.grow(wanted), self._pairs.looked_at
            self._formula, self._is_answered = _Changes(self._states, self._pairs), False
        self._formula.require(self._clauses)
        before = self._formula.conflicts
        try:
            found = self._formula.solve(conflicts)
        finally:
            self.conflicts += self._formula.conflicts - before
        self._is_answered = True
        return found

    def close(self) -> None:
        """Give back what the solver holds."""
        if self._formula is not None:
            self._formula.close()
        self._formula = None


class _Changes(PartitionProblem):
    """Partitions into two words; of two plans that fail one changes its word more often.

    Further variables: two plans are in a place, and the first one has changed its word so many
    times more often; plans from a node can change it so many times.
    """

    def __init__(self, states: Sequence[int], pairs: PlanPairs) -> None:
        super().__init__(states, 2)
        self._space, self._true = pairs.space, self._new()
        self._solver.add_clause([self._true])
        self._add_mixtures(pairs)

    def _add_mixtures(self, pairs: PlanPairs) -> None:
        """Two plans from place to place, and by how much more often the first one changes."""
        layer, nodes = self._space.layer, dict[int, tuple[int, int]]()
        ahead: dict[object, dict[int, int]] = defaultdict(lambda: defaultdict(self._new))
        failed = set[tuple[int, int]]()
        steps = pairs.steps
        for before, *two, end in steps[np.argsort(-layer[steps[:, 1]], kind="stable")].tolist():
            if before < len(self._space):
                nodes[before], ahead[before] = (before, before), {0: self._true}
            both = nodes[end] = (two[0], two[1])
            if end == FAILED:
                failed.add(both)
            after = ahead[both if end == FAILED else end]
            mine, theirs = map(self._steps, nodes[before], both)
            for (one, first), (other, second) in product(mine, theirs):
                for number, variable in ahead[before].items():
                    now = after[number + first - second]
                    self._solver.add_clause([-variable, -one, -other, now])
        self._forbid_equal({both: ahead[both] for both in sorted(failed)})

    def _forbid_equal(self, ahead: dict[tuple[int, int], dict[int, int]]) -> None:
        """From where some mixture has failed plans do not change so often that numbers are equal.

        ``ahead``: for the nodes of two plans by how much more often the first one has changed.
        """
        can = self._numbers_of_changes(np.unique(np.array([*ahead], np.int64)))
        for (one, other), more in ahead.items():
            for number, variable in more.items():
                for mine, own in can[one].items():
                    if (theirs := can[other].get(mine + number)) is not None:
                        self._solver.add_clause([-variable, -own, -theirs])

    def _numbers_of_changes(self, nodes: Ints) -> dict[int, dict[int, int]]:
        """For each node below, how often plans can change their word from there."""
        can: dict[int, dict[int, int]] = {}
        for node in np.flatnonzero(self._space.descendants(nodes)).tolist():
            targets = sorted(set(self._space.successors(node)))
            own = can[node] = defaultdict(self._new) if targets else {0: self._true}
            for target in targets:
                for literal, changes in self._steps(node, target):
                    for number, below in can[target].items():
                        self._solver.add_clause([-literal, -below, own[number + changes]])
        return can

    def _steps(self, node: int, target: int) -> list[tuple[int, int]]:
        """Literals, and how often a step to another node changes the word where they are true."""
        one, other = self._space.state[[node, target]].tolist()
        if one == other:
            return [(self._true, 0)]
        differ = self._is_separated(pair(one, other))
        return [(differ, 1), (-differ, 0)]
