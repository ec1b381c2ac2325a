# SPDX-License-Identifier: GPL-3.0-or-later
"""Miscoordination shown: plans whose mixture breaks, the step at which it does, and why.

The earliest break of a task's mixtures comes from the robots' choices: breadth first over nodes
``(D_1 .. D_n, y)``, what each robot may still do and where the mixture is.  Different edges of a
node have different labels, so no more mixed actions are looked at than it has edges, and one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from coordlang.language.candidates import describe
from coordlang.required.choices import Choices
from planners.joint.model import JointModel, PlanningTask
from planners.search.optimal_plans import search
from planners.search.plan_space import PlanSpace
from planners.system.errors import ProvedImpossible
from planners.system.limits import reaching

#: The labels of all robots in one joint step.
Labels = tuple[int, ...]
#: A node of a walk: each robot's choices, and where their mixture is.
_Node = tuple[tuple[int, ...], int]


@dataclass(frozen=True, slots=True)
class Trail:
    """Plans, as edges, up to a breaking step or further: each robot's, and where all start."""

    start: int
    plans: Sequence[Sequence[int]]


def earliest_witness(choices: Choices, start: int) -> Trail:
    """Plans from a node that requires coordination whose mixture breaks in the fewest steps.

    As many robots as is easily possible follow the same plan.
    """
    steps = _first_break(choices, start)
    plans = _shared_plans(choices.space, start, steps)
    return Trail(start, [plan[: len(steps)] for plan in plans])


def _first_break(choices: Choices, start: int) -> tuple[Labels, ...]:
    """The fewest steps of a mixture that breaks with the last one, breadth first."""
    begin = tuple(choices.of_node[:, start].tolist())
    here: dict[_Node, tuple[Labels, ...]] = {(begin, start): ()}
    walked = 0

    def so_far() -> str:
        return f"{walked:,} nodes walked to the first break of a mixture"

    with reaching(so_far, choices.space.model.smaller("smaller tasks")):
        while here:
            below: dict[_Node, tuple[Labels, ...]] = {}
            for (chosen, y), way in here.items():
                walked += 1
                targets = choices.edges_of(y)
                for mixed, after in choices.steps(chosen):
                    target = targets.get(mixed)
                    if target is None:
                        return *way, mixed
                    if (after, target) not in below and choices.fails(after, target):
                        below[after, target] = *way, mixed
            here = below
    raise AssertionError("the node requires coordination")


def _shared_plans(space: PlanSpace, start: int, steps: Sequence[Labels]) -> list[list[int]]:
    """A plan for each robot that begins with its part of some steps: one for several, if found."""
    groups: list[list[int]] = []
    plans: list[list[int]] = []

    def plan_of(robots: Sequence[int]) -> list[int] | None:
        return space.path_of_robots(start, robots, [[step[r] for r in robots] for step in steps])

    for robot in range(space.robots):
        for number, group in enumerate(groups):
            if (together := plan_of([*group, robot])) is not None:
                group.append(robot)
                plans[number] = together
                break
        else:
            alone = plan_of([robot])
            assert alone is not None, "the robot's labels are those of some plan"
            groups.append([robot])
            plans.append(alone)
    of_robot = {r: plan for group, plan in zip(groups, plans, strict=True) for r in group}
    return [of_robot[robot] for robot in range(space.robots)]


def through_same_states(space: PlanSpace, trail: Trail) -> Trail:
    """The plans of a trail through the same states, made few, up to the step that breaks.

    As many robots as is easily possible follow the same plan.
    """
    on = np.zeros(len(space), np.bool_)
    on[space.nodes_on(trail.start, trail.plans[0])] = True
    task = np.flatnonzero(space.starts == trail.start)[:1]
    fits = replace(space, starts=space.starts[task], second=space.second[task]).within(on)
    _, mixture = _mixture(space, trail)
    plans = _shared_plans(fits, int(fits.starts[0]), mixture)
    paths = (space.path_with(trail.start, list(map(fits.labels_of, plan))) for plan in plans)
    return Trail(trail.start, [path for path in paths if path])


def _mixture(space: PlanSpace, trail: Trail) -> tuple[list[int], list[Labels]]:
    """The nodes that the mixture of a trail passes, and its steps up to the one that breaks."""
    nodes, steps = [trail.start], list[Labels]()
    for edges in zip(*trail.plans, strict=True):
        steps.append(tuple(space.labels_of(edge)[robot] for robot, edge in enumerate(edges)))
        mixed = space.edge_with(nodes[-1], steps[-1])
        if mixed is None:
            break
        nodes.append(space.target_of(mixed))
    return nodes, steps


def way_to(space: PlanSpace, node: int) -> tuple[int, list[int]]:
    """The nearest start of a task on whose plans a node lies, and the edges from it to the node."""
    leads = space.ancestors(np.array([node]))
    starts = space.starts[leads[space.starts]]
    start = at = int(starts[np.argmin(space.layer[starts])])
    path = []
    while at != node:
        path.append(next(e for e in space.out_edges(at) if leads[space.target_of(e)]))
        at = space.target_of(path[-1])
    return start, path


