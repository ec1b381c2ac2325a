# SPDX-License-Identifier: GPL-3.0-or-later
"""The plans of one task and length as a small formula, for many easy questions about them.

Every question that is answered with yes gives all variables a value, so what counts is how many
there are.  All variables but the robots' labels are eliminated where that makes the formula no
larger (bounded variable elimination; Eén and Biere 2005), and those that are left are numbered
anew.
"""

from __future__ import annotations

import sys
from array import array
from collections.abc import Sequence

import numpy as np

from planners.sat import simplified
from planners.search.questions import Questions
from planners.tables import Ints

#: The robots' labels, step by step.
Plan = list[tuple[int, ...]]


class FixedPlans(Questions):
    """Which sequences of labels are plans, as clauses say it; questions may take any effort.

    Parameters
    ----------
    clauses
        A formula, each clause followed by 0.
    labels
        Per step, from the first one on, and robot the variables of its labels.
    """

    def __init__(self, clauses: array[int], labels: Sequence[Sequence[Ints]]) -> None:
        kept = np.concatenate([own for step in labels for own in step])
        super().__init__(sys.maxsize, len(kept))
        sizes = [[len(own) for own in step] for step in labels]
        self.steps = len(labels)
        #: Per step and robot the variable of its first label.
        self._first = 1 + np.cumsum([0, *(n for step in sizes for n in step)])[:-1].reshape(
            self.steps, -1
        )
        self._sizes = sizes[0]
        for clause in self._numbered(simplified(clauses, kept.tolist()), kept):
            self.add(clause)

    def smaller(self) -> FixedPlans:
        """The same plans, with what is required by now simplified away; this one is closed."""
        labels = [
            [np.arange(size) + first for first, size in zip(step, self._sizes, strict=True)]
            for step in self._first
        ]
        found = FixedPlans(self.clauses, labels)
        self.close()
        return found

    def _numbered(self, clauses: Sequence[Sequence[int]], kept: Ints) -> list[list[int]]:
        """The clauses with the kept variables first, and others that occur after them."""
        number = {variable: k for k, variable in enumerate(kept.tolist(), start=1)}
        found = []
        for clause in clauses:
            renamed = []
            for literal in clause:
                variable = number.setdefault(abs(literal), len(number) + 1)
                renamed.append(variable if literal > 0 else -variable)
            found.append(renamed)
        self.variables = len(number)
        return found

    def so_far(self) -> str:
        """What is asked just now, for messages."""
        return (
            f"question {self.calls:,} to the SAT solver, about optimal plans of {self.steps} joint "
            f"steps; {self.variables:,} variables"
        )

    def firsts(self, depth: int) -> Ints:
        """The variables of the robots' first labels, in so many first steps: (depth, robots)."""
        return self._first[:depth]

    def label(self, step: int, robot: int, label: int) -> int:
        """The variable of a robot's label in a step, from 0."""
        return int(self._first[step, robot]) + label

    def labels_chosen(self) -> Plan:
        """The robots' labels in the plan that the last answer found."""
        true = self.true()
        return [
            tuple(
                int(np.argmax(true[first - 1 : first - 1 + size]))
                for first, size in zip(step, self._sizes, strict=True)
            )
            for step in self._first.tolist()
        ]
