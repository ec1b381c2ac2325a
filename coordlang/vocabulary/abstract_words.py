# SPDX-License-Identifier: GPL-3.0-or-later
"""Languages whose words depend on an abstraction of the states alone.

Abstract states take the place of states: there are few of them, so a solver finds partitions into
few words soon, and few failing plans refute most of them.  **What is not found proves nothing about
numbers of words**: other partitions may be languages.  So `AbstractSearch.find` returns a language
or None, which carries nothing else.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from coordlang.language.warping import Clause
from coordlang.vocabulary.abstractions import up_to_symmetry
from coordlang.vocabulary.clauses import most_constrained_first
from coordlang.vocabulary.job import Assignment
from coordlang.vocabulary.problems_by_size import ProblemsBySize, SolverBudget
from coordlang.vocabulary.recent_tuples import RecentTuples
from coordlang.vocabulary.refuter import Refuter
from coordlang.vocabulary.sat import PartitionProblem, Undecided
from planners.joint.tables import Ints
from planners.search.sat import SolverName

#: Clauses that are taken of a refuted partition, and failing tuples after which longer ones are not
#: looked for.
_AT_ONCE, _ENOUGH = 300, 900
#: All failing tuples are asked where fewer of the recent ones agree.
_FEW = 100
#: What may be spent on an abstraction at first: refuted partitions, conflicts for each of them.
_FIRST = SolverBudget(rounds=60, conflicts=1_000)
#: Abstractions that are looked at with this effort: as many again have half of it, and so on.
_FOREMOST = 1
#: A solver that is quick on many easy problems with many solutions.
_SOLVER: SolverName = "minisat22"


class AbstractSearch:
    """Looks for languages among the partitions that some abstractions allow.

    Parameters
    ----------
    abstractions
        (states) the abstract state of each state, of each abstraction; see
        `coordlang.vocabulary.abstractions`.  Of those that look alike one is taken.
    states
        Numbers of the states that need words.
    refuter
        Tells what is wrong with a partition.
    seed
        Of what is drawn at random: which clauses are taken.

    Attributes
    ----------
    rounds
        Refuted partitions.
    """

    def __init__(
        self, abstractions: Sequence[Ints], states: Sequence[int], refuter: Refuter, seed: int
    ) -> None:
        self._states, self._pool = states, refuter.pool
        self._problems = [
            _Abstraction(classes, sorted(set(classes[list(states)].tolist())))
            for classes in up_to_symmetry(abstractions, refuter.pool.images)
        ]
        self._recent = RecentTuples(refuter, _ENOUGH, _FEW)
        self._budgets: dict[int, SolverBudget] = {}
        self._random = np.random.default_rng(seed)
        self.rounds = 0

    def find(self, size: int) -> Assignment | None:
        """A language with at most ``size`` words, None if none was found with some effort.

        The next call with this size goes on, and spends more.  Coarse abstractions that are not
        decided have more of it than fine ones.
        """
        budget = self._budgets.get(size, _FIRST)
        self._budgets[size] = budget.doubled()
        undecided = 0
        for problem in self._problems:
            if problem.refuted >= size:
                continue
            own = budget.lessened(undecided // _FOREMOST)
            try:
                word = self._of(problem, size, own)
            except Undecided:
                undecided += 1
                continue
            problem.by_size.drop(size)
            if word is not None:
                return {state: int(word[state]) for state in self._states}
            problem.refuted = size
        return None

    def left(self, size: int) -> list[Ints]:
        """The abstractions that may have a language with so few words, up to symmetry."""
        return [problem.classes for problem in self._problems if problem.refuted < size]

    def close(self) -> None:
        """Give back what the solvers hold."""
        for problem in self._problems:
            problem.by_size.close()

    def _of(self, problem: _Abstraction, size: int, budget: SolverBudget) -> Ints | None:
        """The words of a language that one abstraction allows; None if there is none.

        Raises `Undecided` after so much effort, and can go on.
        """
        for _ in range(budget.rounds):
            word = problem.partition(size, budget.conflicts)
            if word is None:
                return None
            agreeing = self._recent.agreeing(word)
            if not agreeing:
                return word
            self.rounds += 1
            problem.add(self._pool.codes(word, agreeing, _AT_ONCE, self._random))
        raise Undecided


@dataclass(slots=True)
class _Abstraction:
    """An abstraction with what is known of it.

    Attributes
    ----------
    classes
        (states) the abstract state of each state.
    abstract
        The abstract states that need words.
    clauses
        One of these pairs of abstract states must be separated.
    refuted
        The greatest number of words that do not suffice for it.
    by_size
        The problems of the numbers of words that are undecided.
    """

    classes: Ints
    abstract: list[int]
    clauses: list[Clause] = field(default_factory=list)
    refuted: int = 0
    by_size: ProblemsBySize[Clause] = field(init=False)
    _known: set[Clause] = field(default_factory=set)

    def __post_init__(self) -> None:
        self.by_size = ProblemsBySize(self._start, PartitionProblem.separate_one)

    def partition(self, size: int, conflicts: int) -> Ints | None:
        """(states) words under all clauses; None if there is no such partition."""
        found = self.by_size.under(size, self.clauses).solve(conflicts)
        if found is None:
            return None
        word = np.zeros(int(self.classes.max()) + 1, np.int64)
        word[list(found)] = list(found.values())
        return word[self.classes]

    def add(self, codes: Ints) -> None:
        """Add clauses about states: codes ``a * states + b`` of pairs, -1 for none, in each row."""
        states, radix = len(self.classes), int(self.classes.max()) + 1
        a, b = self.classes[codes // states], self.classes[codes % states]
        pairs = np.minimum(a, b) * radix + np.maximum(a, b)
        pairs[(codes < 0) | (a == b)] = -1
        pairs.sort(axis=1)
        for row in np.unique(pairs, axis=0).tolist():
            clause = frozenset(divmod(code, radix) for code in row if code >= 0)
            if clause not in self._known:
                self._known.add(clause)
                self.clauses.append(clause)

    def _start(self, size: int, clauses: Sequence[Clause]) -> PartitionProblem:
        order = most_constrained_first(self.abstract, clauses)
        problem = PartitionProblem(order, size, _SOLVER)
        for clause in clauses:
            problem.separate_one(clause)
        return problem
