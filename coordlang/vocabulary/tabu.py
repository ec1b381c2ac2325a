# SPDX-License-Identifier: GPL-3.0-or-later
"""Tabu search for a partition that violates none of some clauses.

As for graph colouring (Hertz, de Werra 1987): an orbit of states that is in a violated clause takes
the words that leave the fewest clauses violated, though it be more than before, and does not go
back for a while.
"""

from __future__ import annotations

import numpy as np

from coordlang.vocabulary.clause_table import ClauseTable
from planners.joint.tables import Ints

#: Moves for which a word is tabu: at least one, at random so many more ..
_TENURE = 10
#: .. and besides such a share of the violated clauses, of which so many count at most.
_SHARE, _COUNTED = 0.6, 100
#: More violated clauses than there are.
_MANY = 10**9


class TabuSearch:
    """A partition of one kind that is changed orbit by orbit.

    Parameters
    ----------
    table
        The clauses.
    choice
        (orbits) the choice to begin with.
    random
        Decides between changes that are equally good.

    Attributes
    ----------
    choice, word
        The choice (orbits), and the word of each state number.
    moves
        Changes so far.
    """

    def __init__(self, table: ClauseTable, choice: Ints, random: np.random.Generator) -> None:
        self._table, self._kind, self._random = table, table.kind, random
        self.moves = 0
        self._tabu_until = np.zeros((len(choice), self._kind.size), np.int64)
        self.begin(choice)

    def begin(self, choice: Ints) -> None:
        """Go on from another choice."""
        self.choice, self.word = choice.copy(), self._kind.partition(choice)
        self.count()

    def count(self) -> None:
        """Look at all clauses: some were added."""
        self._separated = self._table.separated(self.word)

    @property
    def violated(self) -> Ints:
        """The numbers of the violated clauses."""
        return np.flatnonzero(self._separated == 0)

    def run(self, moves: int) -> int:
        """Change words until no clause is violated, or so many times.

        Returns the fewest violated clauses that were met; the partition is the first with so few.
        """
        best, fewest = self.choice.copy(), _MANY
        end = self.moves + moves
        while True:
            violated = self.violated
            if len(violated) < fewest:
                best, fewest = self.choice.copy(), len(violated)
            if not len(violated) or self.moves >= end:
                break
            self.moves += 1
            if not self._move(violated, fewest):
                break
        if fewest:
            self.begin(best)
        return fewest

    def violations(self, orbit: int) -> Ints:
        """How many clauses with a state of an orbit are violated under each of its choices."""
        table, members, words = self._table, self._kind.members[orbit], self._kind.words[orbit]
        clauses = table.clauses_of[orbit]
        # In the others some pair without a state of the orbit is separated, whatever it takes.
        clauses = clauses[self._separated[clauses] <= table.pairs_of[orbit]]
        changed = np.repeat(self.word[np.newaxis], len(words), axis=0)
        changed[:, members] = words
        apart = changed[:, table.first[clauses]] != changed[:, table.second[clauses]]
        violated: Ints = len(clauses) - apart.any(axis=2).sum(axis=1)
        return violated

    def _move(self, violated: Ints, fewest: int) -> bool:
        """Make the best change that is not tabu; False if nothing can be changed."""
        changes = self._best_changes(violated, fewest)
        if not changes:
            return False
        orbit, choice = changes[int(self._random.integers(len(changes)))]
        tenure = 1 + int(self._random.integers(_TENURE))
        tenure += int(_SHARE * min(len(violated), _COUNTED))
        self._tabu_until[orbit, self.choice[orbit]] = self.moves + tenure
        self.choice[orbit] = choice
        self.word[self._kind.members[orbit]] = self._kind.words[orbit][choice]
        clauses = self._table.clauses_of[orbit]
        self._separated[clauses] = self._table.separated(self.word, clauses)
        return True

    def _best_changes(self, violated: Ints, fewest: int) -> list[tuple[int, int]]:
        """The changes of an orbit in a violated clause with the fewest violated clauses after it.

        What is tabu counts only where it is better than all before, or if there is nothing else.
        """
        clause = violated[self._random.integers(len(violated))]
        states = np.concatenate((self._table.first[clause], self._table.second[clause]))
        different = self._table.first[clause] != self._table.second[clause]
        orbits = np.unique(self._kind.orbit[states[np.tile(different, 2)]])
        allowed: list[tuple[int, int]] = []
        every: list[tuple[int, int]] = []
        least = _MANY
        for orbit in orbits.tolist():
            counts = self.violations(orbit)
            own = int(self.choice[orbit])
            after = len(violated) + counts - counts[own]
            tabu = self._tabu_until[orbit, : len(after)] > self.moves
            others = np.arange(len(after)) != own
            every += [(orbit, choice) for choice in np.flatnonzero(others).tolist()]
            for choice in np.flatnonzero(others & (~tabu | (after < fewest))).tolist():
                if after[choice] < least:
                    allowed, least = [], int(after[choice])
                if after[choice] == least:
                    allowed.append((orbit, choice))
        return allowed or every
