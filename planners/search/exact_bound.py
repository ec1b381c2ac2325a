# SPDX-License-Identifier: GPL-3.0-or-later
"""Exact bounds from a SAT solver: what is left after them is, nearly always, on optimal plans.

First the least makespan, then the least second component (where no action costs more than 1), then
the labels that some optimal plan has in each step; then, state by state, whether an optimal plan
passes through it: whether one begins with a cheapest way to it; and in states with many joint
labels which labels may follow that way.  The solver's models are only hints (states and costs come
from the joint model); its refutations are trusted.  A question that is not decided with some effort
is answered with yes: more is searched then.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress

import numpy as np

from planners.joint.conditions import Labels
from planners.joint.model import JointModel, Options, PlanningTask, products, some_options
from planners.joint.tables import Bools, Ints
from planners.search.goals import SMALLER, goal_facts
from planners.search.plan_formula import PlanFormula
from planners.search.questions import FixedPlans, Literals, OutOfEffort, Plan
from planners.search.reachable import Edges, grown
from planners.system.limits import reaching

#: What a refuted makespan costs in conflicts, however easy it is: of a task without plan there
#: would be ever more; and the clauses of the formula that cost as much as a conflict.
_EASY, _CLAUSES = 100, 1_000
#: Conflicts for the least second component, without which more is searched, and for one question
#: about what optimal plans do.
_LEAST_COST, _QUESTION = 300_000, 20_000
#: Joint labels of a state beyond which it is asked which robots' labels may go on there.
_JOINT_LABELS = 64
#: States of a layer that are asked for first, and the share of them on optimal plans above which
#: the others are not asked for.
_SAMPLE, _MOSTLY = 64, 0.9
#: The same share, of so many that were asked for last and that no earlier answer refuted.
_RECENT, _NEARLY_ALL = 200, 0.95


class ExactBound:
    """The least makespan of one task, and what its optimal plans consist of.

    ``plans`` are what they satisfy, closed with the `ExactQuestion`; ``used[k][robot]``
    (labels) says which labels occur in step k of some optimal plan; a state is kept where its
    question is not answered with some effort.

    Of each state that a search has met a cheapest way is kept as its last step: what the way costs,
    the state before, and what the robots do there.
    """

    def __init__(self, plans: FixedPlans, used: list[list[Bools]]) -> None:
        self.plans, self.makespan, self._used = plans, plans.steps, used
        self._paid: Ints = np.zeros(0, np.int64)
        self._source: Ints = np.zeros(0, np.int64)
        self._labels: Labels = np.zeros((0, plans.first.shape[1]), np.int32)

    def only(self, depth: int, states: Ints, options: Options) -> Options:
        """The robots' options in states after ``depth`` steps, without labels that are not used.

        Where many combinations are left, labels go, too, that cannot follow a cheapest way to the
        state, as far as unit propagation sees it: an optimal plan through the state may begin with
        any such way.  The states are of one layer, all edges into which were seen by `left_out`.
        """
        used = [u[label] for u, (_, label) in zip(self._used[depth], options, strict=True)]
        options = some_options(options, used)
        many = np.flatnonzero(products(options) > _JOINT_LABELS)
        ways = self._asked(self._ways(states[many], depth))
        #: The variables of the robots' options, and which of these are left.
        variables = [
            begin + label
            for begin, (_, label) in zip(self.plans.first[depth], options, strict=True)
        ]
        kept = [np.ones(len(own), np.bool_) for own in variables]
        false = np.zeros(self.plans.variables + 1, np.bool_)
        for state, way in zip(many.tolist(), ways, strict=True):
            excluded = self.plans.excluded(way.tolist())
            false[excluded] = True
            for robot, (first, _) in enumerate(options):
                here = slice(first[state], first[state + 1])
                kept[robot][here] = ~false[variables[robot][here]]
            false[excluded] = False
        return some_options(options, kept)

    def _asked(self, ways: Labels) -> Ints:
        """The literals of beginnings of plans: (ways, steps x robots)."""
        asked = ways + self.plans.first[: ways.shape[1]]
        return asked.reshape(len(ways), ways.shape[1] * ways.shape[2])

    def left_out(self, edges: Edges, depth: int, states: int) -> Ints:
        """States of the layer that ``edges`` lead to through which no optimal plan passes.

        Of large layers a sample is asked for first, and all if enough of it is left out;
        ``states`` is how many there are in the table.
        """
        new = self._enter(edges, states)
        some = new[:: -(-len(new) // _SAMPLE) or 1]
        passes = self.may_pass(self._ways(some, depth))
        if len(some) == len(new):
            return new[~passes]
        if passes.mean() > _MOSTLY:
            return new[:0]
        return new[~self.may_pass(self._ways(new, depth), _NEARLY_ALL)]

    def may_pass(self, ways: Labels, enough: float = 1) -> Bools:
        """Which beginnings of plans, as labels (ways, steps, robots), some optimal plan may have.

        Those that no earlier answer refuted are asked for in a random order; where more than the
        share ``enough`` of the last ones pass, the others are taken to pass, too.
        """
        asked = self._asked(ways)
        columns = np.ascontiguousarray(asked.T)
        passes = np.ones(len(ways), np.bool_)
        recent: deque[bool] = deque(maxlen=_RECENT)
        for way in np.random.default_rng(0).permutation(len(ways)).tolist():
            if not passes[way]:
                continue
            recent.append(self._unless_refuted(asked[way].tolist()))
            if not recent[-1]:
                # What is refuted is part of other ways, too.
                alike = np.arange(len(ways))
                core = self.plans.core((-asked[way]).tolist())
                for place in np.flatnonzero(np.isin(-asked[way], core))[::-1]:
                    alike = alike[columns[place, alike] == asked[way, place]]
                passes[alike] = False
            elif len(recent) == _RECENT and sum(recent) > enough * _RECENT:
                break
        return passes

    def _unless_refuted(self, literals: Literals) -> bool:
        self.plans.left = _QUESTION
        try:
            return self.plans.holds(literals)
        except OutOfEffort:
            return True

    def _enter(self, edges: Edges, states: int) -> Ints:
        """Note cheapest ways to the different states that edges lead to, and return these."""
        self._paid, self._source = grown(self._paid, states, 0), grown(self._source, states, 0)
        self._labels = grown(self._labels, states, 0)
        paid = self._paid[edges.source] + edges.cost
        order = np.lexsort((paid, edges.target))
        new, first = np.unique(edges.target[order], return_index=True)
        best = order[first]
        self._paid[new], self._source[new] = paid[best], edges.source[best]
        self._labels[new] = edges.labels[best]
        return new.astype(np.int64)

    def _ways(self, states: Ints, depth: int) -> Labels:
        """The ways to some states of a layer, as labels: (states, depth, robots)."""
        found = np.zeros((len(states), depth, self._labels.shape[1]), np.int32)
        for step in range(depth - 1, -1, -1):
            found[:, step] = self._labels[states]
            states = self._source[states]
        return found


class ExactQuestion:
    """The least makespan of a task, asked of a solver, which may be left and gone on with.

    ``at_least`` is a lower bound on it: shorter plans were refuted, or are known not to be.
    """

    def __init__(self, model: JointModel, task: PlanningTask) -> None:
        self._model, self._task = model, task
        self._formula = PlanFormula(model, task)
        self._plans = self._formula.plans()
        #: The literal that says that the task begins where the plans do; 0: they were refuted.
        self._begins = 0

    @property
    def at_least(self) -> int:
        """A lower bound on the makespan, as far as the solver knows."""
        return self._plans.steps + (not self._begins)

    def close(self) -> None:
        """Give the solver back."""
        self._plans.close()

    def bound(self, at_least: int, effort: int) -> ExactBound | None:
        """The bound; None where it is not found with so many conflicts more.

        ``at_least`` is a lower bound on the makespan.  Of a task without plan none is found.
        """
        plans, model = self._plans, self._model
        with reaching(plans.so_far, SMALLER):
            plans.left = effort
            try:
                self._find_shortest(at_least)
            except OutOfEffort:
                return None
            plan = plans.labels_chosen()
            plans.simplify()
            costs = self._formula.stepper.costs
            if max(int(own.max(initial=0)) for own in costs) == 1:
                plans.left = _LEAST_COST
                with suppress(OutOfEffort):
                    cheap = _least_cost(plans, _costly(plans, model, self._task, costs))
                    plan = plans.labels_chosen()
                    plans.require(cheap)
            used = _used(plans, model, plan)
            plans.simplify()
            return ExactBound(plans, used)

    def _find_shortest(self, at_least: int) -> None:
        """Let the plans be the shortest ones, one of which was found."""
        plans = self._plans
        while True:
            if not self._begins:
                self._begins = self._formula.lengthen(plans, at_least)
            asked = plans.steps >= at_least
            if asked and plans.holds([self._begins]):
                plans.require([self._begins])
                return
            plans.require([-self._begins])
            self._begins = 0
            if asked:
                plans.spend(_EASY + plans.steps * len(self._formula.step) // _CLAUSES)


def _used(plans: FixedPlans, model: JointModel, plan: Plan) -> list[list[Bools]]:
    """Which labels occur where in optimal plans: each that is found shows one a robot and step.

    What is not decided may all occur.
    """
    found = [[np.zeros(len(own), np.bool_) for own in model.labels] for _ in plan]

    def enter(plan: Plan) -> None:
        for own, labels in zip(found, plan, strict=True):
            for used, label in zip(own, labels, strict=True):
                used[label] = True

    enter(plan)
    # A question about all steps at once is refuted in less time than one about each step.
    for robot in range(len(model.robots)):
        plans.left = plans.steps * _QUESTION
        while others := [
            plans.label(step, robot, label)
            for step, own in enumerate(found)
            for label in np.flatnonzero(~own[robot]).tolist()
        ]:
            try:
                holds = plans.holds([plans.some_of(others)])
            except OutOfEffort:
                for own in found:
                    own[robot][:] = True
                break
            if not holds:
                plans.require([-literal for literal in others])
                break
            enter(plans.labels_chosen())
    return found


# ---- the least second component, by cores


def _least_cost(plans: FixedPlans, costly: Iterable[Literals]) -> Literals:
    """Literals that all hold in the cheapest plans, and in no other plans.

    There are plans, costs are 0 or 1, and ``costly`` is from `_costly`.  The last answer of the
    solver is one of the cheapest.
    First the cost is assumed to be 0: no action that costs something is done.  The solver answers
    with a core, some of these assumptions that cannot hold together.  Each core raises the lower
    bound by one, and from then on one of its actions may be done, and for more there are new
    assumptions (core-guided MaxSAT, OLL; Andres, Kaufmann, Matheis and Schaub 2012).  The cost of a
    plan is the number of refuted assumptions and the number of these literals that do not hold (if
    a sum is said to be larger only where it is), so the literals say the same as a bound on the
    cost, but each of few actions: much follows from them at once.  Cores that have nothing in
    common are looked for first, for these are small.

    Raises `planners.search.questions.OutOfEffort`.
    """
    #: What is assumed to be false: that an action is done at all, and that more of some literals
    #: hold than the place of this one in their counter.
    done = {plans.any_of(times): times for times in costly}
    more: dict[int, tuple[Literals, int]] = {}

    def assume_at_most(place: int, counter: Literals) -> None:
        if place < len(counter):
            more[counter[place]] = counter, place

    while cores := list(_disjoint(plans, {*done, *more})):
        for core in cores:
            for literal in core:
                if literal in done:
                    assume_at_most(1, plans.counter(done.pop(literal)))
                else:
                    counter, place = more.pop(literal)
                    assume_at_most(place + 1, counter)
            if len(core) > 1:
                assume_at_most(1, plans.counter(core))
    return [-literal for literal in sorted({*done, *more})]


def _costly(
    plans: FixedPlans, model: JointModel, task: PlanningTask, costs: Sequence[Ints]
) -> Iterable[Literals]:
    """For each action that costs something the literals that it is done, in any step.

    By any of the robots that are alike: which one of them does it does not matter.
    """
    kinds = _kinds(model, task)
    alike: dict[tuple[str, ...], Literals] = {}
    for robot, own in enumerate(model.robots):
        for label in np.flatnonzero(costs[robot]).tolist():
            words = model.labels[robot][label].strip("()").split()
            action = tuple(kinds[robot] if word == own else word for word in words)
            times = [plans.label(step, robot, label) for step in range(plans.steps)]
            alike.setdefault(action, []).extend(times)
    return alike.values()


def _disjoint(plans: FixedPlans, assumed: set[int]) -> Iterator[Literals]:
    """Cores without a common literal, until what is assumed besides holds."""
    while not plans.holds([-literal for literal in sorted(assumed)]):
        core = plans.core(assumed)
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
