# SPDX-License-Identifier: GPL-3.0-or-later
"""The plans of one task and length as a small formula, for many easy questions about them.

Every question that is answered with yes gives all variables a value, so what counts is how many
there are.  All variables but the robots' labels are eliminated where that makes the formula not
much larger (bounded variable elimination; Eén and Biere 2005), again when more is known of optimal
plans, and those that are left are numbered anew.
"""

from __future__ import annotations

from array import array
from collections.abc import Sequence
from itertools import chain

import numpy as np

from planners.sat import simplified
from planners.search.questions import Plan, Questions
from planners.tables import Ints, ranges


class FixedPlans(Questions):
    """Which sequences of labels are plans, as clauses say it.

    Parameters
    ----------
    clauses
        A formula, each clause followed by 0.
    first
        Per step, from the first one on, and robot the variable of its first label; the others
        follow.
    sizes
        Per robot how many labels there are.
    effort
        The solver's conflicts that may be spent.
    """

    def __init__(self, clauses: array[int], first: Ints, sizes: Sequence[int], effort: int) -> None:
        self.steps, self._sizes = len(first), sizes
        runs = np.tile(sizes, self.steps)
        super().__init__(effort, int(runs.sum()))
        kept = ranges(first.reshape(-1), runs)
        #: Per step and robot the variable of its first label.
        self._first: Ints = 1 + (np.cumsum(runs) - runs).reshape(first.shape)
        self._take(simplified(clauses, kept.tolist()), kept)

    def simplify(self) -> None:
        """Eliminate what can be, now that more is required; other variables are forgotten."""
        labels = np.arange(1, int(self._first[-1, -1]) + self._sizes[-1])
        found = simplified(self.clauses, labels.tolist())
        self.clear(len(labels))
        self._take(found, labels)

    def _take(self, clauses: Sequence[Sequence[int]], labels: Ints) -> None:
        """Clauses with the labels' variables first, and others that occur after them."""
        sizes = np.fromiter(map(len, clauses), np.int64, len(clauses))
        literals = np.fromiter(chain.from_iterable(clauses), np.int64, int(sizes.sum()))
        variables = np.abs(literals)
        number = np.zeros(int(max(variables.max(initial=0), labels.max(initial=0))) + 1, np.int64)
        number[labels] = np.arange(1, len(labels) + 1)
        others, first = np.unique(variables[number[variables] == 0], return_index=True)
        self.variables = len(labels) + len(others)
        number[others[np.argsort(first)]] = np.arange(len(labels) + 1, self.variables + 1)
        self.add_all(np.insert(np.sign(literals) * number[variables], np.cumsum(sizes), 0))

    def so_far(self) -> str:
        """What is asked just now, for messages."""
        return (
            f"question {self.calls:,} to the SAT solver, about plans of {self.steps} joint steps "
            f"from the start; {self.variables:,} variables"
        )

    def firsts(self, depth: int) -> Ints:
        """The variables of the robots' first labels, in so many first steps: (depth, robots)."""
        return self._first[:depth]

    def label(self, step: int, robot: int, label: int) -> int:
        """The variable of a robot's label in a step, from 0."""
        return int(self._first[step, robot]) + label

    def labels_chosen(self) -> Plan:
        """The robots' labels in the plan that the last answer found."""
        return self.chosen(self._first, self._sizes)
