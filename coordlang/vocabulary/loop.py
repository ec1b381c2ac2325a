# SPDX-License-Identifier: GPL-3.0-or-later
"""The loop of every exact search: counterexamples in, SAT out.

A solver finds a partition that satisfies all clauses known so far; failing plans that it does not
tell apart give new ones.  No partition left: the number that was asked for does not suffice.  No
failing plans left: it is a language.  Work is counted, never timed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import islice
from math import isqrt
from typing import Generic, TypeVar

from coordlang.language.warping import Clause
from coordlang.symmetry.group import SymmetryGroup, symmetry_group
from coordlang.vocabulary.job import Assignment, Evidence, Job, words_of_states
from coordlang.vocabulary.refuter import Refuter
from coordlang.vocabulary.sat import (
    PartitionProblem,
    Undecided,
    clique,
    most_constrained_first,
    most_frequent_pairs,
    without_implied,
)
from planners.joint.tables import Ints
from planners.parallel.workers import Workers
from planners.search.plan_space import PlanSpace
from planners.search.sat import SolverName

Requirement = TypeVar("Requirement")

#: A problem starts afresh when it has so many times the requirements that it started with.
_GROWTH = 2


class NecessaryClauses:
    """A growing list of necessary clauses with all their images under a group of symmetries.

    ``clauses`` are in the order in which they were met, ``evidence`` says why each is necessary.
    """

    def __init__(self, group: SymmetryGroup) -> None:
        self.group = group
        self.clauses: list[Clause] = []
        self.evidence: dict[Clause, Evidence] = {}

    def add_all(self, found: Mapping[Clause, Evidence]) -> None:
        """Add clauses with their images; those that others of them imply are left out."""
        for clause in without_implied(found):
            evidence = found[clause]
            self._add([(clause, evidence)])
            self._add(
                (image, replace(evidence, symmetry=symmetry))
                for image, symmetry in self.group.images(clause)
            )

    def _add(self, clauses: Iterable[tuple[Clause, Evidence]]) -> None:
        for clause, evidence in clauses:
            if clause not in self.evidence:
                self.evidence[clause] = evidence
                self.clauses.append(clause)


class Languages:
    """Partitions looked at one after another: each is a language, or gives clauses.

    ``spaces`` are the optimal plans of the tasks, over a table of so many ``states``, and ``group``
    their symmetries; for ``progress``, ``seed`` and ``workers`` see `Job`.  ``known`` are clauses
    that every language satisfies, ``refuter`` tells what is wrong with a partition, and ``rounds``
    counts the partitions looked at.
    """

    def __init__(
        self,
        spaces: Sequence[PlanSpace],
        group: SymmetryGroup,
        states: int,
        seed: int,
        progress: Callable[[str], None] = lambda _: None,
        workers: Workers | None = None,
    ) -> None:
        self._states = states
        self.known = NecessaryClauses(group)
        self.refuter = Refuter(spaces, group, states, seed, progress, workers=workers)
        self.rounds = 0

    @classmethod
    def of(cls, job: Job) -> Languages:
        """The languages for the candidate tasks of a job."""
        candidates = job.candidates
        return cls(
            candidates.spaces,
            symmetry_group(candidates),
            len(candidates.rows),
            job.seed,
            job.progress,
            job.workers,
        )

    @property
    def clauses(self) -> list[Clause]:
        """The clauses known so far, a list that only grows."""
        return self.known.clauses

    def word(self, partition: Assignment) -> Ints:
        """(states) the word of each state number; 0 for states that need none."""
        return words_of_states(partition, self._states)

    def holds(self, partition: Assignment) -> bool:
        """Whether it is a language; if not, the clauses that it violates are known afterwards."""
        self.rounds += 1
        violated = self.refuter.violated(self.word(partition))
        self.known.add_all(violated)
        return not violated


@dataclass(frozen=True, slots=True)
class Budget:
    """What may be spent on one number.

    ``rounds``: partitions that may be found and refuted.  ``conflicts``: conflicts of the solver
    for each of them.
    """

    rounds: int = 60
    conflicts: int = 30_000

    def doubled(self) -> Budget:
        """Twice as much of both."""
        return Budget(2 * self.rounds, 2 * self.conflicts)


def find(
    partition: Callable[[int], dict[int, int] | None],
    holds: Callable[[dict[int, int]], bool],
    budget: Budget,
) -> dict[int, int] | None:
    """The first partition that holds, None if none is left.

    ``partition``: the next one, found within so many conflicts, None if there is none.  ``holds``:
    whether it is what is looked for; if not, it must not come again.  ``budget``: what may be
    spent.  Raises `Undecided` if that was not enough.
    """
    for _ in range(budget.rounds):
        found = partition(budget.conflicts)
        if found is None or holds(found):
            return found
    raise Undecided


def between(lower: int, upper: int) -> int:
    """A number between bounds, nearer to the lower one: most languages need few words."""
    return isqrt(lower * upper)


def close_bounds(
    bounds: Callable[[], tuple[int, int]],
    decide: Callable[[int, Budget], bool],
    is_over: Callable[[], bool] = lambda: False,
) -> None:
    """Decide numbers until the bounds meet, or it is over.

    From below as long as that is quick; what is slow is first closed in from above, to have a good
    language early: a number between, and if that is slow, too, numbers nearer to what suffices.

    ``bounds``: gives the number proved to be needed, and the number known to suffice.  ``decide``:
    decides a number, which moves a bound; False when the budget was not enough, which then is
    doubled.  ``is_over``: whether to end early.
    """
    budget = Budget()
    while not is_over():
        lower, upper = bounds()
        if lower >= upper:
            return
        if decide(lower, budget):
            continue
        middle = max(lower + 1, between(lower, upper))
        while middle < upper and not is_over():
            if decide(middle, budget):
                break
            middle = max(middle + 1, between(middle, upper))
        else:
            budget = budget.doubled()


@dataclass(slots=True)
class _Kept:
    """A problem, with the numbers of requirements that it started with and that it has."""

    problem: PartitionProblem
    at_start: int
    known: int


class ProblemsBySize(Generic[Requirement]):
    """The partition problem of each number, kept as long as it is undecided.

    So a solver goes on where it stopped.

    ``start``: makes a problem for a number with all requirements that are known.  ``require``: adds
    one requirement to a problem.
    """

    def __init__(
        self,
        start: Callable[[int, Sequence[Requirement]], PartitionProblem],
        require: Callable[[PartitionProblem, Requirement], None],
    ) -> None:
        self._start, self._require = start, require
        self._kept: dict[int, _Kept] = {}

    def under(self, size: int, requirements: Sequence[Requirement]) -> PartitionProblem:
        """The problem of a number under all requirements, a list that only grows.

        When it has grown much, the problem starts afresh: the order of its states was that of few
        requirements.
        """
        kept = self._kept.get(size)
        if kept is None or len(requirements) > _GROWTH * kept.at_start:
            self.drop(size)
            number = len(requirements)
            kept = self._kept[size] = _Kept(self._start(size, requirements), number, number)
        for requirement in requirements[kept.known :]:
            self._require(kept.problem, requirement)
        kept.known = len(requirements)
        return kept.problem

    def drop(self, size: int) -> None:
        """Forget a number that is decided."""
        if (kept := self._kept.pop(size, None)) is not None:
            kept.problem.close()

    def close(self) -> None:
        """Give back what the solvers hold."""
        for size in list(self._kept):
            self.drop(size)


# ---- partitions under all clauses known so far


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
