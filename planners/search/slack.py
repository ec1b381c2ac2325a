# SPDX-License-Identifier: GPL-3.0-or-later
"""Slack: plans that take a few joint steps more than the least makespan.

A *plan within slack B* is a sequence of joint steps that ends in the goal and takes at most B steps
more than the least makespan ``m``; it may pass through the goal before.  Two of them that differ
only in a rest at the end, steps in which every robot idles, are one plan: all are written with
exactly ``m + B`` steps, the last ones at rest.  So the graph has nodes (state, steps left), and as
every joint step takes one of these, no node repeats on a plan although states may (Proposition 22
of docs/concepts.md).  Under a second cost component the plans within the bound that cost least are
meant.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from planners.joint.conditions import Labels
from planners.joint.model import JointModel, Options, PlanningTask
from planners.joint.tables import Bools, Ints, Rows, find_rows, unique_rows
from planners.search.heuristics import search_heuristic
from planners.search.plan_space import PlanSpace
from planners.search.reachable import PIECES, Exploration, PieceSizes, Space
from planners.system.errors import UsageError
from planners.system.limits import reaching


def explore_within(
    model: JointModel, task: PlanningTask, steps: int, pieces: PieceSizes = PIECES
) -> Space:
    """The states and joint steps of all plans of a task with at most so many steps, and some more.

    A state is kept if the steps to it and a lower bound on the steps from it are within ``steps``.
    Breadth first, so that the steps to it are the least: every state of such a plan is kept.  The
    joint steps are those between states that are kept.
    """
    heuristic = search_heuristic("auto", model, task)
    found = Exploration(model, task.init[None, :], pieces)

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
        return found.space()


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
