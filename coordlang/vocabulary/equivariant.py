# SPDX-License-Identifier: GPL-3.0-or-later
"""Equivariant languages: words that go to words under some symmetries.

For a subgroup ``H`` of the symmetries and a map ``rho`` of it to permutations of the words, only
partitions with ``f(h s) = rho(h) f(s)`` are looked at: one state of an orbit decides the others.
That finds languages where the search among all partitions does not end.  **It proves nothing about
numbers of words**: that no partition of a kind is a language says nothing of the others.  So what
is not found here is `None`, whatever the reason, and no bound can be made of it (Proposition 18 of
docs/concepts.md).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import islice

import numpy as np

from coordlang.symmetry.subgroups import WordAction, cycle_type, group_table
from coordlang.vocabulary.job import Assignment
from coordlang.vocabulary.orbit_words import OrbitWords
from coordlang.vocabulary.problems_by_size import SolverBudget
from coordlang.vocabulary.recent_tuples import RecentTuples
from coordlang.vocabulary.refuter import Refuter
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
#: All failing tuples are asked where fewer of the recent ones agree.
_FEW = 100
#: Abstractions with more abstract states tie too few states to be looked at with symmetries.
_TIED = 2
#: A solver that is quick on many easy problems with many solutions.
_SOLVER: SolverName = "minisat22"


#: What is spent to see that one symmetry cannot act on words in some way.
_PROBE = SolverBudget(rounds=10, conflicts=200)
#: What may be spent on each kind at first: refuted partitions, conflicts for each of them.
_FIRST = SolverBudget(rounds=50, conflicts=2_000)
#: What then may be spent on the first kind that is left; who comes after one that took all of its
#: rounds has half of them.
#: Most kinds that are left after a few refuted partitions hold a language, and many are refuted
#: before it is met: a few kinds to their end are better than all of them half the way.
_DEEP = SolverBudget(rounds=800, conflicts=10_000)


@dataclass(slots=True)
class _Kind:
    """One kind of partitions, with its problem once that was looked at, and the rounds so far.

    States with the same number in ``tied`` (states) have the same word besides.
    """

    action: WordAction
    tied: Ints | None = None
    problem: _Orbits | None = None
    recent: RecentTuples | None = None
    rounds: int = 0

    def close(self) -> None:
        """Give back what the solver holds."""
        if self.problem is not None:
            self.problem.close()
            self.problem = self.recent = None


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
    effort: SolverBudget = _FIRST
    spent: int = 0

    def next_effort(self) -> SolverBudget:
        """What may be spent on the next kind."""
        if not self.deepens or self.effort == _FIRST:
            return self.effort
        return self.effort.lessened(self.spent)

    def leave_undecided(self, kind: _Kind) -> None:
        """Look at a kind later."""
        self.spent += kind.rounds >= self.next_effort().rounds
        self.undecided.append(kind)

    def begin_again(self) -> None:
        """Look at those that are undecided with more effort."""
        self.open, self.undecided, self.spent = self.undecided, [], 0
        first = self.deepens and self.effort == _FIRST
        self.effort = _DEEP if first else self.effort.doubled()


class EquivariantSearch:
    """Looks for languages among equivariant partitions.

    Parameters
    ----------
    states
        Numbers of the states that need words.
    refuter
        Tells what is wrong with a partition.
    seed
        Of what is drawn at random: which clauses are taken.
    """

    def __init__(self, states: Sequence[int], refuter: Refuter, seed: int) -> None:
        self._states, self._refuter = states, refuter
        self._random = np.random.default_rng(seed)
        self._group = group_table(refuter.pool.images)
        every = frozenset(range(len(self._group.elements)))
        subgroups = self._group.subgroups(every, _SUBGROUPS)
        some = self._group.up_to_conjugation(subgroups, every)
        # Large ones first: they are quick.  All partitions are what the others look at.
        self._subgroups = some[:0:-1] or some
        self._of_actions: dict[int, list[WordAction]] = {}
        self._kinds: dict[tuple[int, bool], _Kinds] = {}
        #: Actions under which no partition is a language, abstract or not.
        self._ruled_out: set[int] = set()
        self.rounds = 0

    def find(
        self,
        size: int,
        rounds: int,
        abstractions: Sequence[Ints] | None = None,
    ) -> Assignment | None:
        """A language with at most ``size`` words, None if none was found with some effort.

        The next call with this size goes on, and spends more on what was looked at before.

        Parameters
        ----------
        size
            The number of words.
        rounds
            The search is given up for now after so many refuted partitions.
        abstractions
            Look at words that one of these decides, too, each (states) the abstract state of each
            state: there are so few of them that most kinds are decided at once.  In later calls
            with this size some may be left out.
        """
        kinds = self._of_size(size, abstractions)
        left = {id(abstract) for abstract in abstractions or ()}
        until = self.rounds + rounds
        while kinds.open and self.rounds < until:
            kind = kinds.open.pop(0)
            if kind.tied is not None and (
                id(kind.tied) not in left or id(kind.action) in self._ruled_out
            ):
                kind.close()
                continue
            try:
                found = self._of_kind(kind, size, kinds.next_effort())
            except Undecided:
                kinds.leave_undecided(kind)
                continue
            kind.close()
            if found is not None:
                self.drop(size)
                return found
            if kind.tied is None:
                self._ruled_out.add(id(kind.action))
        if not kinds.open:
            kinds.begin_again()
        return None

    def undecided(self, size: int) -> list[WordAction]:
        """The kinds of partitions into so many words that may still hold a language."""
        kinds = self._of_size(size, None)
        return [kind.action for kind in (*kinds.open, *kinds.undecided)]

    def drop(self, size: int) -> None:
        """Forget a number of words that is decided."""
        for abstract in (False, True):
            kinds = self._kinds.pop((size, abstract), None)
            for kind in (*kinds.open, *kinds.undecided) if kinds else ():
                kind.close()

    def close(self) -> None:
        """Give back what the solvers hold."""
        for size, _ in list(self._kinds):
            self.drop(size)

    def _of_size(self, size: int, abstractions: Sequence[Ints] | None) -> _Kinds:
        kinds = self._kinds.get((size, abstractions is not None))
        if kinds is None:
            if size not in self._of_actions:
                self._of_actions[size] = self._actions(size)
            actions = self._of_actions[size]
            if abstractions is not None:
                acting = [action for action in actions if len(action.subgroup) > 1]
                states = list(self._states)
                few = [a for a in abstractions if _TIED * len(np.unique(a[states])) <= len(states)]
                some = [_Kind(action, tied) for tied in few for action in acting]
                kinds = _Kinds(some, deepens=False)
            else:
                kinds = _Kinds([_Kind(action) for action in actions], deepens=True)
            self._kinds[size, abstractions is not None] = kinds
        return kinds

    def _actions(self, size: int) -> list[WordAction]:
        """The kinds of partitions, without those that some single symmetry rules out.

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

    def _of_kind(self, kind: _Kind, size: int, effort: SolverBudget) -> Assignment | None:
        """A language of one kind; None if there is none.  Raises `Undecided`, and can go on."""
        if kind.problem is None:
            words = OrbitWords.of(self._states, self._group, kind.action, size, kind.tied)
            if words is None:
                return None
            elements = [self._group.elements[h] for h in kind.action.subgroup]
            kind.problem = _Orbits.of(words, elements)
            kind.recent = RecentTuples(self._refuter, _ENOUGH, _FEW)
        problem, recent = kind.problem, kind.recent
        assert recent is not None
        word = np.zeros(len(self._group.elements[0]), np.int64)
        images = self._group.right_cosets(frozenset(kind.action.words))
        while kind.rounds < effort.rounds:
            partition = problem.solve(effort.conflicts)
            if partition is None:
                return None
            word[list(partition)] = list(partition.values())
            agreeing = recent.agreeing(word, images)
            if not agreeing:
                return partition
            kind.rounds += 1
            self.rounds += 1
            codes = self._refuter.pool.codes(word, agreeing, _AT_ONCE, self._random)
            problem.separate_one_of_each(codes, images)
        raise Undecided


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
