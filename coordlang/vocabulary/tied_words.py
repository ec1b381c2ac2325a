# SPDX-License-Identifier: GPL-3.0-or-later
"""Languages among partitions of a kind, of which there are fewer than of all.

States share a word that an abstraction takes for one (`coordlang.vocabulary.abstractions`), or that
a symmetry takes to each other; in one task those of which a few facts say the same ("has robot 2
loaded the package?").  One of these partitions often is a language where the loop finds none.
**What is not found here proves nothing about numbers of words**: that no partition of a kind is a
language says nothing of the others (Proposition 18 of docs/concepts.md).
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Sequence
from copy import copy
from itertools import tee

import numpy as np

from coordlang.language.candidates import Candidates
from coordlang.symmetry.group import orbits
from coordlang.vocabulary.job import Assignment, Job, words_of_states
from coordlang.vocabulary.languages import Languages
from coordlang.vocabulary.loop import Budget, find
from coordlang.vocabulary.sat import PartitionProblem, Undecided
from planners.joint.tables import Bools, Ints, unique_rows
from planners.search.sat import whole

#: Clauses that are taken of a refuted partition, before their images; and failing tuples after
#: which longer ones are not looked for.
_AT_ONCE, _ENOUGH = 100, 300
#: What may be spent on each kind of one task, and of many, at first; then twice as much each time.
_OF_ONE, _OF_MANY = Budget(rounds=25, conflicts=2_000), Budget(rounds=50, conflicts=2_000)
#: Failing tuples of one length, under one symmetry, that are looked at for what they differ in, and
#: after which longer ones are not.
_ENOUGH_FOR_FACTS = 500
#: Refuted partitions of all kinds for each of the budget, so many conflicts counted as one.
_TOGETHER, _CONFLICTS = 8, 250


class TiedWords:
    """Looks for languages among such partitions, with effort that grows from call to call."""

    def __init__(self, job: Job, languages: Languages) -> None:
        self._states, self._languages = np.array(job.states), languages
        self._random = np.random.default_rng(job.seed)
        self._images = languages.pool.images
        self._is_one_task = job.candidates.count == 1
        self._first = _OF_ONE if self._is_one_task else _OF_MANY
        #: Which states share a word, kind by kind; each size goes through a copy of it.
        (self._tied,) = tee(self._classes(job), 1)
        #: Those of the solvers so far on kinds that stayed undecided.
        self.conflicts = 0
        #: Of each number of words the kinds that were not looked at, and those that are undecided.
        self._kinds: dict[int, tuple[Iterator[_Kind], deque[_Kind]]] = {}

    def _classes(self, job: Job) -> Iterator[Ints]:
        """(states) which states share a word, kind by kind: those with few classes first.

        For one task: as few facts as possible decide it, then more and more.
        """
        if self._is_one_task:
            yield from classes_by_facts(job.candidates, self._languages)
        else:  # these load networkx
            from coordlang.vocabulary.abstractions import abstractions, up_to_symmetry

            tied = abstractions(job.candidates, job.states)
            tied += [orbits([image]) for image in self._images[1:]]
            tied.sort(key=lambda classes: len(np.unique(classes[self._states])))
            yield from up_to_symmetry(tied, self._images)

    def of_facts(self) -> Assignment | None:
        """Of one task the language that says the steps to go and a few facts, if there is one."""
        classes = next(copy(self._tied), None)
        if classes is None:
            return None
        return dict(zip(self._states.tolist(), classes[self._states].tolist(), strict=True))

    def find(self, size: int, rounds: int) -> Assignment | None:
        """A language with at most ``size`` words; None if none was found with some effort.

        The next call with this size goes on, and spends more on what was looked at before.
        """
        if size not in self._kinds:
            self._kinds[size] = self._new_kinds(size), deque()
        new, undecided = self._kinds[size]
        until = self._spent + _TOGETHER * rounds
        while self._spent < until:
            kind = next(new, None) or (undecided.popleft() if undecided else None)
            if kind is None:
                return None
            before = kind.problem.conflicts
            try:
                found = self._of_kind(kind)
            except Undecided:
                self.conflicts += kind.problem.conflicts - before
                kind.effort = kind.effort.doubled()
                undecided.append(kind)
                continue
            kind.problem.close()
            if found is not None:
                self.drop(size)
                return found
        return None

    def _new_kinds(self, size: int) -> Iterator[_Kind]:
        random = self._random if self._is_one_task else None
        for classes in copy(self._tied):
            yield _Kind(self._states, classes, size, self._images, self._first, random)

    @property
    def _spent(self) -> int:
        return self._languages.rounds + self.conflicts // _CONFLICTS

    def drop(self, size: int) -> None:
        """Forget a number of words that is decided."""
        _, undecided = self._kinds.pop(size)
        for kind in undecided:
            kind.problem.close()

    def close(self) -> None:
        """Give back what the solvers hold."""
        for size in list(self._kinds):
            self.drop(size)

    def _of_kind(self, kind: _Kind) -> Assignment | None:
        """A language of one kind; None if there is none.  Raises `Undecided`, and can go on."""

        def holds(partition: Assignment) -> bool:
            word = words_of_states(partition, len(kind.first))[kind.first]
            agreeing = self._languages.agreeing(word, kind.images, _ENOUGH)
            if agreeing:
                kind.rounds += 1
                self._languages.rounds += 1
                kind.require(self._languages.pool.codes(word, agreeing, _AT_ONCE, self._random))
            return not agreeing

        left = Budget(kind.effort.rounds - kind.rounds, kind.effort.conflicts)
        found = find(kind.problem.solve, holds, left)
        if found is None:
            return None
        firsts = kind.first[self._states].tolist()
        return {s: found[first] for s, first in zip(self._states.tolist(), firsts, strict=True)}


class _Kind:
    """One kind of partitions into a number of words.

    ``tied`` (states) says which share a word, ``first`` (states) which is the first one that has
    the same word, of those that need one, ``images`` of some symmetries those after which that is
    not the same.  ``problem`` has the partitions that are left; ``effort`` may be spent on them,
    and ``rounds`` of them are refuted so far.  ``random`` draws the words that are tried first.
    """

    def __init__(
        self,
        states: Ints,
        tied: Ints,
        size: int,
        images: Sequence[Ints],
        effort: Budget,
        random: np.random.Generator | None = None,
    ) -> None:
        _, number, of_state = np.unique(tied[states], return_index=True, return_inverse=True)
        self.first = np.arange(len(tied))
        self.first[states] = states[number[of_state]]
        _, different = np.unique([self.first[to] for to in images], axis=0, return_index=True)
        self.images = [images[n] for n in sorted(different.tolist())]
        free = np.unique(self.first[states]).tolist()
        # A solver that is quick on many easy problems with many solutions.
        self.problem = PartitionProblem(free, size, "minisat22", named=False)
        if random is not None:
            self.problem.prefer_any(random, size)
        self.effort, self.rounds = effort, 0

    def require(self, codes: Ints) -> None:
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


# ---- few facts that decide the words of one task


def classes_by_facts(candidates: Candidates, languages: Languages) -> Iterator[Ints]:
    """(states) the class of each state: what some facts say of it, and how many steps are to go.

    Each class a word of its own is a language.  At first the class is decided by facts of which
    none can be spared, then by more and more: each time by others that would suffice alone.  There
    are none if a state is met with several numbers of steps to go, as within slack.

    The facts are a hitting set of what failing plans differ in: two plans have one sentence under
    such classes iff they are in one class after each step, so that nothing else tells them apart
    (Proposition 28 of docs/concepts.md).

    ``candidates``: one task.  ``languages``: tells what is wrong with a partition.
    """
    (space,) = candidates.spaces
    steps = np.full(len(space.rows), -1)
    steps[space.state] = space.layer
    if (steps[space.state] != space.layer).any():
        return
    true = candidates.model.codec.truth(candidates.rows).T
    facts, chosen = true[true.any(axis=1) & ~true.all(axis=1)], list[int]()
    left = np.ones(len(facts), np.bool_)
    while (found := _deciding(facts, left, steps, languages)) is not None:
        left[found] = False
        chosen += found
        yield _classes(steps, facts[chosen])


def _deciding(facts: Bools, left: Bools, steps: Ints, languages: Languages) -> list[int] | None:
    """Facts that suffice, of those that are ``left``, by number; None if all do not."""
    from pysat.examples.hitman import Hitman

    with whole(Hitman)(htype="lbx") as hitting:
        chosen: list[int] = []
        while agreeing := languages.agreeing(
            _classes(steps, facts[chosen]), None, _ENOUGH_FOR_FACTS
        ):
            for found in agreeing:
                sequences = languages.pool.sequences(found, found.rows[:_ENOUGH_FOR_FACTS])
                for differing in _differing(facts, sequences):
                    if not (differing & left).any():
                        return None
                    hitting.hit(np.flatnonzero(differing & left).tolist())
            chosen = sorted(hitting.get())
    return chosen


def _differing(facts: Bools, sequences: Ints) -> Bools:
    """(different sets, facts) what the plans of each tuple (tuples, plans, length) differ in."""
    values = facts[:, sequences]
    differ = (values != values[:, :, :1]).any(axis=(2, 3))
    return np.unique(differ.T, axis=0)


def _classes(steps: Ints, facts: Bools) -> Ints:
    """(states) a number for each different combination of steps to go and values of facts."""
    return unique_rows(np.column_stack((steps + 1, *facts)))[1]
