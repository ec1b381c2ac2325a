# SPDX-License-Identifier: GPL-3.0-or-later
"""SAT solvers of python-sat, made safe against signals."""

from __future__ import annotations

from array import array
from collections.abc import Iterable, Iterator, Sequence
from functools import cache
from typing import Any, Literal

import numpy as np

from planners.joint.tables import Ints
from planners.system.signals import postponed_signals

#: Clauses that are lists of numbers at a time, for these take far more memory.
_BLOCK = 1 << 16
#: Rounds of elimination: what one leaves, the next one may eliminate.  Six take hardly longer than
#: three and leave 22,491 clauses of 57,419 in blocksworld 9-2; in logistics 14-0 the least cost is
#: found in two thirds of the time.
_ROUNDS = 6

#: The solvers in use.  None of MapleChrono and MapleCM: they take SIGALRM for themselves, below
#: Python, so that no time limit would be heard any more.
SolverName = Literal["cadical153", "cadical195", "glucose4", "glucose42", "maplesat", "minisat22"]


def sat_solver(name: SolverName, clauses: Iterable[Sequence[int]] = ()) -> Any:
    """A solver of python-sat that a signal at any moment leaves whole.

    It has some clauses; it is a context manager, and is given back by ``delete()``.
    """
    from pysat.solvers import Solver

    solver = whole(Solver)(name=name)
    for clause in clauses:
        solver.add_clause(clause)
    return solver


def solve_slice(solver: Any, conflicts: int, assumptions: Sequence[int] = ()) -> bool | None:
    """Whether the clauses can be satisfied; None if ``conflicts`` did not decide it.

    Signals are heard before and after, and not while the solver works.
    """
    solver.conf_budget(conflicts)
    answer = solver.solve_limited(assumptions=list(assumptions))
    return None if answer is None else bool(answer)


def simplified(clauses: array[int], kept: Sequence[int]) -> list[list[int]]:
    """Clauses that allow the same values of the kept variables, mostly over far fewer variables.

    ``clauses`` (each followed by 0) can be satisfied.  Any variable may be left without a clause.
    """
    from pysat.solvers import Cadical153

    # Not by pysat's Processor, which copies every number of the clauses that it found.
    with postponed_signals(), Cadical153() as solver:
        for clause in split_clauses(clauses):
            solver.add_clause(clause)
        _, found = solver.process(rounds=_ROUNDS, freeze=list(kept))
    assert [] not in found, "clauses that a model was found of were refuted"
    return list(found)


def flat_clauses(clauses: Iterable[Sequence[int]]) -> Ints:
    """Clauses one after another, each followed by 0."""
    return np.array([literal for clause in clauses for literal in (*clause, 0)], np.int64)


def split_clauses(clauses: array[int] | Ints) -> Iterator[list[int]]:
    """The clauses of a formula in which 0 follows each."""
    literals = np.asarray(clauses)
    blocks = np.flatnonzero(literals == 0)[_BLOCK - 1 :: _BLOCK] + 1
    for some in np.split(literals, blocks):
        begin, listed = 0, some.tolist()
        for end in np.flatnonzero(some == 0).tolist():
            yield listed[begin:end]
            begin = end + 1


@cache
def whole(kind: Any) -> Any:
    """A class of python-sat whose objects a signal at any moment leaves whole.

    ``kind`` is freed by ``delete()``: a solver, or what is made of solvers.  All solvers of
    python-sat leave SIGINT to Python from now on.  In the main thread they would be left at SIGINT
    by ``longjmp`` from wherever they are, the allocation of memory included, and leave a handler
    behind: the process crashes or hangs.
    """
    from pysat.solvers import MainThread

    MainThread.check = staticmethod(lambda: False)

    class Whole(kind):  # type: ignore[misc]
        """One that is freed once, though a signal arrives when it has just been freed."""

        def delete(self) -> None:
            with postponed_signals():
                super().delete()

    return Whole
