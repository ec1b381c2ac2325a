# SPDX-License-Identifier: GPL-3.0-or-later
"""The least second cost component of plans with the least makespan, by a SAT solver.

A lower-bound search by *cores* where actions cost 0 or 1, else an upper-bound search by a counter.
In the first the cost is assumed to be 0: no action that costs something is done at all.  The solver
answers with a core, some of these assumptions that cannot hold together: one of those actions is
needed.  Each core raises the lower bound by one, and from then on one of its actions may be done,
and for more there are new assumptions (core-guided MaxSAT, OLL; Andres, Kaufmann, Matheis and
Schaub 2012).  The first plan that is found is a cheapest one.  Cores are small where goals have
little to do with each other, and a bound on the sum of all costs says nothing for long.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from planners.joint.composition import ComposingStepper
from planners.joint.model import JointModel, PlanningTask
from planners.joint.tables import Ints
from planners.search.goals import goal_facts
from planners.search.questions import FixedPlans, Literals, OutOfEffort, Plan

#: Conflicts for the try by cores.
_FIRST = 300_000
#: The largest cost of one action that is counted.
_COST = 8


def cheapest(
    plans: FixedPlans, model: JointModel, task: PlanningTask, plan: Plan
) -> tuple[Plan, Literals]:
    """A cheapest plan, and literals that the cheapest ones have and no others; ``plan`` is known.

    If that takes too much effort, then what is found are plans that cost no more than some plan;
    without literals where costs are too large for a counter.
    """
    costs = label_costs(model)
    dearest = max(int(own.max(initial=0)) for own in costs)
    if dearest <= 1:
        with suppress(OutOfEffort), plans.at_most(_FIRST):
            cheap = least_cost(plans, model, task)
            return plans.labels_chosen(), cheap
    elif dearest > _COST:
        return plan, []
    most = _cost_of(costs, plan)
    sums = _counter(plans, costs)
    with suppress(OutOfEffort):
        while most and plans.holds(_at_most(sums, most - 1)):
            plan = plans.labels_chosen()
            most = _cost_of(costs, plan)
    return plan, _at_most(sums, most)


def label_costs(model: JointModel) -> list[Ints]:
    """Per robot the second cost component of each of its labels."""
    assert isinstance(model.stepper, ComposingStepper)
    return model.stepper.costs


def _cost_of(costs: Sequence[Ints], plan: Plan) -> int:
    return sum(int(costs[robot][label]) for step in plan for robot, label in enumerate(step))


def _counter(plans: FixedPlans, costs: Sequence[Ints]) -> Literals:
    """Literals, the k-th of which is implied where plans cost more than k."""
    paid = [
        plans.any_of([plans.label(step, robot, n) for n in np.flatnonzero(own >= least).tolist()])
        for step in range(plans.steps)
        for robot, own in enumerate(costs)
        for least in range(1, int(own.max(initial=0)) + 1)
    ]
    return plans.counter(paid) if paid else []


def _at_most(sums: Literals, cost: int) -> Literals:
    """A literal that says that no more is paid; none where it is no bound."""
    return [-sums[cost]] if cost < len(sums) else []


@dataclass(slots=True)
class _Sum:
    """How many of some literals hold: ``at_least[k]`` is implied where more than k do."""

    at_least: Literals


class _Sums:
    """The sums that are assumed to be small, by the literal that says that one is larger."""

    def __init__(self, plans: FixedPlans) -> None:
        self._plans = plans
        #: Assumed to be false: the sum that each belongs to, and its place there.
        self.open: dict[int, tuple[_Sum | None, int]] = {}
        self._times: dict[int, Literals] = {}

    def add_actions(self, model: JointModel, task: PlanningTask) -> None:
        """Assume of every action that costs something that it is not chosen at all.

        By none of the robots that are alike: which one of them does it does not matter.
        """
        kinds = _kinds(model, task)
        alike: dict[tuple[str, ...], Literals] = {}
        for robot, costs in enumerate(label_costs(model)):
            own = model.robots[robot]
            for label in np.flatnonzero(costs).tolist():
                words = model.labels[robot][label].strip("()").split()
                action = tuple(kinds[robot] if word == own else word for word in words)
                times = [self._plans.label(step, robot, label) for step in range(self._plans.steps)]
                alike.setdefault(action, []).extend(times)
        for times in alike.values():
            done = self._plans.any_of(times)
            self._times[done] = times
            self.open[done] = (None, 0)

    def relax(self, core: Literals) -> None:
        """Let as many of a core's literals hold as must; more, or one more often, is paid anew."""
        for literal in core:
            own, place = self.open.pop(literal)
            if own is None:
                own = _Sum(self._plans.counter(self._times.pop(literal)))
            self._assume(own, place + 1)
        if len(core) > 1:
            together = _Sum(self._plans.counter(core))
            place = 1
            while place < len(together.at_least) and self._plans.must(together.at_least[place]):
                place += 1
            self._assume(together, place)

    def _assume(self, total: _Sum, place: int) -> None:
        """Assume that a sum is no larger than this."""
        if place < len(total.at_least):
            self.open[total.at_least[place]] = (total, place)


def least_cost(plans: FixedPlans, model: JointModel, task: PlanningTask) -> Literals:
    """Literals that all hold in the cheapest plans, and in no other plans.

    There are plans, and costs are 0 or 1.  The last answer of the solver is one of the cheapest.
    The cost of a plan is the number of refuted assumptions and the number of these literals that do
    not hold (if a sum is said to be larger only where it is), so the literals say the same as a
    bound on the cost, but each of few actions: much follows from them at once.  Cores that have
    nothing in common are looked for first, for these are small.

    Raises `planners.search.questions.OutOfEffort`.
    """
    sums = _Sums(plans)
    sums.add_actions(model, task)
    while cores := list(_disjoint(plans, set(sums.open))):
        for core in cores:
            sums.relax(core)
    return [-literal for literal in sorted(sums.open)]


def _disjoint(plans: FixedPlans, assumed: set[int]) -> Iterator[Literals]:
    """Cores without a common literal, until what is assumed besides holds."""
    while not plans.holds([-literal for literal in sorted(assumed)]):
        core = _smaller(plans, plans.core(assumed))
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


def _smaller(plans: FixedPlans, core: Literals) -> Literals:
    """A core that is no larger: what is needed of it, asked again while that helps."""
    while len(core) > 1:
        answer = plans.holds([-literal for literal in core])
        assert not answer, "a core was refuted"
        again = plans.core(core)
        if len(again) >= len(core):
            break
        core = again
    return core
