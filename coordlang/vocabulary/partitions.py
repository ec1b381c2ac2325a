# SPDX-License-Identifier: GPL-3.0-or-later
"""Partitions under all clauses known so far, and the proof that there is none."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import islice

from coordlang.language.warping import Clause
from coordlang.vocabulary.clauses import (
    clique,
    most_constrained_first,
    most_frequent_pairs,
    without_implied,
)
from coordlang.vocabulary.job import Evidence
from coordlang.vocabulary.loop import NecessaryClauses, ProblemsBySize
from coordlang.vocabulary.sat import PartitionProblem, Undecided
from planners.search.sat import SolverName

#: Conflicts within which most partitions are found; after so many the solver is likely on the way
#: to a proof.
_EASY = 1_000
#: Comparisons of clauses to find which are implied, a second's work: the solver finds the others.
_COMPARISONS = 1_000_000
#: Pairs of states by which symmetric partitions are compared: enough to tell most apart.
_COMPARED_PAIRS = 100


@dataclass(frozen=True, slots=True)
class Refutation:
    """Among all partitions into ``size`` words none satisfies the first ``known`` clauses.

    ``evidence`` are necessary clauses in their order, to which more are added later.  Nothing but
    this raises a lower bound.  Searches of some partitions only have none to give.
    """

    size: int
    evidence: Mapping[Clause, Evidence]
    known: int

    @classmethod
    def of(cls, size: int, known: NecessaryClauses) -> Refutation:
        """All clauses that are known now refute so many words."""
        return cls(size, known.evidence, len(known.clauses))

    @property
    def clauses(self) -> dict[Clause, Evidence]:
        """The clauses, and why each of them is necessary."""
        return dict(islice(self.evidence.items(), self.known))


class Partitions:
    """Partitions that satisfy all known clauses, by two solvers.

    The second one is allowed only one of symmetric partitions: proofs are ten times shorter, but
    partitions harder to find.

    ``states``: the states that need words.  ``clauses``: the known clauses about these states, a
    list that only grows.  ``permutations``: where symmetries take each state; the images of every
    clause must be clauses.  ``prover``: the second solver.  ``conflicts``: those of the solvers so
    far.
    """

    def __init__(
        self,
        states: Sequence[int],
        clauses: Sequence[Clause],
        permutations: Sequence[Sequence[int]],
        prover: SolverName = "glucose42",
    ) -> None:
        self._states, self._clauses, self._permutations = states, clauses, permutations
        self._prover = prover
        self.conflicts = 0
        require = PartitionProblem.separate_one
        #: Numbers of words with which partitions are so few that the first solver finds none.
        self._hard: set[int] = set()
        self._all = ProblemsBySize(self._start, require)
        self._up_to_symmetry = ProblemsBySize(self._start_up_to_symmetry, require)

    def find(self, size: int, conflicts: int) -> dict[int, int] | None:
        """A partition into ``size`` words, or None if there is none.

        ``size``: the number of words.  ``conflicts``: conflicts of the solver that are allowed.
        Raises `Undecided` after so many conflicts.
        """
        if size not in self._hard:
            with suppress(Undecided):
                return self._solved(self._all.under(size, self._clauses), _EASY)
            self._hard.add(size)
            self._all.drop(size)
        return self._solved(self._up_to_symmetry.under(size, self._clauses), conflicts)

    def _solved(self, problem: PartitionProblem, conflicts: int) -> dict[int, int] | None:
        before = problem.conflicts
        try:
            return problem.solve(conflicts)
        finally:
            self.conflicts += problem.conflicts - before

    def drop(self, size: int) -> None:
        """Forget a number of words that is decided."""
        for problems in (self._all, self._up_to_symmetry):
            problems.drop(size)

    def close(self) -> None:
        """Give back what the solvers hold."""
        for problems in (self._all, self._up_to_symmetry):
            problems.close()

    def _start(
        self, size: int, known: Sequence[Clause], solver: SolverName = "cadical153"
    ) -> PartitionProblem:
        clauses = without_implied(known, _COMPARISONS)
        # States that every language tells apart name their words first: no others are symmetric.
        first = clique(pair for clause in clauses if len(clause) == 1 for pair in clause)
        others = most_constrained_first(set(self._states).difference(first), clauses)
        problem = PartitionProblem([*first, *others], size, solver)
        for clause in clauses:
            problem.separate_one(clause)
        return problem

    def _start_up_to_symmetry(self, size: int, known: Sequence[Clause]) -> PartitionProblem:
        problem = self._start(size, known, self._prover)
        pairs = most_frequent_pairs(known, _COMPARED_PAIRS)
        problem.add_lex_leaders(self._permutations, pairs)
        return problem
