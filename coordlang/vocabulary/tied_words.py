# SPDX-License-Identifier: GPL-3.0-or-later
"""Languages in which some states have the words of others.

States that an abstraction takes for one (`coordlang.vocabulary.abstractions`), or that a symmetry
takes to each other, share a word.  There are fewer partitions of such a kind than of all, and one
of them often is a language where the loop finds none.  **What is not found here proves nothing
about numbers of words**: that no partition of a kind is a language says nothing of the others
(Proposition 18 of docs/concepts.md).
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence

import numpy as np

from coordlang.vocabulary.abstractions import abstractions, up_to_symmetry
from coordlang.vocabulary.job import Assignment, Job
from coordlang.vocabulary.loop import Budget, Languages, find
from coordlang.vocabulary.sat import PartitionProblem, Undecided
from planners.joint.tables import Ints

#: Clauses that are taken of a refuted partition, before their images; and failing tuples after
#: which longer ones are not looked for.
_AT_ONCE, _ENOUGH = 100, 300
#: What may be spent on each kind at first, and then twice as much each time.
_FIRST = Budget(rounds=50, conflicts=2_000)
#: Refuted partitions of all kinds for each of the budget, so many conflicts counted as one.
_TOGETHER, _CONFLICTS = 8, 250


class TiedWords:
    """Looks for languages among such partitions, with effort that grows from call to call.

    Parameters
    ----------
    job
        What they are for.
    languages
        Tells what is wrong with a partition.

    Attributes
    ----------
    conflicts
        Those of the solvers so far on kinds that stayed undecided.
    """

    def __init__(self, job: Job, languages: Languages) -> None:
        self._states, self._languages = np.array(job.states), languages
        self._refuter = languages.refuter.copy()
        self._random = np.random.default_rng(job.seed)
        images = languages.refuter.pool.images
        tied = [*abstractions(job.candidates, job.states), *map(_orbits, images[1:])]
        tied.sort(key=lambda classes: len(np.unique(classes[self._states])))
        self._tied = up_to_symmetry(tied, images)
        self.conflicts = 0
        self._kinds: dict[int, deque[_Kind]] = {}

    def find(self, size: int, rounds: int) -> Assignment | None:
        """A language with at most ``size`` words; None if none was found with some effort.

        The next call with this size goes on, and spends more on what was looked at before.
        """
        if size not in self._kinds:
            images = self._refuter.pool.images
            self._kinds[size] = deque(_Kind(self._states, t, size, images) for t in self._tied)
        kinds, until = self._kinds[size], self._spent + _TOGETHER * rounds
        while kinds and self._spent < until:
            kind = kinds.popleft()
            before = kind.problem.conflicts
            try:
                found = self._of_kind(kind)
            except Undecided:
                self.conflicts += kind.problem.conflicts - before
                kind.effort = kind.effort.doubled()
                kinds.append(kind)
                continue
            kind.problem.close()
            if found is not None:
                self.drop(size)
                return found
        return None

    @property
    def _spent(self) -> int:
        return self._languages.rounds + self.conflicts // _CONFLICTS

    def drop(self, size: int) -> None:
        """Forget a number of words that is decided."""
        for kind in self._kinds.pop(size, ()):
            kind.problem.close()

    def close(self) -> None:
        """Give back what the solvers hold."""
        for size in list(self._kinds):
            self.drop(size)

    def _of_kind(self, kind: _Kind) -> Assignment | None:
        """A language of one kind; None if there is none.  Raises `Undecided`, and can go on."""

        def holds(partition: Assignment) -> bool:
            word = self._languages.word(partition)[kind.first]
            agreeing = self._refuter.agreeing(word, kind.images, _ENOUGH)
            if agreeing:
                kind.rounds += 1
                self._languages.rounds += 1
                codes = self._refuter.pool.codes(word, agreeing, _AT_ONCE, self._random)
                kind.separate_one_of_each(codes)
            return not agreeing

        left = Budget(kind.effort.rounds - kind.rounds, kind.effort.conflicts)
        found = find(kind.problem.solve, holds, left)
        if found is None:
            return None
        firsts = kind.first[self._states].tolist()
        return {s: found[first] for s, first in zip(self._states.tolist(), firsts, strict=True)}


class _Kind:
    """One kind of partitions: states with the same number in ``tied`` (states) share a word.

    Attributes
    ----------
    first
        (states) the first state that has the same word, of those that need one.
    images
        Of some symmetries those after which ``first`` is not the same.
    problem, effort, rounds
        The partitions that are left, what may be spent on them, and those refuted so far.
    """

    def __init__(self, states: Ints, tied: Ints, size: int, images: Sequence[Ints]) -> None:
        _, number, of_state = np.unique(tied[states], return_index=True, return_inverse=True)
        self.first = np.arange(len(tied))
        self.first[states] = states[number[of_state]]
        _, different = np.unique([self.first[to] for to in images], axis=0, return_index=True)
        self.images = [images[n] for n in sorted(different.tolist())]
        free = np.unique(self.first[states]).tolist()
        # A solver that is quick on many easy problems with many solutions.
        self.problem = PartitionProblem(free, size, "minisat22", named=False)
        self.effort, self.rounds = _FIRST, 0

    def separate_one_of_each(self, codes: Ints) -> None:
        """Require that one pair of each clause has different words, and of each clause's images.

        ``codes`` (clauses, pairs) are ``a * states + b``, -1 for no pair.
        """
        states, images = len(self.first), []
        for to in self.images:
            first = self.first[to]
            a, b = first[codes // states], first[codes % states]
            pairs = np.minimum(a, b) * states + np.maximum(a, b)
            images.append(np.sort(np.where((codes < 0) | (a == b), -1, pairs), axis=1))
        for row in np.unique(np.concatenate(images), axis=0).tolist():
            self.problem.separate_one({divmod(code, states) for code in row if code >= 0})


def _orbits(to: Ints) -> Ints:
    """(states) the least state to which a symmetry, again and again, takes each."""
    every = np.arange(len(to))
    least, image = every, to
    while (image != every).any():
        least = np.minimum(least, image)
        image = to[image]
    return least
