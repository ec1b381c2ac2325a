# SPDX-License-Identifier: GPL-3.0-or-later
"""Partitions into K words under clauses "one of these pairs must be separated", by SAT.

A clause with fewer pairs asks for more, and implies every clause that holds its pairs.
"""

from __future__ import annotations

import sys
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from itertools import chain, product, repeat
from typing import Any

import numpy as np

from coordlang.language.warping import Clause, Pair, pair
from planners.joint.tables import Ints
from planners.search.sat import SolverName, sat_solver, solve_slice
from planners.system.limits import address_space_left


def without_implied(clauses: Iterable[Clause], comparisons: int = sys.maxsize) -> list[Clause]:
    """The clauses that no other one implies (by a subset of its pairs), shortest first.

    ``clauses``: in any order; duplicates are dropped.  ``comparisons``: pairs of clauses that are
    compared; after so many the longer clauses are left as they are.
    """
    kept: list[Clause] = []
    compared = 0
    # A kept clause stands under one of its pairs: what it implies has that pair as well.
    by_pair: dict[Pair, list[Clause]] = {}
    for clause in sorted(set(clauses), key=lambda c: (len(c), sorted(c))):
        if compared < comparisons:
            others = [other for p in clause for other in by_pair.get(p, ())]
            compared += len(others)
            if any(other <= clause for other in others):
                continue
        kept.append(clause)
        rarest = min(sorted(clause), key=lambda p: len(by_pair.get(p, ())))
        by_pair.setdefault(rarest, []).append(clause)
    return kept


def most_constrained_first(states: Iterable[int], clauses: Iterable[Clause]) -> list[int]:
    """The states by how much the clauses ask of them: a good order to name words in.

    A pair counts for both its states, with the share that it has in its clause.
    """
    demand = defaultdict[int, float](float)
    for clause in clauses:
        for state in chain(*clause):
            demand[state] += 1 / len(clause)
    return sorted(states, key=lambda s: (-demand[s], s))


def clique(edges: Iterable[Pair]) -> list[int]:
    """A large clique, by greedy search from any state: its states need words of their own."""
    near = defaultdict[int, set[int]](set)
    for a, b in sorted(edges):
        near[a].add(b)
        near[b].add(a)
    best: list[int] = []
    for start in sorted(near):
        clique, candidates = [start], set(near[start])
        while candidates:
            chosen = max(candidates, key=lambda s: (len(near[s] & candidates), -s))
            clique.append(chosen)
            candidates &= near[chosen]
        best = max(best, clique, key=len)
    return best


#: A clause, or alternatives of which all pairs of one must be separated.
Requirement = Clause | Sequence[Clause]

#: Conflicts after which the solver comes back, to let signals (time limit, Ctrl-C) be heard.
_SLICE = 2_000
#: Bytes without which a solver is not asked: one that gets no memory ends the process.
_ROOM = 32 << 20


#: The places where two plans that fail together begin to differ, and where both have ended.
START, END = 0, -1


