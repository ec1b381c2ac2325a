# SPDX-License-Identifier: GPL-3.0-or-later
"""Numbers of words, decided by SAT one by one: from below, from above, with growing budgets."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Generic, TypeVar

from coordlang.vocabulary.sat import PartitionProblem

Requirement = TypeVar("Requirement")

#: A problem starts afresh when it has so many times the requirements that it started with.
_GROWTH = 2


@dataclass(slots=True)
class _Kept:
    """A problem, with the numbers of requirements that it started with and that it has."""

    problem: PartitionProblem
    at_start: int
    known: int


class ProblemsBySize(Generic[Requirement]):
    """The partition problem of each number of words, kept as long as it is undecided.

    So a solver goes on where it stopped.

    Parameters
    ----------
    start
        Makes a problem for a number of words with all requirements that are known.
    require
        Adds one requirement to a problem.
    """

    def __init__(
        self,
        start: Callable[[int, Sequence[Requirement]], PartitionProblem],
        require: Callable[[PartitionProblem, Requirement], None],
    ) -> None:
        self._start, self._require = start, require
        self._kept: dict[int, _Kept] = {}

    def under(self, size: int, requirements: Sequence[Requirement]) -> PartitionProblem:
        """The problem with ``size`` words under all requirements, a list that only grows.

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
        """Forget the problem with ``size`` words: it is decided."""
        if (kept := self._kept.pop(size, None)) is not None:
            kept.problem.close()

    def close(self) -> None:
        """Give back what the solvers hold."""
        for size in list(self._kept):
            self.drop(size)


@dataclass(frozen=True, slots=True)
class SolverBudget:
    """What may be spent on one number of words.

    Attributes
    ----------
    rounds
        Partitions that may be found and refuted.
    conflicts
        Conflicts of the solver for each of them.
    """

    rounds: int = 60
    conflicts: int = 30_000

    def doubled(self) -> SolverBudget:
        """Twice as much of both."""
        return SolverBudget(2 * self.rounds, 2 * self.conflicts)

    def lessened(self, times: int) -> SolverBudget:
        """Half of the rounds, so many times: for problems that come after others."""
        return SolverBudget(self.rounds >> times, self.conflicts)


def close_bounds(
    bounds: Callable[[], tuple[int, int]], decide: Callable[[int, SolverBudget], bool]
) -> None:
    """Decide numbers of words until the bounds meet.

    From below as long as that is quick; what is slow is first closed in from above, to have a good
    language early.

    Parameters
    ----------
    bounds
        Gives the number of words proved to be needed, and the number known to suffice.
    decide
        Decides a number of words, which moves a bound; False when the budget was not enough, which
        then is doubled.
    """
    budget = SolverBudget()
    while True:
        lower, upper = bounds()
        if lower >= upper:
            return
        if decide(lower, budget):
            continue
        middle = (lower + upper) // 2
        if middle == lower or not decide(middle, budget):
            budget = budget.doubled()
