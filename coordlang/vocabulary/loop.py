# SPDX-License-Identifier: GPL-3.0-or-later
"""The loop of every exact search: counterexamples in, SAT out.

A solver finds a partition that satisfies all clauses known so far; failing plans that it does not
tell apart give new ones.  No partition left: the number that was asked for does not suffice.  No
failing plans left: it is a language.  Work is counted, never timed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import isqrt
from typing import Generic, TypeVar

from coordlang.language.warping import Clause
from coordlang.symmetry.group import SymmetryGroup, symmetry_group
from coordlang.vocabulary.clauses import without_implied
from coordlang.vocabulary.job import Assignment, Evidence, Job, words_of_states
from coordlang.vocabulary.refuter import Refuter
from coordlang.vocabulary.sat import PartitionProblem, Undecided
from planners.joint.tables import Ints
from planners.parallel.workers import Workers
from planners.search.plan_space import PlanSpace

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
