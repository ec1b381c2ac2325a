# SPDX-License-Identifier: GPL-3.0-or-later
"""All optimal plans of tasks: search forward, then back along optimal edges.

The set ``Pi(I, G)`` of the paper, as the paths of a graph (Proposition 1 of docs/concepts.md).
Where the model has slack, those within it:

A *plan within slack B* is a sequence of joint steps that ends in the goal and takes at most B steps
more than the least makespan ``m``; it may pass through the goal before.  Two of them that differ
only in a rest at the end, steps in which every robot idles, are one plan: all are written with
exactly ``m + B`` steps, the last ones at rest.  So the graph has nodes (state, steps left), and as
every joint step takes one of these, no node repeats on a plan although states may (Proposition 22
of docs/concepts.md).  Under a second cost component the plans within the bound that cost least are
meant.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import closing
from dataclasses import replace

import numpy as np

from planners.joint.conditions import Labels
from planners.joint.model import Goal, JointModel, Options, PlanningTask
from planners.joint.tables import (
    Bools,
    Ints,
    Rows,
    find_rows,
    kept_runs,
    narrow,
    packed,
    ranges,
    unique_rows,
    unpacked,
)
from planners.search.bounded_search import BoundedSearch
from planners.search.goals import SMALLER, searched
from planners.search.heuristics import search_heuristic
from planners.search.plan_space import PlanSpace
from planners.search.reachable import Exploration, Space
from planners.system.errors import ProvedImpossible, UsageError
from planners.system.limits import reaching

#: Goals whose distances are worked out together.
_GOALS = 512
#: (goal, state) pairs handled in one plan space when many tasks are asked for.
PAIRS = 2_000_000


def search(model: JointModel, task: PlanningTask, heuristic: str = "auto") -> PlanSpace:
    """All optimal plans of one task, expanding only states that may be on one.

    Forward in layers, bounded by ``heuristic`` (`planners.search.heuristics`), then back along
    optimal edges.  With slack the least makespan is found first, and then what is within the bound.

    Raises `ProvedImpossible` if the goal cannot be reached, `UsageError` if there is slack and
    robots cannot wait in the goal.
    """
    if not model.slack:
        return search_with_effort(model, task, heuristic)[0]
    makespan, _ = search_with_effort(model.without_slack, task, heuristic)[0].cost_of(0)
    return search_within(model, task, makespan)


def _on_plans(graph: PlanSpace) -> PlanSpace:
    """The plan space with a table of just the states that plans pass through."""
    used, state = np.unique(graph.state, return_inverse=True)
    return replace(graph, rows=graph.rows[used], state=state)


def search_with_effort(
    model: JointModel, task: PlanningTask, heuristic: str = "auto"
) -> tuple[PlanSpace, BoundedSearch]:
    """The plans as `search` finds them, and how they were found."""
    with reaching(lambda: f"looking for bounds of {task.name}", SMALLER):
        chosen = search_heuristic(heuristic, model, task)
    forward = BoundedSearch(model, task, chosen)
    with closing(forward), reaching(forward.so_far, SMALLER):
        forward.run()
        graph = _plan_space(forward.space(), [(task.goal, task.init[None, :])])
        return _on_plans(graph), forward


def joined(spaces: Sequence[PlanSpace]) -> PlanSpace:
    """Plan spaces of one task each as one plan space in which every task has a goal of its own."""
    if len(spaces) == 1:
        return spaces[0]
    rows, number = unique_rows(np.concatenate([s.rows for s in spaces]))
    row_offset = np.cumsum([0, *(len(s.rows) for s in spaces)])
    node_offset = np.cumsum([0, *map(len, spaces)])
    parts = list(enumerate(spaces))
    together = PlanSpace(
        model=spaces[0].model,
        rows=rows,
        state=np.concatenate([number[s.state + row_offset[k]] for k, s in parts]),
        goal=np.repeat(np.arange(len(spaces)), np.diff(node_offset)),
        layer=np.concatenate([s.layer for s in spaces]),
        first=np.cumsum(np.concatenate([[0], *(s.out_degrees for s in spaces)])),
        target=narrow(np.concatenate([s.target + node_offset[k] for k, s in parts])),
        labels=np.concatenate([s.labels for s in spaces]),
        cost=np.concatenate([s.cost for s in spaces]),
        goals=tuple(space.goals[0] for space in spaces),
        starts=np.array([s.starts[0] + node_offset[k] for k, s in parts]),
        second=np.concatenate([s.second for s in spaces]),
    )
    return together.reordered(np.lexsort((together.state, together.goal, together.layer)))


def solvable(space: Space, tasks: Sequence[tuple[Goal, Rows]]) -> list[tuple[Goal, Rows]]:
    """Leave out the tasks whose goal cannot be reached; goals with tables of initial states."""
    pairs = zip(tasks, distances_to(space, [goal for goal, _ in tasks]), strict=True)
    found = [(goal, inits[own[space.numbers(inits)] >= 0]) for (goal, inits), own in pairs]
    return [(goal, inits) for goal, inits in found if len(inits)]


def plan_spaces(space: Space, tasks: Sequence[tuple[Goal, Rows | None]]) -> Iterator[PlanSpace]:
    """`plan_space` in batches of goals."""
    size = max(1, PAIRS // max(1, len(space) * (1 + space.model.slack)))
    for start in range(0, len(tasks), size):
        yield plan_space(space, tasks[start : start + size])


def plan_space(space: Space, tasks: Sequence[tuple[Goal, Rows | None]]) -> PlanSpace:
    """The optimal plans of many tasks over one explored space.

    One backward pass per goal serves every initial state.  ``tasks`` are goals with tables of
    initial states; None: every other state that can reach the goal.

    Raises `ProvedImpossible` for a task whose goal cannot be reached.
    """

    def so_far() -> str:
        kept = space.model.kept_plans
        return f"the {kept} to {len(tasks):,} goals, over {len(space):,} states"

    with reaching(so_far, "fewer candidate tasks"):
        return _plan_space(space, tasks)


def _plan_space(space: Space, tasks: Sequence[tuple[Goal, Rows | None]]) -> PlanSpace:
    distance = np.stack([*distances_to(space, [goal for goal, _ in tasks])])
    states: list[Ints] = []
    for number, (_, inits) in enumerate(tasks):
        if inits is None:
            states.append(np.flatnonzero(distance[number] > 0))
            continue
        found = space.numbers(inits)
        bad = np.flatnonzero((found < 0) | (distance[number, found] < 0))
        if len(bad):
            raise ProvedImpossible(
                f"the goal cannot be reached from {space.model.state_text(inits[bad[0]])}",
                remedy=searched(space.model, tasks[number][0], space.rows),
            )
        states.append(found)
    goal = np.repeat(np.arange(len(tasks)), [len(own) for own in states])
    graph = _shortest_ways(space, distance, goal, np.concatenate(states))
    plans = replace(graph, goals=tuple(goal for goal, _ in tasks))
    if space.model.slack:
        require_rest(plans)
    second = plans.least_sums(plans.cost)[plans.starts]
    plans = replace(plans.cheapest(plans.cost), second=second)
    if space.model.slack_facts:
        left = plans.layer - distance[plans.goal, plans.state]
        plans = seeing(plans, left, seen_rows(space.model, space.rows))
    return plans


def distances_to(space: Space, goals: Sequence[Goal]) -> Iterator[Ints]:
    """For each goal the least makespan from every state, -1 where there is no way."""
    for start in range(0, len(goals), _GOALS):
        batch = goals[start : start + _GOALS]
        yield from distances(space, np.stack([space.model.holds(g, space.rows) for g in batch]))


def distances(space: Space, reached: Bools) -> Ints:
    """Least makespan from every state to every goal, (goals, states), -1 where there is none.

    ``reached`` (goals, states): which states satisfy which goal.  Breadth first from all goals at
    once, backward, with a bit for each goal: O(joint steps x goals / 64) for a layer.
    """
    result = np.where(reached, 0, -1)
    new = packed(reached.T)
    seen = new.copy()
    leading = np.flatnonzero(np.diff(space.first))
    steps = 0
    while len(leading) and len(changed := np.flatnonzero(new.any(axis=1))):
        if steps:
            which, goal = np.nonzero(unpacked(new[changed], len(reached)))
            result[goal, changed[which]] = steps
        before = np.zeros_like(new)
        before[leading] = np.bitwise_or.reduceat(new[space.target], space.first[leading])
        new = before & ~seen
        seen |= new
        steps += 1
    return result


def _shortest_ways(space: Space, distance: Ints, goal: Ints, state: Ints) -> PlanSpace:
    """The graph of the ways within the bound on steps, from a state of each task to its goal.

    A node is a goal, a state and the steps that are left: at the start the distance and the model's
    slack.  Made from the starts on, layer by layer, so that it takes as long as it is large.
    """
    flat = distance.reshape(-1)
    begin = goal * len(space) + state  # within a layer a goal and a state are a node
    steps = flat[begin] + space.model.slack
    order = np.argsort(steps, kind="stable")
    most = int(steps.max(initial=0))
    bounds = np.searchsorted(steps[order], np.arange(most + 2))
    place = np.zeros(distance.size, np.int64)
    arriving = np.zeros(0, np.int64)
    layers, step_of, degrees, within = [], [], [], []
    starts = np.zeros(len(begin), np.int64)
    for left in range(most, -1, -1):
        mine = order[bounds[left] : bounds[left + 1]]
        keys = np.concatenate((arriving, begin[mine]))
        place[keys] = np.arange(len(keys))
        here = np.sort(keys[place[keys] == np.arange(len(keys))])
        place[here] = np.arange(len(here))
        within.append(narrow(place[arriving]))
        starts[mine] = place[begin[mine]]
        layers.append(here)
        at = here % len(space)
        counts = space.first[at + 1] - space.first[at]
        step = ranges(space.first[at], counts)
        arriving = np.repeat(here - at, counts) + space.target[step].astype(np.int64)
        after = flat[arriving]
        kept = (after >= 0) & (after < left)  # what is left after the step is never too little
        first = kept_runs(np.concatenate(([0], np.cumsum(counts))), kept)
        degrees.append(np.diff(first))
        step_of.append(narrow(step[kept]))
        arriving = arriving[kept]
    sizes = np.array([len(here) for here in reversed(layers)])
    below = np.cumsum([0, *sizes])
    nodes = np.concatenate(layers[::-1])
    step = np.concatenate(step_of[::-1])
    return PlanSpace(
        model=space.model,
        rows=space.rows,
        state=nodes % len(space),
        goal=nodes // len(space),
        layer=np.repeat(np.arange(len(sizes)), sizes),
        first=np.concatenate(([0], np.cumsum(np.concatenate(degrees[::-1])))),
        # Of the layers from the lowest on, the edges out of the second lead to the first.
        target=narrow(np.concatenate([own + below[k] for k, own in enumerate(within[::-1])])),
        labels=space.labels[step],
        cost=space.cost[step],
        goals=(),
        starts=starts + below[steps],
        second=np.zeros(0, np.int64),
    )


# ---- slack


def search_within(model: JointModel, task: PlanningTask, makespan: int) -> PlanSpace:
    """The plans of one task within the model's slack; ``makespan`` is the least one.

    A state is kept if the steps to it and a lower bound on the steps from it are within the bound.
    Breadth first, so that the steps to it are the least: every state of such a plan is kept.
    """
    heuristic, steps = search_heuristic("auto", model, task), makespan + model.slack
    found = Exploration(model, task.init[None, :])

    def so_far() -> str:
        return f"{found.states:,} states within {found.depth} of {steps} steps of {task.name}"

    def only(_: Ints, rows: Rows, options: Options) -> Options:
        return heuristic.in_time(rows, options, steps - found.depth - 1)[0]

    with reaching(so_far, "less slack"):
        while len(found.layers[-1]) and found.depth < steps:
            new = found.expand(only)
            if heuristic.value is not None:
                bound = heuristic.value(found.table.rows(new))
                new = new[found.depth + 1 + bound <= steps]
            found.layers.append(new)
        found.expand()  # goal states that are met in the last layer rest there, as do others
        space = found.space()
    with reaching(lambda: f"the plans within slack, over {len(space):,} states", "less slack"):
        return _on_plans(_plan_space(space, [(task.goal, task.init[None, :])]))


def rests(labels: Labels) -> Bools:
    """In which of these joint steps (steps, robots) every robot idles."""
    found: Bools = (labels == 0).all(axis=1)
    return found


def require_rest(graph: PlanSpace) -> None:
    """Raise `UsageError` where a goal is reached early and the robots cannot all rest there.

    ``graph`` are the nodes that the tasks' plans pass through, goal states among them with steps
    left; from all others some step is on a shortest way.
    """
    ends = np.zeros(len(graph), np.bool_)
    for number, goal in enumerate(graph.goals):
        mine = np.flatnonzero(graph.goal == number)
        ends[mine] = graph.model.holds(goal, graph.rows[graph.state[mine]])
    good = rests(graph.labels) & ends[graph.target]
    can = graph.layer == 0
    can[graph.sources[good]] = True
    stuck = np.flatnonzero(ends & ~can)
    if len(stuck):
        text = graph.model.state_text(graph.rows[graph.state[stuck[0]]])
        raise UsageError(
            f"--slack: a plan that is early must be able to wait, but in the goal state {text} the "
            "robots cannot all idle",
            remedy="Give the domain a joint step in which nothing is done, or leave out --slack.",
        )


def seen_rows(model: JointModel, rows: Rows) -> Rows:
    """All states with all that may be left of the slack, where states say it; else the states."""
    if not model.slack_facts:
        return rows
    every = np.tile(rows, (len(model.slack_facts), 1))
    for left, fact in enumerate(model.slack_facts):
        model.codec.set(every, slice(left * len(rows), (left + 1) * len(rows)), fact)
    return unique_rows(every)[0]


def seeing(graph: PlanSpace, left: Ints, rows: Rows) -> PlanSpace:
    """A graph whose states say what is ``left`` (nodes) of the slack, over `seen_rows`."""
    model = graph.model
    own = graph.rows[graph.state].copy()
    for slack, fact in enumerate(model.slack_facts):
        model.codec.set(own, left == slack, fact)
    return replace(graph, rows=rows, state=find_rows(rows, own))