class PartitionProblem:
    """An incremental SAT problem: give each state a word so that every clause holds.

    Variables: state has word, pair is separated.  Words are interchangeable; the symmetry is broken
    by the order of ``states``: a state may take word w only if an earlier state has word w - 1.

    ``states``: numbers of states, in the order by which words are named.  ``size``: the number of
    words that may be used.  ``solver``: a solver of python-sat, by name.  ``named``: whether words
    are named in the order of the states: proofs are shorter, and partitions are harder to find.  If
    not, only `separate_one` may be asked for: a state may have several words then, and those of two
    separated states all differ.
    """

    def __init__(
        self,
        states: Sequence[int],
        size: int,
        solver: SolverName = "cadical153",
        *,
        named: bool = True,
    ) -> None:
        self.size = size
        self._last = 0
        self._solver = sat_solver(solver)
        self._word = {s: [self._new() for _ in range(size)] for s in states}
        #: How many requirements it has of a list that only grows.
        self.required = 0
        self._separated: dict[Pair, int] = {}
        self._equivalent: set[Pair] = set()
        self._all_separated: dict[Clause, int] = {}
        for variables in self._word.values():
            if named:
                self._one_word(variables)
            else:
                self._solver.add_clause(variables)
        #: By word the variable that it is used, once fewer words were asked for.
        self._used: list[int] = []
        if named:
            self._name_words_in_order()

    def separate_one(self, clause: Iterable[Pair]) -> None:
        """Require that one of these pairs of states lies in different words."""
        self._solver.add_clause([self._separate(p) for p in sorted(clause)])

    def require(self, known: Sequence[Requirement]) -> None:
        """Require what is new in a list that only grows: always the same one."""
        for new in known[self.required :]:
            if isinstance(new, frozenset):
                self.separate_one(new)
            else:
                self.separate_all_of_one(new)
        self.required = len(known)

    def separate_all_of_one(self, alternatives: Sequence[Clause]) -> None:
        """Require that all pairs of one of these sets lie in different words."""
        if len(alternatives) == 1:
            for states in sorted(alternatives[0]):
                self.separate_one([states])
            return
        self._solver.add_clause([self._separate_all(pairs) for pairs in alternatives])

    def prefer_any(self, random: np.random.Generator, size: int) -> None:
        """Try first to give each state a word that is drawn of the first ones; not with CaDiCaL.

        Few plans have one sentence by chance; what a solver tries by itself is one word.
        """
        drawn = random.integers(size, size=len(self._word)).tolist()
        for own, word in zip(self._word.values(), drawn, strict=True):
            self._solver.set_phases([v if n == word else -v for n, v in enumerate(own)])

    def separate_on_paths(self, steps: Ints) -> None:
        """Require of each path through a graph of pairs that one of them is in different words.

        ``steps`` (steps, 4) of two plans: a place of the graph, `START` where they begin to differ;
        the states that the plans enter, equal ones where no words are compared; and the place where
        they are then, `END` where both have ended.
        """
        before, one, other, after = steps.T
        literals = np.zeros((len(steps), 3), np.int64)
        literals[:, 0] = np.where(before == START, 0, -self._last - before)
        literals[:, 2] = np.where(after == END, 0, self._last + after)
        self._last += int(steps[:, [0, 3]].max(initial=START))
        states = 1 + max(self._word)
        pairs = np.minimum(one, other) * states + np.maximum(one, other)
        pairs, place = np.unique(pairs, return_inverse=True)
        both = map(divmod, pairs.tolist(), repeat(states))
        told = [self._separate((a, b)) if a != b else 0 for a, b in both]
        literals[:, 1] = np.array(told, np.int64)[place]
        used = literals != 0
        for some in product((False, True), repeat=3):
            rows = literals[(used == some).all(axis=1)]
            # By columns: millions of lists would keep the garbage collector busy.
            columns = rows[:, some].T.tolist()
            for clause in zip(*columns, strict=True) if columns else [()] * len(rows):
                self._solver.add_clause(clause)

    def keep_words(self, kept: Mapping[int, int], changes: int) -> None:
        """Require that at most so many states have another word than ``kept`` gives them."""
        changed = [-self._word[state][word] for state, word in sorted(kept.items())]
        self._at_most(changed, changes)

    def add_lex_leaders(self, symmetries: Sequence[Sequence[int]], pairs: Sequence[Pair]) -> None:
        """Of partitions that are images of each other, allow the lexicographic leader.

        That is the one that separates the first of ``pairs`` (and of such the one that separates
        the second, ..).  No proof is lost if the images of every requirement are required as well.

        ``symmetries``: where each takes every state.  ``pairs``: the pairs that are compared.
        """
        for symmetry in symmetries:
            equal_so_far = 0  # the variable; 0: nothing was compared yet
            for states in pairs:
                image = pair(*(symmetry[s] for s in states))
                if image != states:
                    equal_so_far = self._compare(states, image, equal_so_far)

    def _compare(self, states: Pair, image: Pair, equal_so_far: int) -> int:
        """If all was equal so far, ``states`` are separated where ``image`` is.

        Returns the variable "all was equal so far, and they are separated alike".
        """
        here, there = self._is_separated(states), self._is_separated(image)
        before = [-equal_so_far] if equal_so_far else []
        self._solver.add_clause([*before, here, -there])
        equal = self._new()
        self._solver.add_clause([*before, here, there, equal])
        self._solver.add_clause([*before, -here, -there, equal])
        return equal

    def solve(self, conflicts: int | None = None, size: int = sys.maxsize) -> dict[int, int] | None:
        """A partition (state -> word), or None if it is proved that there is none.

        Raises `Undecided` after about so many ``conflicts`` of the solver.  ``size``: only so many
        words are used, where words are not named.
        """
        if size < self.size and not self._used:
            self._count_used()
        if not satisfiable(self._solver, [-word for word in self._used[size:]], conflicts):
            return None
        true = set(self._solver.get_model())
        return {s: next(w for w, v in enumerate(own) if v in true) for s, own in self._word.items()}

    @property
    def conflicts(self) -> int:
        """Those of the solver so far."""
        return int(self._solver.accum_stats()["conflicts"])

    def close(self) -> None:
        """Give back what the solver holds."""
        self._solver.delete()

    def _new(self) -> int:
        self._last += 1
        return self._last

    def _one_word(self, variables: list[int]) -> None:
        self._solver.add_clause(variables)
        for n, b in enumerate(variables):
            for a in variables[:n]:
                self._solver.add_clause([-a, -b])

    def _separate(self, states: Pair) -> int:
        if states not in self._separated:
            variable = self._separated[states] = self._new()
            for a, b in zip(*(self._word[s] for s in states), strict=True):
                self._solver.add_clause([-variable, -a, -b])
        return self._separated[states]

    def _count_used(self) -> None:
        """Say of each word whether it is used, so that the others can be assumed not to be."""
        self._used = [self._new() for _ in range(self.size)]
        self._solver.set_phases(self._used)  # a word that is free may be used
        for own in self._word.values():
            for variable, used in zip(own, self._used, strict=True):
                self._solver.add_clause((-variable, used))

    def _is_separated(self, states: Pair) -> int:
        """The variable of `_separate`, made false where both states have one word."""
        variable = self._separate(states)
        if states not in self._equivalent:
            self._equivalent.add(states)
            for a, b in zip(*(self._word[s] for s in states), strict=True):
                self._solver.add_clause([variable, -a, b])
                self._solver.add_clause([variable, a, -b])
        return variable

    def _separate_all(self, pairs: Clause) -> int:
        if pairs not in self._all_separated:
            variable = self._all_separated[pairs] = self._new()
            for states in sorted(pairs):
                self._solver.add_clause([-variable, self._separate(states)])
        return self._all_separated[pairs]

    def _at_most(self, literals: Sequence[int], number: int) -> None:
        """Allow at most so many literals to be true, by a sequential counter."""
        from pysat.card import CardEnc, EncType

        if number < len(literals):
            counter = EncType.seqcounter
            encoded = CardEnc.atmost(literals, number, top_id=self._last, encoding=counter)
            self._last = max(self._last, encoded.nv)
            for clause in encoded.clauses:
                self._solver.add_clause(clause)

    def _name_words_in_order(self) -> None:
        used: list[int] = []  # used[w]: a state before has word w
        for own in self._word.values():
            if not used:
                self._solver.add_clause([own[0]])
                used = [own[0], *(self._new() for _ in range(1, self.size))]
                for variable in used[1:]:
                    self._solver.add_clause([-variable])
                continue
            for word in range(1, self.size):
                self._solver.add_clause([-own[word], used[word - 1]])
            used = [used[0], *(self._either(used[w], own[w]) for w in range(1, self.size))]

    def _either(self, first: int, second: int) -> int:
        """A variable that is true just where one of two is."""
        variable = self._new()
        self._solver.add_clause([-variable, first, second])
        self._solver.add_clause([variable, -first])
        self._solver.add_clause([variable, -second])
        return variable


class Undecided(Exception):
    """The conflicts allowed are used up, and the formula is not decided."""


def satisfiable(solver: Any, assumptions: Sequence[int] = (), conflicts: int | None = None) -> bool:
    """Whether the clauses of a solver of python-sat can be satisfied.

    ``solver``: made by `planners.search.sat.sat_solver`; signals are heard between slices of its
    work.  ``assumptions``: literals that are assumed besides.  ``conflicts``: conflicts of the
    solver that are allowed, None without limit.  Raises `Undecided` after so many conflicts.
    """
    if address_space_left() < _ROOM:
        raise MemoryError
    spent = 0
    while conflicts is None or spent < conflicts:
        answer = solve_slice(solver, _SLICE, assumptions)
        if answer is not None:
            return answer
        spent += _SLICE
    raise Undecided
