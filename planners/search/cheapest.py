# SPDX-License-Identifier: GPL-3.0-or-later
"""The least second cost component of plans with the least makespan, from cores of a SAT solver.

The cost is assumed to be 0: no action that costs something is done at all.  The solver answers with
a *core*, some of these assumptions that cannot hold together: one of those actions is needed.  Each
core raises the lower bound by one, and from then on one of its actions may be done, and for more
there are new assumptions (core-guided MaxSAT, OLL; Andres, Kaufmann, Matheis and Schaub 2012).  The
first plan that is found is a cheapest one.  Cores are small where goals have little to do with each
other, and a bound on the sum of all costs says nothing for long.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from planners.joint.model import PlanningTask
from planners.search.plan_formula import Literals, PlanFormula


@dataclass(slots=True)
class _Sum:
    """How many of some literals hold: ``at_least[k]`` is implied where more than k do."""

    at_least: Literals


class _Sums:
    """The sums that are assumed to be small, by the literal that says that one is larger."""

    def __init__(self, formula: PlanFormula, steps: int) -> None:
        self._formula, self._steps = formula, steps
        #: Assumed to be false: the sum that each belongs to, and its place there.
        self.open: dict[int, tuple[_Sum | None, int]] = {}
        self._times: dict[int, Literals] = {}

    def add_actions(self) -> None:
        """Assume of every label that costs something that it is not chosen at all."""
        formula = self._formula
        for robot, costs in enumerate(formula.costs):
            for label in np.flatnonzero(costs).tolist():
                times = [formula.label(step, robot, label) for step in range(1, self._steps + 1)]
                done = formula.any_of(times)
                self._times[done] = times
                self.open[done] = (None, 0)

    def relax(self, core: Literals) -> None:
        """Let one of the literals of a core hold; more of them, or one more often, is paid anew."""
        for literal in core:
            own, place = self.open.pop(literal)
            if own is None:
                own = _Sum(self._formula.counter(self._times.pop(literal)))
            if place + 1 < len(own.at_least):
                self.open[own.at_least[place + 1]] = (own, place + 1)
        if len(core) > 1:
            together = _Sum(self._formula.counter(core))
            self.open[together.at_least[1]] = (together, 1)


def least_cost(formula: PlanFormula, task: PlanningTask, steps: int) -> int:
    """The least cost of plans of so many steps, of which there are some; costs are 0 or 1.

    Raises `planners.search.plan_formula.OutOfEffort`.
    """
    sums = _Sums(formula, steps)
    sums.add_actions()
    bound = 0
    while not formula.solvable(task.init, steps, extra=[-literal for literal in sums.open]):
        core = _smaller(formula, task, steps, formula.core(sums.open))
        sums.relax(core)
        bound += 1
    return bound


def _smaller(formula: PlanFormula, task: PlanningTask, steps: int, core: Literals) -> Literals:
    """A core that is no larger: what is needed of it, asked again while that helps."""
    while len(core) > 1:
        answer = formula.solvable(task.init, steps, extra=[-literal for literal in core])
        assert not answer, "a core was refuted"
        again = formula.core(core)
        if len(again) >= len(core):
            break
        core = again
    return core