#: Characters of a state or goal that a message shows in full.
_LONGEST = 100
#: One joint step as text: each robot's subaction, None for idling.
Step = tuple[str | None, ...]


@dataclass(frozen=True, slots=True)
class Miscoordination:
    """Plans of one task that introduce RC: ``plans[i]`` is what robot i follows.

    ``states[i]`` are the states that plan i passes through (keys); ``mixture`` the joint steps of
    the mixture up to and with the one that breaks, ``mixed_states`` the states before each of them;
    ``step`` the number of the breaking step (from 0) and ``reason`` why it breaks.  ``sentence`` is
    the plans' common sentence where a language was checked.  ``kind`` is what the plans are: an
    "optimal plan" each, or one within the slack.
    """

    task: str
    robots: tuple[str, ...]
    plans: tuple[tuple[Step, ...], ...]
    states: tuple[tuple[str, ...], ...]
    mixture: tuple[Step, ...]
    mixed_states: tuple[str, ...]
    step: int
    reason: str
    sentence: tuple[str, ...] | None = None
    kind: str = "optimal plan"


def miscoordination(space: PlanSpace, task: int) -> Miscoordination | None:
    """Plans of a task whose mixture breaks earliest; None if none does."""
    choices = Choices(space)
    start = int(space.starts[task])
    if not choices.requires[start]:
        return None
    return describe_failure(space, earliest_witness(choices, start))


class Inseparable(ProvedImpossible):
    """Two plans introduce RC but pass through the same states.

    No state-based language can tell them apart.  With slack that the states of the ``model`` hide
    they differ in where they wait, without a common step in who waits for whom.
    """

    def __init__(self, witness: Miscoordination, model: JointModel) -> None:
        plans, waits = "optimal plans", ""
        remedy = (
            "Build with --remember-actions: the state then also holds each robot's last subaction."
        )
        if model.is_asynchronous:
            remedy = "Robots with a common step may have a language: leave out --asynchronous."
        elif model.hides_slack:
            plans, waits = "plans within slack", ", though they may wait in different ones"
            remedy = (
                "Build with --words-see-slack: states then also say how much of the slack is left; "
                "or with --remember-actions."
            )
        super().__init__(
            f"two {plans} of task {_short(witness.task)} introduce required coordination "
            f"but pass through the same states{waits}: no language over states can tell them apart",
            remedy=remedy,
        )
        self.witness = witness


def _short(task: str) -> str:
    """A long task's beginnings; the witness has all of it."""
    parts = task.split(" -> ")
    return " -> ".join(
        part if len(part) <= _LONGEST else f"{part[: part.index(')') + 1]} .." for part in parts
    )


def describe_failure(
    space: PlanSpace, trail: Trail, sentence: tuple[str, ...] | None = None
) -> Miscoordination:
    """A trail as text, with the plans completed to the goal.

    The mixture goes up to its breaking step, with the reason why it breaks.
    """
    model = space.model
    paths = [[*plan, *space.first_path(space.target_of(plan[-1]))] for plan in trail.plans]
    nodes, mixture = _mixture(space, trail)

    def keys(passed: Sequence[int]) -> tuple[str, ...]:
        return tuple(model.codec.key(space.rows[space.state[node]]) for node in passed)

    return Miscoordination(
        task=describe(space, int(np.flatnonzero(space.starts == trail.start)[0])),
        robots=model.robots,
        plans=tuple(tuple(model.texts(space.labels_of(e)) for e in path) for path in paths),
        states=tuple(keys(space.nodes_on(trail.start, path)) for path in paths),
        mixture=tuple(model.texts(labels) for labels in mixture),
        mixed_states=keys(nodes),
        step=len(mixture) - 1,
        reason=_reason(space, nodes[len(mixture) - 1], mixture[-1]),
        sentence=sentence,
        kind=model.kept_plan,
    )


def _reason(space: PlanSpace, node: int, labels: tuple[int, ...]) -> str:
    """Why the mixed joint action is no optimal step in a state: not applicable, or wasteful."""
    model = space.model
    if model.is_asynchronous:
        return "no optimal plan has these events, with what they wait for"
    row = space.rows[space.state[node]]
    steps = model.successors(row[None, :])
    same = np.flatnonzero((steps.labels == np.array(labels)).all(axis=1))
    if not len(same):
        return model.stepper.why_not(model.codec.facts_part(row), labels)
    goal = space.goals[space.goal[node]]
    left = int(space.layer[node]) - 1
    try:
        rest = PlanningTask("the rest", steps.result[same[0]], goal)
        onward = search(model.without_slack, rest)
    except ProvedImpossible:
        return "it is possible, but then the goal can no longer be reached"
    makespan, _ = onward.cost_of(0)
    if makespan > left:
        return (
            f"it is possible, but too late: the goal is then {makespan} steps away and {left} "
            "are left"
        )
    return f"it is possible and in time, but costs more than any {model.kept_plan}"
