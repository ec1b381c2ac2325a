# SPDX-License-Identifier: GPL-3.0-or-later
"""The loop of every exact search: counterexamples in, SAT out.

A solver finds a partition that satisfies all clauses known so far; failing plans that it does not
tell apart give new ones.  No partition left: the number that was asked for does not suffice.  No
failing plans left: it is a language.  Work is counted, never timed.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import chain
from math import isqrt

from coordlang.language.warping import Clause
from coordlang.vocabulary.sat import (
    PartitionProblem,
    Requirement,
    Undecided,
    clique,
    most_constrained_first,
    without_implied,
)
from planners.search.sat import SolverName

#: A problem starts afresh when it has so many times the requirements that it started with.
_GROWTH = 2


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


class ProblemsBySize:
    """The partition problem of each number of words, kept as long as it is undecided.

    So a solver goes on where it stopped.

    ``known``: the requirements, a list that only grows.  ``start``: makes a problem for a number
    with all that are known.  ``conflicts``: those of the solvers so far.
    """

    def __init__(
        self, known: Sequence[Requirement], start: Callable[[int], PartitionProblem]
    ) -> None:
        self._known, self._start = known, start
        #: Of each size a problem, and how many requirements it started with.
        self._kept: dict[int, tuple[PartitionProblem, int]] = {}
        self.conflicts = 0

    def find(self, size: int, conflicts: int) -> dict[int, int] | None:
        """A partition into ``size`` words, or None if there is none.

        Raises `Undecided` after so many ``conflicts`` of the solver.  When the requirements have
        grown much, the problem starts afresh: the order of its states was that of few.
        """
        problem, at_start = self._kept.get(size, (None, 0))
        if problem is None or len(self._known) > _GROWTH * at_start:
            self.drop(size)
            problem = self._start(size)
            problem.required = at_start = len(self._known)
            self._kept[size] = problem, at_start
        problem.require(self._known)
        before = problem.conflicts
        try:
            return problem.solve(conflicts)
        finally:
            self.conflicts += problem.conflicts - before

    def drop(self, size: int) -> None:
        """Forget a number that is decided."""
        problem, _ = self._kept.pop(size, (None, 0))
        if problem is not None:
            problem.close()

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
#: Pairs of states, in most clauses, by which symmetric partitions are compared: enough to tell
#: most apart.
_COMPARED_PAIRS = 100


class Partitions(ProblemsBySize):
    """Partitions that satisfy all known clauses, by two solvers.

    The second one is allowed only one of symmetric partitions: proofs are ten times shorter, but
    partitions harder to find.

    ``states``: the states that need words.  ``clauses``: the known clauses about these states, a
    list that only grows.  ``permutations``: where symmetries take each state; the images of every
    clause must be clauses.  ``prover``: the second solver.
    """

    def __init__(
        self,
        states: Sequence[int],
        clauses: Sequence[Clause],
        permutations: Sequence[Sequence[int]],
        prover: SolverName = "glucose42",
    ) -> None:
        super().__init__(clauses, self._started)
        self._states, self._clauses = states, clauses
        self._permutations, self._prover = permutations, prover
        #: Numbers of words with which partitions are so few that the first solver finds none.
        self._hard: set[int] = set()

    def find(self, size: int, conflicts: int) -> dict[int, int] | None:
        """A partition into ``size`` words, see `ProblemsBySize`."""
        if size not in self._hard:
            with suppress(Undecided):
                return super().find(size, _EASY)
            self._hard.add(size)
            self.drop(size)
        return super().find(size, conflicts)

    def _started(self, size: int) -> PartitionProblem:
        clauses = without_implied(self._clauses, _COMPARISONS)
        # States that every language tells apart name their words first: no others are symmetric.
        first = clique(pair for clause in clauses if len(clause) == 1 for pair in clause)
        others = most_constrained_first(set(self._states).difference(first), clauses)
        solver = self._prover if size in self._hard else "cadical153"
        problem = PartitionProblem([*first, *others], size, solver)
        for clause in clauses:
            problem.separate_one(clause)
        if size in self._hard:
            frequency = Counter(chain.from_iterable(self._clauses))
            pairs = sorted(frequency, key=lambda pair: (-frequency[pair], pair))
            problem.add_lex_leaders(self._permutations, pairs[:_COMPARED_PAIRS])
        return problem
