# SPDX-License-Identifier: GPL-3.0-or-later
"""Local search over partitions into a given number of words: simulated annealing.

A move gives one state another word, or one word to all states that a symmetry takes it to.  What is
minimised is how many plans sentences rule out (`coordlang.vocabulary.flexible`), or how often
robots fail (`coordlang.vocabulary.few_words`).  Necessary clauses may be constraints: a partition
may violate some on the way, at a price.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from math import log
from random import Random

import numpy as np

from coordlang.language.warping import Clause
from coordlang.required.plan_table import PlanTable
from coordlang.vocabulary.job import Job
from planners.joint.tables import Floats, Ints

#: Share of the moves that change the words of an orbit.
_ORBITS = 0.2
#: Moves of the first cooling for each pair of a state and a word.
_MOVES = 10
#: Heat at the start and at the end of a cooling, and the price of a violated clause at the start,
#: in units of what the last moves cost on average.
_HOT, _COLD, _PRICE, _LAST = 0.3, 0.01, 0.5, 100
#: The price rises by this factor after a move to a partition that violates clauses, and else falls.
_DEARER = 1.004
#: Moves of the first cooling at least, and coolings that find nothing better after which the search
#: ends; one that does is followed by one longer by half.
_LEAST_MOVES, _PATIENCE = 1_000, 3
#: Values that are equal but for rounding.
_EQUAL = 1e-9
#: Plans measured before the search ends, whatever it still finds, and what a move counts as.
WORK, _MOVE = 60_000_000, 2_000


class LocalSearch(ABC):
    """A partition of a job's states into ``words`` words, two or more, on its way.

    A subclass says what is minimised, and what becomes of the partitions that are found.  It sets
    the ``table`` of plans by which partitions are measured; ``best`` and ``best_word``, the value
    of the best partition so far, by which a cooling pays or not, and the word of each state in it,
    from which the next one begins; perhaps ``clauses``, what must be separated, a list that only
    grows; and ``norm``: minimised is this norm of the values of all tasks, 1 for their sum, more
    for the worst.  ``moves`` counts the moves so far.
    """

    table: PlanTable
    best: float
    best_word: Ints
    clauses: Sequence[Clause] = ()
    norm = 1

    def __init__(self, job: Job, words: int) -> None:
        self._job, self._words, self._random = job, words, Random(job.seed)
        self.moves = 0

    @abstractmethod
    def values(self, word: Ints, tasks: Ints) -> Floats:
        """The value of some tasks, 0 or more, under the word of each state."""

    @abstractmethod
    def offer(self, word: Ints, values: Floats) -> None:
        """Look at a partition that violates no clause; it may turn out to violate new ones."""

    @abstractmethod
    def settle(self) -> bool:
        """Decide after a cooling which partition is the best; whether none can be better."""

    def anneal(self, word: Ints, permutations: Sequence[Sequence[int]], work: int) -> None:
        """Cool again and again, first from these words, until that does not pay any more.

        ``permutations`` are where symmetries take each state; ``work`` plans may be measured.
        """
        self._permutations, self._most, self._work = permutations, work, 0
        self._tasks_of_state = self.table.tasks_of_state
        self._movable = [state for state in self._job.states if len(self._tasks_of_state[state])]
        #: The pairs of states of all clauses, one after another, and the first of each clause.
        self._pairs, self._first = np.zeros((0, 2), np.int64), np.zeros(0, np.int64)
        self._unit, self._price, in_vain = 0.0, _PRICE, 0
        moves = max(_LEAST_MOVES, _MOVES * len(self._movable) * self._words)
        while in_vain < _PATIENCE and self._work < self._most and self._movable:
            self._word, self._values = word, self._valued(word, np.arange(len(self.table)))
            self._energy = self._norm(self._values)
            self._violated = self._learn_clauses()
            before = self.best
            self._cool(moves)
            if self.settle():
                return
            word, in_vain = self.best_word, in_vain + 1
            if self.best < before - _EQUAL:
                moves, in_vain = moves + moves // 2, 0

    def _cool(self, moves: int) -> None:
        for number in range(moves):
            if self._work >= self._most:
                return
            self._move(_HOT * (_COLD / _HOT) ** (number / moves))
            self._price *= _DEARER if self._violated else 1 / _DEARER
            if number % 50 == 0:
                self._job.progress(f"annealing: {number:,} of {moves:,} moves")

    def _move(self, heat: float) -> None:
        """Try a random change, and keep it if its energy and the price of its clauses allow."""
        self.moves += 1
        states, word = self._changed()
        violated = self._violated_by(word)
        # So bad it may become (Metropolis); some of that is the price of violated clauses.
        worse = -heat * log(1 - self._random.random())
        worse -= self._price * (violated - self._violated)
        most = self._energy + self._unit * worse
        if most < 0:
            return
        tasks = np.unique(np.concatenate([self._tasks_of_state[state] for state in states]))
        values = self._values.copy()
        values[tasks] = self._valued(word, tasks)
        energy = self._norm(values)
        self._unit += (abs(energy - self._energy) - self._unit) / min(self.moves, _LAST)
        if energy <= most:
            self._word, self._values, self._energy = word, values, energy
            self._violated = violated
            if not violated:
                self.offer(word, values)
                self._violated = self._learn_clauses()

    def _changed(self) -> tuple[list[int], Ints]:
        """States that get another word, and all words then.

        One state, or those that a symmetry takes it to.
        """
        states = [self._random.choice(self._movable)]
        other = self._random.randrange(self._words - 1)
        other += other >= self._word[states[0]]
        if self._permutations and self._random.random() < _ORBITS:
            to = self._random.choice(self._permutations)
            while (image := to[states[-1]]) != states[0]:
                states.append(image)
        word = self._word.copy()
        word[states] = other
        return states, word

    def _learn_clauses(self) -> int:
        """Know the clauses that are new; how many of all are violated."""
        if new := [sorted(clause) for clause in self.clauses[len(self._first) :]]:
            sizes = np.array(list(map(len, new)))
            first = len(self._pairs) + np.cumsum(sizes) - sizes
            self._first = np.concatenate((self._first, first))
            self._pairs = np.concatenate((self._pairs, *map(np.array, new)))
        return self._violated_by(self._word)

    def _violated_by(self, word: Ints) -> int:
        """How many clauses have no pair of states in different words."""
        first, second = word[self._pairs].T
        separated = np.logical_or.reduceat(first != second, self._first)
        return len(self._first) - int(separated.sum())

    def _valued(self, word: Ints, tasks: Ints) -> Floats:
        self._work += _MOVE + int(self.table.plans[tasks].sum())
        return self.values(word, tasks)

    def _norm(self, values: Floats) -> float:
        return float(np.linalg.norm(values, self.norm))
