# SPDX-License-Identifier: GPL-3.0-or-later
"""Questions to a SAT solver about plans, with a limit on the effort they take."""

from __future__ import annotations

from array import array
from collections.abc import Iterable, Sequence

import numpy as np

from planners.joint.tables import Ints, ranges
from planners.search.sat import (
    SolverName,
    flat_clauses,
    sat_solver,
    simplified,
    solve_slice,
    split_clauses,
)

#: Hard questions and many easy ones: Glucose takes about half as long as MiniSat for the hard ones,
#: and its version 4.2 half as long as 4.1 for the hardest (least cost in elevators p07: 23 s, 40).
#: CaDiCaL refutes some makespans sooner, and takes much longer to find the least cost.
SOLVER: SolverName = "glucose42"
#: Conflicts between two looks at the limits.
_SLICE = 2_000

Literals = list[int]
#: The robots' labels, step by step.
Plan = list[tuple[int, ...]]


class OutOfEffort(Exception):
    """The solver did not decide a question with the effort that was left."""


class FixedPlans:
    """Which sequences of labels are plans of a task with a number of steps, as clauses.

    Each clause is followed by 0.  ``first`` is per step and robot the variable of its first label,
    in the formula as it is now; as many others follow as ``sizes`` says for the robot.  Of the
    effort, in conflicts of the solver, so much is ``left`` after so many ``calls``.
    """

    def __init__(self, clauses: Ints, sizes: Sequence[int]) -> None:
        self.first: Ints = np.zeros((0, len(sizes)), np.int64)
        self._sizes = sizes
        self.left = self.calls = 0
        self._take(clauses)

    @property
    def steps(self) -> int:
        """How many steps the plans have."""
        return len(self.first)

    def _take(self, clauses: Ints) -> None:
        """Let this be the formula, in a solver of its own."""
        last = int((self.first + np.array(self._sizes) - 1).max(initial=0))
        self.variables = max(int(np.abs(clauses).max(initial=0)), last)
        #: All clauses, each followed by 0.
        self.clauses = array("i", np.asarray(clauses, np.intc).tobytes())
        self._solver = sat_solver(SOLVER, split_clauses(clauses))

    def simplify(self) -> None:
        """Eliminate what can be: mostly far fewer variables are left, other than those of labels.

        There are plans.
        """
        self.close()
        labels = ranges(self.first.reshape(-1), np.tile(self._sizes, self.steps))
        literals = flat_clauses(simplified(self.clauses, labels.tolist()))
        # Labels get the first numbers, then the other variables in the order in which they occur.
        known, at = np.unique(np.append(labels, np.abs(literals[literals != 0])), return_index=True)
        number = np.zeros(int(known[-1]) + 1, np.int64)
        number[known[np.argsort(at)]] = 1 + np.arange(len(known))
        self.first = number[self.first]
        self._take(np.sign(literals) * number[np.abs(literals)])

    def close(self) -> None:
        """Give the solver back."""
        self._solver.delete()

    def so_far(self) -> str:
        """What is asked just now, for messages."""
        return (
            f"question {self.calls:,} to the SAT solver, about plans of {self.steps} joint steps; "
            f"{self.variables:,} variables"
        )

    # ---- the formula

    def put_before(self, clauses: Ints, first: Ints) -> None:
        """Let the plans have one more step before the others, with its robots' first labels."""
        self.first = np.vstack((first, self.first))
        self.variables = max(self.variables, int(np.abs(clauses).max()))
        self.clauses.frombytes(np.asarray(clauses, np.intc).tobytes())
        for clause in split_clauses(clauses):
            self._solver.add_clause(clause)

    def label(self, step: int, robot: int, label: int) -> int:
        """The variable of a robot's label in a step, from 0."""
        return int(self.first[step, robot]) + label

    def add(self, clause: Sequence[int]) -> None:
        """Let one of these literals be true."""
        self.clauses.extend(clause)
        self.clauses.append(0)
        self._solver.add_clause(clause)

    def fresh(self) -> int:
        """A new variable."""
        self.variables += 1
        return self.variables

    def require(self, literals: Sequence[int]) -> None:
        """Let literals be true from now on."""
        for literal in literals:
            self.add([literal])

    def any_of(self, literals: Literals) -> int:
        """A literal that is implied by each of these."""
        implied = self.fresh()
        for literal in literals:
            self.add([-literal, implied])
        return implied

    def some_of(self, literals: Literals) -> int:
        """A literal that says: one of these holds."""
        asked = self.fresh()
        self.add([-asked, *literals])
        return asked

    def counter(self, literals: Literals) -> Literals:
        """Literals, the k-th of which is implied where more than k of these hold: a totalizer."""
        if len(literals) == 1:
            return literals
        half = len(literals) // 2
        left, right = self.counter(literals[:half]), self.counter(literals[half:])
        sums = [self.fresh() for _ in literals]
        for k, literal in enumerate(sums):
            for mine in range(max(0, k + 1 - len(right)), min(len(left), k + 1) + 1):
                holding = [left[mine - 1]] if mine else []
                holding += [right[k - mine]] if k + 1 - mine else []
                self.add([*(-one for one in holding), literal])
        return sums

    # ---- the questions

    def holds(self, literals: Sequence[int] = ()) -> bool:
        """Whether the formula holds with these literals."""
        self.calls += 1
        while True:
            effort = max(1, min(_SLICE, self.left))
            answer = solve_slice(self._solver, effort, literals)
            if answer is not None:
                return answer
            self.spend(effort)

    def excluded(self, literals: Sequence[int]) -> Ints:
        """Variables that are false where these literals hold, as far as unit propagation sees it.

        All of them, where the literals cannot hold.
        """
        holds, implied = self._solver.propagate(list(literals))
        if not holds:
            return np.arange(1, self.variables + 1)
        found = np.array(implied, np.int64)
        return -found[found < 0]

    def labels_chosen(self) -> Plan:
        """The robots' labels in the plan that the last answer found."""
        true = np.array(self._solver.get_model()) > 0
        return [
            tuple(
                int(np.argmax(true[begin - 1 : begin - 1 + size]))
                for begin, size in zip(step, self._sizes, strict=True)
            )
            for step in self.first.tolist()
        ]

    def core(self, literals: Iterable[int]) -> Literals:
        """Of literals whose negations were assumed in the last question: those that refuted it."""
        refuted = {-literal for literal in self._solver.get_core() or ()}
        return sorted(refuted & set(literals))

    # ---- the effort

    def spend(self, effort: int) -> None:
        """Take some of the effort away; raises `OutOfEffort` where it is used up."""
        self.left -= effort
        if self.left < 0:
            raise OutOfEffort
