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

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from planners.joint.model import JointModel, PlanningTask
from planners.search.goals import goal_facts
from planners.search.plan_formula import PlanFormula
from planners.search.questions import Literals, OutOfEffort

#: Conflicts for the question whether a core needs a second action, too.
_EASY = 1_000


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

    def add_actions(self, task: PlanningTask) -> None:
        """Assume of every action that costs something that it is not chosen at all.

        By none of the robots that are alike: which one of them does it does not matter.
        """
        formula, model = self._formula, self._formula.model
        kinds = _kinds(model, task)
        alike: dict[tuple[str, ...], Literals] = {}
        for robot, costs in enumerate(formula.costs):
            own = model.robots[robot]
            for label in np.flatnonzero(costs).tolist():
                words = model.labels[robot][label].strip("()").split()
                action = tuple(kinds[robot] if word == own else word for word in words)
                times = [formula.label(step, robot, label) for step in range(1, self._steps + 1)]
                alike.setdefault(action, []).extend(times)
        for times in alike.values():
            done = formula.any_of(times)
            self._times[done] = times
            self.open[done] = (None, 0)

    def relax(self, core: Literals) -> None:
        """Let as many of a core's literals hold as must; more, or one more often, is paid anew."""
        for literal in core:
            own, place = self.open.pop(literal)
            if own is None:
                own = _Sum(self._formula.counter(self._times.pop(literal)))
            self._assume(own, place + 1)
        if len(core) > 1:
            together = _Sum(self._formula.counter(core))
            place = 1
            while place < len(together.at_least) and self._must(together.at_least[place]):
                place += 1
            self._assume(together, place)

    def _assume(self, total: _Sum, place: int) -> None:
        """Assume that a sum is no larger than this."""
        if place < len(total.at_least):
            self.open[total.at_least[place]] = (total, place)

    def _must(self, larger: int) -> bool:
        """Whether a sum must be larger, where that is seen at once."""
        try:
            with self._formula.at_most(_EASY):
                return not self._formula.holds([-larger])
        except OutOfEffort:
            return False


def least_cost(formula: PlanFormula, task: PlanningTask, steps: int) -> Literals:
    """Literals that all hold in the cheapest plans of so many steps, and in no other plans.

    There are plans of so many steps, the formula is fixed to them, and costs are 0 or 1.  The last
    answer of the solver is one of the cheapest.  The cost of a plan is the number of refuted
    assumptions and the number of these literals that do not hold (if a sum is said to be larger
    only where it is), so the literals say the same as a bound on the cost, but each of few actions:
    much follows from them at once.  Cores that have nothing in common are looked for first, for
    these are small.

    Raises `planners.search.questions.OutOfEffort`.
    """
    sums = _Sums(formula, steps)
    sums.add_actions(task)
    while cores := list(_disjoint(formula, set(sums.open))):
        for core in cores:
            sums.relax(core)
    return [-literal for literal in sorted(sums.open)]


def _disjoint(formula: PlanFormula, assumed: set[int]) -> Iterator[Literals]:
    """Cores without a common literal, until what is assumed besides holds."""
    while not formula.holds([-literal for literal in sorted(assumed)]):
        core = _smaller(formula, formula.core(assumed))
        assumed -= set(core)
        yield core


def _kinds(model: JointModel, task: PlanningTask) -> list[str]:
    """For each robot the first one that is like it: start and goal are the same without names."""

    def about(robot: str) -> list[set[tuple[str, ...]]]:
        wanted = goal_facts(model, task.goal)
        true = model.codec.true_facts(model.codec.facts_part(task.init))
        atoms = [[model.codec.facts.atoms[fact] for fact in facts] for facts in (true, wanted)]
        return [
            {(a.predicate, *("" if arg == robot else arg for arg in a.args)) for a in own}
            for own in ([atom for atom in part if robot in atom.args] for part in atoms)
        ]

    known = [about(robot) for robot in model.robots]
    return [model.robots[known.index(own)] for own in known]


def _smaller(formula: PlanFormula, core: Literals) -> Literals:
    """A core that is no larger: what is needed of it, asked again while that helps."""
    while len(core) > 1:
        answer = formula.holds([-literal for literal in core])
        assert not answer, "a core was refuted"
        again = formula.core(core)
        if len(again) >= len(core):
            break
        core = again
    return core
