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

import numpy as np

from planners.sat import simplified
from planners.search.questions import Questions
from planners.tables import Ints

#: The robots' labels, step by step.
Plan = list[tuple[int, ...]]


class FixedPlans(Questions):
    """Which sequences of labels are plans, as clauses say it.

    Parameters
    ----------
    clauses
        A formula, each clause followed by 0.
    labels
        Per step, from the first one on, and robot the variables of its labels.
    effort
        The solver's conflicts that may be spent.
    """

    def __init__(self, clauses: array[int], labels: Sequence[Sequence[Ints]], effort: int) -> None:
        sizes = [len(own) for step in labels for own in step]
        super().__init__(effort, sum(sizes))
        self.steps = len(labels)
        #: Per step and robot the variable of its first label.
        self._first = 1 + np.cumsum([0, *sizes])[:-1].reshape(self.steps, -1)
        self._sizes = sizes[: self._first.shape[1]]
        kept = np.concatenate([own for step in labels for own in step])
        self._take(simplified(clauses, kept.tolist()), kept)

    def simplify(self) -> None:
        """Eliminate what can be, now that more is required; other variables are forgotten."""
        labels = np.arange(1, int(self._first[-1, -1]) + self._sizes[-1])
        found = simplified(self.clauses, labels.tolist())
        self.clear(len(labels))
        self._take(found, labels)

    def _take(self, clauses: Sequence[Sequence[int]], labels: Ints) -> None:
        """Clauses with the labels' variables first, and others that occur after them."""
        number = {variable: k for k, variable in enumerate(labels.tolist(), start=1)}
        for clause in clauses:
            renamed = []
            for literal in clause:
                variable = number.setdefault(abs(literal), len(number) + 1)
                renamed.append(variable if literal > 0 else -variable)
            self.add(renamed)
        self.variables = len(number)

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
        true = self.true()
        return [
            tuple(
                int(np.argmax(true[first - 1 : first - 1 + size]))
                for first, size in zip(step, self._sizes, strict=True)
            )
            for step in self._first.tolist()
        ]
