# SPDX-License-Identifier: GPL-3.0-or-later
"""Languages of some kinds, in which the words of some states decide those of others.

Words that an abstraction of the states decides (`coordlang.vocabulary.abstractions`); words that go
to words under some symmetries, ``f(h s) = rho(h) f(s)`` for the elements of a subgroup; and both.
There are fewer partitions of such a kind than of all, and one of them often is a language where the
loop finds none.  **What is not found here proves nothing about numbers of words**: that no
partition of a kind is a language says nothing of the others (Proposition 18 of docs/concepts.md).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import islice

import numpy as np

from coordlang.symmetry.subgroups import WordAction, cycle_type, group_table
from coordlang.vocabulary.abstractions import abstractions, up_to_symmetry
from coordlang.vocabulary.job import Assignment, Job
from coordlang.vocabulary.loop import Budget, Languages, find
from coordlang.vocabulary.orbit_words import OrbitWords
from coordlang.vocabulary.sat import Undecided, satisfiable
from planners.joint.tables import Ints
from planners.search.sat import SolverName, sat_solver

#: Subgroups that are looked at, and maps to permutations of words for each of them.
_SUBGROUPS, _ACTIONS = 60, 60
#: Maps for which it is tried whether the single symmetries allow them, for each subgroup.
_TRIED = 600
#: Clauses that are taken of a refuted partition, before their images; and failing tuples after
#: which longer ones are not looked for.
_AT_ONCE, _ENOUGH = 100, 300
#: Abstractions with more abstract states tie too few states to be looked at with symmetries.
_TIED = 2
#: A solver that is quick on many easy problems with many solutions.
_SOLVER: SolverName = "minisat22"
#: What is spent to see that one symmetry cannot act on words in some way.
_PROBE = Budget(rounds=10, conflicts=200)
#: What may be spent on each kind at first.
_FIRST = Budget(rounds=50, conflicts=2_000)
#: What then may be spent on the first kind that is left without an abstraction; who comes after one
#: that took all of its rounds has half of them.  Most kinds that are left hold a language, and many
#: are refuted before it is met: a few kinds to their end are better than all of them half the way.
_DEEP = Budget(rounds=800, conflicts=10_000)
#: Refuted partitions of all kinds for each of the budget.
_TOGETHER = 8


@dataclass(slots=True)
class _Kind:
    """One kind of partitions, with its problem once that was looked at, and the rounds so far.

    States with the same number in ``tied`` (states) have the same word besides.
    """

    action: WordAction
    tied: Ints | None = None
    problem: _Orbits | None = None
    rounds: int = 0

    def rules_out(self, other: _Kind) -> bool:
        """Whether the other kind has no language if this one has none, as far as that is seen."""
        if len(self.action.words) == 1:
            return self.tied is other.tied
        return self.tied is None and self.action is other.action

    def close(self) -> None:
        """Give back what the solver holds."""
        if self.problem is not None:
            self.problem.close()
            self.problem = None


@dataclass(slots=True)
class _Kinds:
    """The kinds of partitions into some number of words that may still hold a language.

    Those that are ``open`` are looked at next, those that are ``undecided`` with more effort.
    Where it ``deepens``, from the second time on, kinds have half the rounds of those before; a
    kind that stopped for its conflicts does not count.
    """

    open: list[_Kind]
    deepens: bool
    undecided: list[_Kind] = field(default_factory=list)
    effort: Budget = _FIRST
    spent: int = 0

    def next_effort(self) -> Budget:
        """What may be spent on the next kind."""
        if not self.deepens or self.effort == _FIRST:
            return self.effort
        return replace(self.effort, rounds=self.effort.rounds >> self.spent)

    def leave_undecided(self, kind: _Kind) -> None:
        """Look at a kind later."""
        self.spent += kind.rounds >= self.next_effort().rounds
        self.undecided.append(kind)

    def begin_again(self) -> None:
        """Look at those that are undecided with more effort."""
        self.open, self.undecided, self.spent = self.undecided, [], 0
        first = self.deepens and self.effort == _FIRST
        self.effort = _DEEP if first else self.effort.doubled()

    def leave_out(self, which: Callable[[_Kind], bool]) -> None:
        """Leave out some kinds."""
        for kinds in self.open, self.undecided:
            for kind in filter(which, kinds):
                kind.close()
            kinds[:] = [kind for kind in kinds if not which(kind)]


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
        self._states, self._languages = job.states, languages
        self._refuter = languages.refuter.copy()
        self._random = np.random.default_rng(job.seed)
        images = languages.refuter.pool.images
        self._abstractions = up_to_symmetry(abstractions(job.candidates, job.states), images)
        self._group = group_table(images)
        every = frozenset(range(len(self._group.elements)))
        subgroups = self._group.subgroups(every, _SUBGROUPS)
        # Large ones first: they are quick.  All partitions are what the loop looks at.
        self._subgroups = self._group.up_to_conjugation(subgroups, every)[:0:-1]
        self._kinds: dict[int, list[_Kinds]] = {}

    def find(self, size: int, rounds: int) -> Assignment | None:
        """A language with at most ``size`` words; None if none was found with some effort.

        The next call with this size goes on, and spends more on what was looked at before.
        """
        for kinds in self._of_size(size):
            if (found := self._among(kinds, size, _TOGETHER * rounds)) is not None:
                self.drop(size)
                return found
        return None

    def drop(self, size: int) -> None:
        """Forget a number of words that is decided."""
        for kinds in self._kinds.pop(size, ()):
            kinds.leave_out(lambda _: True)

    def close(self) -> None:
        """Give back what the solvers hold."""
        for size in list(self._kinds):
            self.drop(size)

    def _among(self, kinds: _Kinds, size: int, rounds: int) -> Assignment | None:
        """A language of one of these kinds, within so many refuted partitions."""
        until = self._languages.rounds + rounds
        while kinds.open and self._languages.rounds < until:
            kind = kinds.open.pop(0)
            try:
                found = self._of_kind(kind, size, kinds.next_effort())
            except Undecided:
                kinds.leave_undecided(kind)
                continue
            kind.close()
            if found is not None:
                return found
            for others in self._kinds[size]:
                others.leave_out(kind.rules_out)
        if not kinds.open:
            kinds.begin_again()
        return None

    def _of_size(self, size: int) -> Iterator[_Kinds]:
        """The kinds with an abstraction alone, then those with both, and those with symmetries."""
        if size not in self._kinds:
            nothing = WordAction({0: tuple(range(size))})
            alone = [_Kind(nothing, tied) for tied in self._abstractions]
            self._kinds[size] = [_Kinds(alone, deepens=False)]
        known = self._kinds[size]
        yield known[0]
        if len(known) == 1:
            actions = self._actions(size)
            left = [kind.tied for kind in (*known[0].open, *known[0].undecided)]
            few = [tied for tied in left if tied is not None and self._ties_many(tied)]
            both = [_Kind(action, tied) for tied in few for action in actions]
            known.append(_Kinds(both, deepens=False))
            known.append(_Kinds([_Kind(action) for action in actions], deepens=True))
        yield from known[1:]

    def _ties_many(self, tied: Ints) -> bool:
        return _TIED * len(np.unique(tied[list(self._states)])) <= len(self._states)

    def _actions(self, size: int) -> list[WordAction]:
        """The actions of subgroups on words, without those that some single symmetry rules out.

        Where a subgroup acts, each of its elements acts by itself: if no language has words on
        which one element acts in some way, then no larger kind with it has.
        """
        ruled_out: dict[tuple[int, tuple[int, ...]], bool] = {}

        def possible(action: WordAction) -> bool:
            for element in action.subgroup[1:]:
                words = action.words[element]
                key = (self._group.conjugate[element], cycle_type(words))
                if key not in ruled_out:
                    ruled_out[key] = self._is_ruled_out(element, words)
                if ruled_out[key]:
                    return False
            return True

        chosen = []
        for subgroup in self._subgroups:
            found = islice(self._group.word_actions(subgroup, size, _SUBGROUPS), _TRIED)
            chosen += list(islice(filter(possible, found), _ACTIONS))
        return chosen

    def _is_ruled_out(self, element: int, words: tuple[int, ...]) -> bool:
        """Whether it is soon seen that no language has words on which an element acts so."""
        kind = _Kind(self._group.cyclic_action(element, words))
        try:
            return self._of_kind(kind, len(words), _PROBE) is None
        except Undecided:
            return False
        finally:
            kind.close()

    def _of_kind(self, kind: _Kind, size: int, effort: Budget) -> Assignment | None:
        """A language of one kind; None if there is none.  Raises `Undecided`, and can go on."""
        if kind.problem is None:
            words = OrbitWords.of(self._states, self._group, kind.action, size, kind.tied)
            if words is None:
                return None
            elements = [self._group.elements[h] for h in kind.action.subgroup]
            kind.problem = _Orbits.of(words, elements)
        problem = kind.problem
        images = self._group.right_cosets(frozenset(kind.action.words))

        def holds(partition: Assignment) -> bool:
            word = self._languages.word(partition)
            agreeing = self._refuter.agreeing(word, images, _ENOUGH)
            if agreeing:
                kind.rounds += 1
                self._languages.rounds += 1
                codes = self._refuter.pool.codes(word, agreeing, _AT_ONCE, self._random)
                problem.separate_one_of_each(codes, images)
            return not agreeing

        left = Budget(effort.rounds - kind.rounds, effort.conflicts)
        return find(problem.solve, holds, left)


class _Orbits:
    """The SAT problem of one kind of partition: a word for each orbit of states.

    A state's variable for a word is that of its orbit's first state for the word that goes there.
    """

    def __init__(self, size: int) -> None:
        self.size = size
        self._solver = sat_solver(_SOLVER)
        self._last = self._last_word = 0
        self._word: dict[int, dict[int, int]] = {}
        #: Of the code of an orbit's first pair; -1 is no pair, and 0 no variable.
        self._variable_of: dict[int, int] = {-1: 0}
        self._elements: list[Ints] = []

    @classmethod
    def of(cls, kind: OrbitWords, elements: Sequence[Ints]) -> _Orbits:
        """The problem of a kind; ``elements`` are the symmetries of its subgroup."""
        problem = cls(kind.size)
        problem._elements = list(elements)
        for members, words in zip(kind.members, kind.words, strict=True):
            variables = [problem._new() for _ in words]
            for state, own in zip(members.tolist(), words.T.tolist(), strict=True):
                problem._word[state] = dict(zip(own, variables, strict=True))
            problem._one_of(variables)
        problem._last_word = problem._last
        return problem

    def solve(self, conflicts: int) -> dict[int, int] | None:
        """A partition of this kind, None if none is left.  Raises `Undecided`."""
        if not satisfiable(self._solver, conflicts=conflicts):
            return None
        # The variables of words were made first, and are few among those of pairs.
        true = {v for v in self._solver.get_model()[: self._last_word] if v > 0}
        return {s: next(w for w, v in own.items() if v in true) for s, own in self._word.items()}

    def close(self) -> None:
        """Give back what the solver holds."""
        self._solver.delete()

    def separate_one_of_each(self, clauses: Ints, images: Sequence[Ints]) -> None:
        """Require that one pair of each clause has different words, and of each clause's images.

        Parameters
        ----------
        clauses
            (clauses, pairs) codes ``a * states + b`` of pairs, -1 for none.
        images
            (states) symmetries: with the subgroup of this kind they give the whole group.
        """
        every = np.unique(np.concatenate([self._orbits_of(clauses, to) for to in images]), axis=0)
        codes, number = np.unique(every, return_inverse=True)
        variables = np.array([self._separated(code) for code in codes.tolist()])
        for row in variables[number.reshape(every.shape)].tolist():
            self._solver.add_clause([variable for variable in row if variable])

    def _orbits_of(self, clauses: Ints, to: Ints) -> Ints:
        """Images of clauses, each with the first pair of the orbit in place of each pair."""
        images = [_images(clauses, element[to]) for element in self._elements]
        found: Ints = np.sort(np.minimum.reduce(images), axis=1)
        return found

    def _separated(self, code: int) -> int:
        """A variable that is true only where two states, and their images, have different words.

        ``code`` is that of the first pair of an orbit.
        """
        known = self._variable_of.get(code)
        if known is not None:
            return known
        variable = self._variable_of[code] = self._new()
        a, b = divmod(code, len(self._elements[0]))
        first, second = self._word[a], self._word[b]
        for word in first.keys() & second.keys():
            self._solver.add_clause([-variable, *{-first[word], -second[word]}])
        return variable

    def _one_of(self, variables: Sequence[int]) -> None:
        self._solver.add_clause(list(variables))
        for n, b in enumerate(variables):
            for a in variables[:n]:
                self._solver.add_clause([-a, -b])

    def _new(self) -> int:
        self._last += 1
        return self._last


def _images(clauses: Ints, to: Ints) -> Ints:
    """The codes of clauses' images under a symmetry; see `_Orbits.separate_one_of_each`."""
    states = len(to)
    a, b = to[clauses // states], to[clauses % states]
    return np.where(clauses < 0, -1, np.minimum(a, b) * states + np.maximum(a, b))
