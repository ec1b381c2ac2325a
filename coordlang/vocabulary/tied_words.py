# SPDX-License-Identifier: GPL-3.0-or-later
"""Languages of some kinds, in which the words of some states decide those of others.

Words that say one state variable, as where robot 1 is; and words that go to words under a symmetry
``h``: ``f(h s) = rho(h) f(s)`` for the elements of some subgroup.  There are fewer partitions of
such a kind than of all, and one of them often is a language where the loop finds none.  **What is
not found here proves nothing about numbers of words** (Proposition 18 of docs/concepts.md).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from itertools import islice

import numpy as np

from coordlang.language.candidates import Candidates
from coordlang.language.warping import pair
from coordlang.symmetry.subgroups import WordAction, cycle_type, group_table
from coordlang.vocabulary.job import Assignment, Job
from coordlang.vocabulary.loop import Budget, Languages, find
from coordlang.vocabulary.sat import PartitionProblem, Undecided
from planners.joint.tables import Ints
from planners.search.state_variables import state_variables

#: State variables that are looked at, subgroups of symmetries, and permutations for each of them.
_VARIABLES, _SUBGROUPS, _ACTIONS = 12, 60, 60
#: Conflicts of the solver for one partition.
_CONFLICTS = 2_000
#: Refuted partitions of a kind in the first look; and of all kinds for each of the budget.
_FIRST, _TOGETHER = 50, 4


#: The number of a symmetry, and the lengths of the cycles in which words go.
_Move = tuple[int, tuple[int, ...]]


@dataclass(frozen=True, slots=True)
class _Kind:
    """One kind of partitions.

    Each of ``ties`` says which word the second state has where the first one has word 0, 1, ..;
    ``images`` are symmetries by which clauses are added, so that those of all follow.  ``moves``
    says for each symmetry of the subgroup, up to conjugation, what it does to words.
    """

    ties: Sequence[tuple[int, int, Sequence[int]]]
    images: Sequence[Ints]
    moves: frozenset[_Move] = frozenset()


class TiedWords:
    """Looks for languages among such partitions, with effort that grows from call to call.

    Parameters
    ----------
    job
        What they are for.
    languages
        Tells what is wrong with a partition.
    """

    def __init__(self, job: Job, languages: Languages) -> None:
        self._states, self._candidates, self._languages = job.states, job.candidates, languages
        self._group = group_table(languages.refuter.pool.images)
        #: For each number of words the kinds that nobody has looked at, and those not decided.
        self._left: dict[int, Iterator[_Kind]] = {}
        self._open: dict[int, list[tuple[PartitionProblem, _Kind]]] = {}
        self._ruled_out: dict[int, set[_Move]] = {}

    def find(self, size: int, rounds: int) -> Assignment | None:
        """A language with at most ``size`` words; None if none was found with some effort.

        First all kinds are looked at; those that are left then get ``rounds`` one after another.
        """
        until = self._languages.rounds + _TOGETHER * rounds
        if size not in self._left:
            self._left[size], self._open[size] = self._kinds(size), []
        kinds = self._open[size]
        for kind in self._left[size]:
            kinds.append((self._problem(size, kind), kind))
            if (found := self._look(kinds, len(kinds) - 1, _FIRST)) is not None:
                return found
            if self._languages.rounds >= until:
                return None
        number = 0
        while number < len(kinds) and self._languages.rounds < until:
            before = len(kinds)
            if (found := self._look(kinds, number, rounds)) is not None:
                return found
            number += len(kinds) == before
        return None

    def close(self) -> None:
        """Give back what the solvers hold."""
        for kinds in self._open.values():
            for problem, _ in kinds:
                problem.close()

    def _look(
        self, kinds: list[tuple[PartitionProblem, _Kind]], number: int, rounds: int
    ) -> Assignment | None:
        """A language of one kind, which is left out of the list if it is decided."""
        problem, kind = kinds[number]
        holds = partial(self._holds, problem, kind)
        with suppress(Undecided):
            found = find(problem.solve, holds, Budget(rounds, _CONFLICTS))
            del kinds[number]
            problem.close()
            if found is None and len(kind.moves) == 1:
                self._ruled_out.setdefault(problem.size, set()).update(kind.moves)
            return found
        return None

    def _kinds(self, size: int) -> Iterator[_Kind]:
        same = range(size)
        for value in islice(_values(self._candidates), _VARIABLES):
            first: dict[int, int] = {}
            ties = [(first.setdefault(int(value[s]), s), s, same) for s in self._states]
            yield _Kind(ties, self._group.elements)
        every = frozenset(range(len(self._group.elements)))
        # Those of one symmetry and the identity first: they rule out others.  Then large ones.
        subgroups = self._group.subgroups(every, _SUBGROUPS)
        some = self._group.up_to_conjugation(subgroups, every)[:0:-1]
        for subgroup in sorted(some, key=lambda chosen: len(chosen) > 2):
            actions = self._group.word_actions(subgroup, size, _SUBGROUPS)
            for action in islice(actions, _ACTIONS):
                kind = self._kind(action)
                # What a symmetry cannot do alone it cannot do with others.
                if not kind.moves & self._ruled_out.get(size, set()):
                    yield kind

    def _kind(self, action: WordAction) -> _Kind:
        """Words that go to words as an action says."""
        elements, classes = self._group.elements, self._group.conjugate
        moved = [(elements[h].tolist(), words) for h, words in action.words.items() if h]
        return _Kind(
            [(s, to[s], words) for to, words in moved for s in self._states],
            self._group.right_cosets(frozenset(action.words)),
            frozenset((classes[h], cycle_type(words)) for h, words in action.words.items() if h),
        )

    def _problem(self, size: int, kind: _Kind) -> PartitionProblem:
        problem = PartitionProblem(self._states, size, "minisat22", named=False)
        for state, other, words in kind.ties:
            problem.tie(state, other, words)
        return problem

    def _holds(self, problem: PartitionProblem, kind: _Kind, partition: dict[int, int]) -> bool:
        """Whether a partition is a language; if not, the problem learns what is wrong with it."""
        violated = self._languages.refuter.violated(self._languages.word(partition))
        self._languages.rounds += 1
        every = {
            frozenset(pair(int(to[a]), int(to[b])) for a, b in clause)
            for clause in violated
            for to in kind.images
        }
        for clause in sorted(every, key=sorted):
            problem.separate_one(clause)
        return not violated


def _values(candidates: Candidates) -> Iterator[Ints]:
    """(states) the value of each state variable, -1 where it has none."""
    codec = candidates.model.codec
    for variable in state_variables(candidates.model, candidates.rows[0]):
        value = np.full(len(candidates.rows), -1)
        for number, fact in enumerate(variable.facts):
            value[codec.column(candidates.rows, fact)] = number
        yield value
