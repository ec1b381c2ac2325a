# SPDX-License-Identifier: GPL-3.0-or-later
"""The least number of words, with proof: counterexamples in, SAT out.

Loop for K words: find a partition that satisfies all clauses so far; look for plans of one sentence
whose mixture fails; each such tuple gives a clause that every language must satisfy
(`coordlang.language.warping`).  No partition left: K words do not suffice.  No counterexample left:
a language.  Numbers of words are tried from below, and from above where that takes long, with the
same clauses, until the two meet.  The result is least among partitions (the paper's ``D_MinW+``);
Proposition 8 of docs/concepts.md allows for symmetries.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from contextlib import closing, suppress
from dataclasses import dataclass, replace
from math import isqrt

import numpy as np

from coordlang.language.warping import Clause
from coordlang.symmetry.group import SymmetryGroup, symmetry_group
from coordlang.vocabulary.clauses import (
    most_constrained_first,
    most_frequent_pairs,
    without_implied,
)
from coordlang.vocabulary.equivariant import EquivariantSearch
from coordlang.vocabulary.job import Assignment, Evidence, Job, Outcome
from coordlang.vocabulary.necessary_clauses import NecessaryClauses
from coordlang.vocabulary.problems_by_size import ProblemsBySize, SolverBudget
from coordlang.vocabulary.refuter import Refuter
from coordlang.vocabulary.sat import PartitionProblem, Undecided
from coordlang.vocabulary.separating import short_separating_search
from planners.errors import OutOfMemory
from planners.limits import run_until_stopped
from planners.sat import SolverName
from planners.search.plan_space import PlanSpace

#: Combinations of plans' next steps up to which separating words are looked for first.
_SEPARATING_COMBINATIONS = 4_000_000
#: Conflicts within which most partitions are found; after so many the solver is likely on the way
#: to a proof.
_EASY = 1_000
#: Comparisons of clauses to find which are implied, a second's work: the solver finds the others.
_COMPARISONS = 1_000_000
#: Pairs of states by which symmetric partitions are compared: enough to tell most apart.
_COMPARED_PAIRS = 100


def minimal(job: Job) -> Outcome:
    """A language with the fewest words among all partitions.

    Anytime: out of time or memory, or interrupted, it returns the best language found with the
    lower bound proved so far, and the error in ``stopped``.
    """
    with closing(_Search(job)) as search:
        stopped = run_until_stopped(search.run)
    if search.best is None:
        assert stopped is not None
        raise stopped
    return Outcome(
        search.best,
        search.lower,
        search.figures(),
        stopped,
        search.known.evidence,
        search.refuting,
    )


def refuting_clauses(job: Job, size: int) -> Mapping[Clause, Evidence]:
    """Necessary clauses that no partition into ``size`` words satisfies together.

    Not anytime: it takes as long as the proof takes.

    Raises
    ------
    ValueError
        If there is a language with so few words.
    """
    with closing(_Search(replace(job, incumbent=None))) as search:
        if not search.refutes(size):
            raise ValueError(f"there is a language with {size} words")
    return search.known.evidence


@dataclass(frozen=True, slots=True)
class Refutation:
    """Among all partitions into ``size`` words none satisfies the first so many known clauses.

    Nothing but this raises a lower bound.  Searches of some partitions only have none to give.
    """

    size: int
    clauses: int


class _Search:
    """Closes in on the least number of words.

    ``lower`` words are proved to be needed, by the first ``refuting`` of the ``known`` clauses;
    ``best`` is a language.
    """

    def __init__(self, job: Job) -> None:
        self._job = job
        self.lower = job.lower_bound
        self.refuting = 1  # any clause refutes one word
        self.best: Assignment | None = job.incumbent
        self.known = NecessaryClauses(SymmetryGroup(()))
        self._partitions = _Partitions(job.states, self.known)
        self._refuter: Refuter | None = None
        self._equivariant: EquivariantSearch | None = None
        self._rounds = 0

    @property
    def _upper(self) -> int:
        return len(set(self.best.values())) if self.best is not None else len(self._job.states)

    def run(self) -> None:
        """Close the bounds."""
        job = self._job
        if not job.first_differences.requiring:
            self.best = dict.fromkeys(job.states, 0)
            return
        self._prepare()
        self._look_for_separating_words()
        separating = self.best
        self._close_bounds()
        if self.best is separating:
            # It separates more than a language must: one that does not leaves more plans open.
            self._decide(self.lower, SolverBudget())

    def refutes(self, size: int) -> bool:
        """Whether every partition that is a language has more words than ``size``."""
        self._prepare()
        return self._decide(size, SolverBudget(sys.maxsize, sys.maxsize)) and self.lower > size

    def figures(self) -> dict[str, float]:
        """The work done."""
        figures: dict[str, float] = {
            "rounds": self._rounds,
            "clauses": len(self.known.clauses),
            "symmetries": len(self.known.group.symmetries),
        }
        if self._refuter is not None:
            figures |= {"counterexamples": len(self._refuter.pool), "walks": self._refuter.walks}
        if self._equivariant is not None:
            figures |= {"equivariant_rounds": self._equivariant.rounds}
        return figures

    def close(self) -> None:
        """Give back what the solvers hold."""
        self._partitions.close()

    def _prepare(self) -> Refuter:
        if self._refuter is None:
            candidates, job = self._job.candidates, self._job
            self.known.group = symmetry_group(candidates)
            self._refuter = Refuter(
                candidates.spaces, self.known.group, len(candidates.rows), job.seed, job.progress
            )
        return self._refuter

    def _close_bounds(self) -> None:
        """Decide numbers of words until the bounds meet: from below, and from above by symmetry."""
        equivariant = self._equivariant = EquivariantSearch(self._job.states, self._prepare())
        budget = SolverBudget()
        while self.lower < self._upper:
            if self._decide(self.lower, budget):
                continue
            if self._upper > self.lower + 1 and self._descend(equivariant, self.lower + 1):
                continue
            budget = budget.doubled()
            if not self._decide(self.lower, budget):
                self._descend(equivariant, self.lower)

    def _descend(self, equivariant: EquivariantSearch, least: int) -> bool:
        """Look for fewer words among equivariant partitions; whether a language was found.

        Numbers of words from ``least`` up are tried.

        What is not found is no bound: only `Refutation` is.
        """
        before = self._upper
        size = isqrt(least * self._upper)
        while size < self._upper:
            self._job.progress(
                f"symmetric words: trying {size}, {self.lower} to {self._upper} needed"
            )
            found = equivariant.find(size)
            if found is None:
                size = (size + self._upper + 1) // 2
            else:
                self._take(found)
                size = isqrt(least * self._upper)
        return self._upper < before

    def _look_for_separating_words(self) -> None:
        """Take a separating partition with fewer words, if a short search finds one.

        Not where it takes long and there are symmetries: equivariant words are fewer.
        """
        spaces = self._job.candidates.spaces
        most = _SEPARATING_COMBINATIONS // (1 + len(self.known.group.symmetries))
        if sum(map(_combinations, spaces)) > most:
            return
        found = short_separating_search(replace(self._job, incumbent=self.best))
        self.best = found.partition
        # Its walk may be larger than ours, which needs none of it; but time that is over is over.
        if found.stopped is not None and not isinstance(found.stopped, OutOfMemory):
            raise found.stopped

    def _decide(self, size: int, budget: SolverBudget) -> bool:
        """Find a language with ``size`` words or prove that there is none.

        False if the budget was not enough.
        """
        try:
            found = self._refine(size, budget)
        except Undecided:
            return False
        self._partitions.drop(size)
        if isinstance(found, Refutation):
            # In this order: a signal in between leaves more clauses than the bound needs.
            self.refuting = found.clauses
            self.lower = found.size + 1
        else:
            self._take(found)
        return True

    def _take(self, partition: Assignment) -> None:
        """A language with fewer words, once it is verified by definition."""
        self._job.check(partition)
        self.best = partition

    def _refine(self, size: int, budget: SolverBudget) -> Assignment | Refutation:
        """The loop for one number of words: a language, or that there is none."""
        refuter, rows = self._prepare(), len(self._job.candidates.rows)
        refuted = 0
        while (partition := self._partitions.find(size, budget.conflicts)) is not None:
            if refuted >= budget.rounds:
                raise Undecided
            word = np.zeros(rows, np.int64)
            word[list(partition)] = list(partition.values())
            violated = refuter.violated(word)
            if not violated:
                return partition
            refuted += 1
            self._rounds += 1
            self.known.add_all(violated)
            self._job.progress(
                f"trying {size} words, {self.lower} to {self._upper} needed: "
                f"round {self._rounds}, {len(self.known.clauses):,} clauses"
            )
        return Refutation(size, len(self.known.clauses))


class _Partitions:
    """Partitions that satisfy all known clauses, by two solvers.

    The second one is allowed only one of symmetric partitions: proofs are ten times shorter, but
    partitions harder to find.
    """

    def __init__(self, states: Sequence[int], known: NecessaryClauses) -> None:
        self._states, self._known = states, known
        require = PartitionProblem.separate_one
        self._all = ProblemsBySize(self._start, require)
        self._up_to_symmetry = ProblemsBySize(self._start_up_to_symmetry, require)

    def find(self, size: int, conflicts: int) -> dict[int, int] | None:
        """A partition into ``size`` words, or None if there is none.

        Raises `Undecided` after so many conflicts.
        """
        clauses = self._known.clauses
        with suppress(Undecided):
            return self._all.under(size, clauses).solve(_EASY)
        return self._up_to_symmetry.under(size, clauses).solve(conflicts)

    def drop(self, size: int) -> None:
        """Forget a number of words that is decided."""
        self._all.drop(size)
        self._up_to_symmetry.drop(size)

    def close(self) -> None:
        """Give back what the solvers hold."""
        self._all.close()
        self._up_to_symmetry.close()

    def _start(
        self, size: int, known: Sequence[Clause], solver: SolverName = "cadical153"
    ) -> PartitionProblem:
        clauses = without_implied(known, _COMPARISONS)
        problem = PartitionProblem(most_constrained_first(self._states, clauses), size, solver)
        for clause in clauses:
            problem.separate_one(clause)
        return problem

    def _start_up_to_symmetry(self, size: int, known: Sequence[Clause]) -> PartitionProblem:
        problem = self._start(size, known, "glucose4")
        pairs = most_frequent_pairs(known, _COMPARED_PAIRS)
        problem.add_lex_leaders(self._known.group.permutations, pairs)
        return problem


def _combinations(space: PlanSpace) -> float:
    """At most so many links has the walk to last differences: one edge for each plan, in step."""
    of_goals = (np.bincount(space.goal[layer.source]) for layer in space.edges_by_layer())
    return sum(float((edges.astype(np.float64) ** space.robots).sum()) for edges in of_goals)
