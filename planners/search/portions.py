# SPDX-License-Identifier: GPL-3.0-or-later
"""The plan spaces of many goals, a portion of the goals at a time: tasks are cut between goals.

What is asked of a plan space goal by goal is asked of portions, which other processes make
themselves: they are sent where the plans come from, not the plans.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np

from planners.joint.model import FullState, Goal, JointModel
from planners.joint.tables import Ints, Rows
from planners.parallel.batch import digest
from planners.search.asynchronous import as_executed
from planners.search.kept_plans import model_digest
from planners.search.optimal_plans import (
    PAIRS,
    distances,
    distances_to,
    plan_space,
    plan_spaces,
    seen_rows,
)
from planners.search.plan_space import PlanSpace
from planners.search.reachable import Space
from planners.system.errors import OutOfMemory
from planners.system.limits import memory_left, more_memory

#: Estimated nodes times robots in one portion.  Smaller ones find the same label sets again and
#: again, larger ones leave cores without work.
PORTION = 40_000.0
#: Nodes times robots from which the estimate is said: some seconds of work.
_LARGE = 1_000_000
#: Bytes of a node and its edges in a plan space, and more of them while it is made (measured on
#: grids with two robots).
_NODE_BYTES, _MAKING_BYTES = 200, 600


@dataclass(frozen=True)
class Explored:
    """Tasks over one explored space, by goal, with their initial states; None: all others."""

    space: Space
    goals: Sequence[tuple[Goal, Rows | None]]

    def portion(self, goals: range) -> PlanSpace:
        """The plan space of the tasks of some goals; states have the same numbers in all.

        O(goals x joint steps).
        """
        return as_executed(plan_space(self.space, self.goals[goals.start : goals.stop]))

    @property
    def spaces(self) -> tuple[PlanSpace, ...]:
        """The plan spaces of all tasks, in batches of goals."""
        return tuple(map(as_executed, plan_spaces(self.space, self.goals)))

    def only(self, goals: Ints) -> Explored:
        """The tasks of some of the goals, given by number."""
        return Explored(self.space, [self.goals[number] for number in goals.tolist()])

    @cached_property
    def rows(self) -> Rows:
        """The table of all states, as plan spaces number them: with slack, where states say it."""
        return seen_rows(self.space.model, self.space.rows)

    @property
    def robots(self) -> int:
        """How many robots there are."""
        return len(self.space.model.robots)

    @property
    def efforts(self) -> Ints:
        """For each goal the estimated nodes of its plan space, times robots.

        As many as there are states, for each slack: a plan space has no more.
        """
        nodes = len(self.space) * (1 + self.space.model.slack)
        return np.full(len(self.goals), nodes * self.robots)

    @property
    def is_every_pair(self) -> bool:
        """Whether all other states are initial states of each goal."""
        return all(inits is None for _, inits in self.goals)

    @property
    def has_every_way(self) -> bool:
        """Whether each joint step by which the distance to a goal falls is on a plan of a task."""
        model = self.space.model
        bare = not (model.slack or model.is_asynchronous or self.space.cost.any())
        return bare and self.is_every_pair

    @cached_property
    def tasks(self) -> int:
        """How many there are: pairs of a goal and another state that reaches it, for None."""
        listed = sum(len(inits) for _, inits in self.goals if inits is not None)
        free = [goal for goal, inits in self.goals if inits is None]
        return listed + _pairs(self.space, free)

    @property
    def identity(self) -> str:
        """A hash of all that portions say, the same in every process."""
        space = self.space
        goals = tuple(
            goal.facts if isinstance(goal, FullState) else space.model.holds(goal, space.rows)
            for goal, _ in self.goals
        )
        inits = tuple(inits for _, inits in self.goals)
        steps = (space.rows, space.first, space.target, space.labels, space.cost)
        return digest(_of_model(space.model), *steps, goals, inits)


@dataclass(frozen=True, slots=True)
class Searched:
    """Tasks of a plan space that is there already, cut by its goals; as `Explored`."""

    plans: PlanSpace

    def portion(self, goals: range) -> PlanSpace:
        """The plan space of the tasks of some goals; O(edges)."""
        plans = self.plans
        goal = plans.goal[plans.starts]
        mine = (goal >= goals.start) & (goal < goals.stop)
        return plans.with_tasks(plans.starts[mine], plans.second[mine])

    @property
    def spaces(self) -> tuple[PlanSpace, ...]:
        """The plan spaces of all tasks."""
        return (self.plans,)

    @property
    def rows(self) -> Rows:
        """The table of all states."""
        return self.plans.rows

    @property
    def robots(self) -> int:
        """How many robots there are."""
        return self.plans.robots

    @property
    def efforts(self) -> Ints:
        """For each goal the nodes of its plan space, times robots."""
        plans = self.plans
        return np.bincount(plans.goal, minlength=len(plans.goals)) * plans.robots

    @property
    def tasks(self) -> int:
        """How many there are."""
        return len(self.plans.starts)

    @property
    def identity(self) -> str:
        """A hash of all that portions say, the same in every process."""
        plans = self.plans
        nodes = (plans.rows, plans.state, plans.goal, plans.layer, plans.first, plans.target)
        edges = (plans.labels, plans.cost, plans.starts, plans.second)
        return digest(_of_model(plans.model), *nodes, *edges)


#: Where plan spaces come from; it is sent to other processes.
Source = Explored | Searched


def cut(efforts: Ints, portion: float = PORTION) -> list[range]:
    """Goals in a row whose efforts sum to one portion, as near as that goes.

    It depends on nothing else, so that results do not depend on who does the work.
    """
    total = float(efforts.sum())
    parts = max(1, min(len(efforts), round(total / portion)))
    ends = np.searchsorted(np.cumsum(efforts), total * np.arange(1, parts) / parts) + 1
    bounds = np.unique(np.concatenate(([0], np.minimum(ends, len(efforts)), [len(efforts)])))
    return [range(int(low), int(high)) for low, high in pairwise(bounds)]


@dataclass(frozen=True, slots=True)
class Estimate:
    """How much there is to do for many tasks, before it is done.

    ``nodes`` is a bound on the nodes of the plan graph, ``bytes`` what its plan spaces take if all
    are kept.
    """

    goals: int
    nodes: int
    robots: int
    jobs: int

    @property
    def bytes(self) -> int:
        """About so much: finished nodes with their edges, and one batch while it is made."""
        return _NODE_BYTES * self.nodes + _MAKING_BYTES * min(self.nodes, PAIRS)

    @property
    def is_large(self) -> bool:
        """Whether a person will wait for it."""
        return self.nodes * self.robots >= _LARGE

    def __str__(self) -> str:
        return (
            f"{self.goals:,} goals, up to {self.nodes:,} nodes of plans x {self.robots} robots, in "
            f"{self.jobs:,} jobs"
        )


def estimate(source: Source) -> Estimate:
    """The size of the work on a source, known before its plans are."""
    efforts = source.efforts
    nodes = int(efforts.sum()) // source.robots
    if isinstance(source, Explored) and source.is_every_pair:
        # Each start is a node, and each goal, with each slack that may be left.
        nodes = (source.tasks + len(efforts)) * (1 + source.space.model.slack)
    return Estimate(len(efforts), nodes, source.robots, len(cut(efforts)))


def require_room(source: Source) -> None:
    """Raise `OutOfMemory` if the plan spaces of all tasks together will not fit.

    For work that keeps them all.
    """
    if not isinstance(source, Explored) or not source.is_every_pair:
        return  # they are there already, or known by a bound that is far too large
    found, left = estimate(source), memory_left()
    if found.is_large and found.bytes > left:
        raise OutOfMemory(
            f"all plans at once are {found}: about {found.bytes / 2**30:,.1f} GiB, and "
            f"{left / 2**30:,.1f} GiB are left",
            remedy=f"Use --method greedy, fewer candidate tasks, or {more_memory()}.",
        )


def _pairs(space: Space, goals: Sequence[Goal]) -> int:
    """How many pairs there are of a goal and a state that reaches it in one step or more."""
    if not goals:
        return 0
    full = all(isinstance(goal, FullState) for goal in goals)
    if full and space.model.holds(goals[0], space.rows).sum() == 1 and _is_connected(space):
        return len(goals) * (len(space) - 1)
    return sum(int((far > 0).sum()) for far in distances_to(space, goals))


def _is_connected(space: Space) -> bool:
    """Whether every state leads to every other one; O(joint steps) for each step between them."""
    first = np.arange(len(space)) == 0
    reached, sources, before = first.copy(), space.sources, 0
    while (count := int(reached.sum())) > before:
        before = count
        reached[space.target[reached[sources]]] = True
    return count == len(space) and bool((distances(space, first[None]) >= 0).all())


def _of_model(model: JointModel) -> tuple[object, ...]:
    """All of a model on which the plans of a portion depend, for a hash."""
    return model_digest(model), model.slack, model.is_asynchronous
