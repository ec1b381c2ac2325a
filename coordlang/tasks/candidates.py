"""Candidate tasks: the tasks that a language must serve, and their plan spaces."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from coordlang.tasks.task_file import ListedTask, goal_atoms, goal_text, ground_tasks
from planners.errors import BadInput, Position, ProvedImpossible
from planners.joint.model import NO_FACT, FullState, Goal, JointModel, show
from planners.loading import ModelOptions, PlanningInstance, PlanningTask, build
from planners.pddl.lifted import Domain, Problem
from planners.pddl.robots import fluent_predicates
from planners.search.optimal_plans import (
    TaskGroup,
    joined,
    plan_spaces,
    search,
    search_each,
    solvable,
)
from planners.search.plan_space import PlanSpace
from planners.search.reachable import explore
from planners.tables import Rows, find_rows, unique_rows

Kind = Literal["problems", "all", "file"]


@dataclass(frozen=True, slots=True)
class Candidates:
    """The candidate tasks ``T`` over one joint model.

    ``kind`` "problems": the problems' own tasks; "all": every ordered pair of different reachable
    states; "file": ``listed``.  ``spaces`` are their optimal plans, in batches over one common
    table of states; ``count`` is the number of tasks.  ``states`` is the number of reachable states
    where the whole space was explored, else None. ``skipped`` names tasks that were left out
    because they have no plan.
    """

    kind: Kind
    loaded: PlanningInstance
    listed: tuple[ListedTask, ...]
    spaces: tuple[PlanSpace, ...]
    states: int | None
    skipped: tuple[str, ...] = ()

    @property
    def model(self) -> JointModel:
        return self.loaded.model

    @property
    def count(self) -> int:
        return sum(len(space.starts) for space in self.spaces)

    @property
    def rows(self) -> Rows:
        """The table of states that every plan space's state numbers refer to."""
        return self.spaces[0].rows


def from_problems(
    domain: Domain,
    problems: Sequence[Problem],
    options: ModelOptions | None = None,
    *,
    skip_unsolvable: bool = False,
) -> Candidates:
    """The tasks of the given problems.

    Raises `ProvedImpossible` for an unsolvable one, naming it; with ``skip_unsolvable`` only if
    there is no other.
    """
    loaded = build(domain, problems, options)
    listed: list[ListedTask] = []
    spaces: list[PlanSpace] = []
    skipped: list[str] = []
    for problem, task in zip(problems, loaded.tasks, strict=True):
        try:
            spaces.append(search(loaded.model, task))
        except ProvedImpossible:
            if not skip_unsolvable or len(skipped) == len(problems) - 1:
                raise
            skipped.append(problem.source.name)
            continue
        listed.append(_as_listed(domain, problem, task))
    return Candidates("problems", loaded, tuple(listed), (joined(spaces),), None, tuple(skipped))


def all_pairs(
    domain: Domain, problems: Sequence[Problem], options: ModelOptions | None = None
) -> Candidates:
    """Every ordered pair of different states reachable in the problem, the second from the first.

    Goals are full states.
    """
    loaded = build(domain, problems, options)
    inits = np.stack([task.init for task in loaded.tasks])
    if loaded.model.remembers:
        return _all_pairs_remembering(loaded, inits)
    space = explore(loaded.model, inits)
    spaces = tuple(
        plan_spaces(space, [TaskGroup(goal) for goal in _full_states(loaded.model, space.rows)])
    )
    return Candidates("all", loaded, (), spaces, len(space))


def _all_pairs_remembering(loaded: PlanningInstance, inits: Rows) -> Candidates:
    """The same pairs of states as without ``--remember-actions``.

    Every task starts with no action to remember.
    """
    model = loaded.model
    forgetting = replace(model, codec=replace(model.codec, memory=None))
    base = explore(forgetting, inits[:, : model.codec.fact_blocks])
    zeros = np.zeros((len(base), len(model.robots)), np.uint64)
    starts = np.hstack((base.rows, zeros))
    groups = []
    for space in plan_spaces(
        base, [TaskGroup(goal) for goal in _full_states(forgetting, base.rows)]
    ):
        goal_of_task, state = space.goal[space.starts], space.state[space.starts]
        for number, goal in enumerate(space.goals):
            mine = state[goal_of_task == number]
            if len(mine):
                groups.append(TaskGroup(goal, starts[mine]))
    extended = explore(model, starts)
    return Candidates("all", loaded, (), tuple(plan_spaces(extended, groups)), len(base))


def _full_states(model: JointModel, rows: Rows) -> list[Goal]:
    return [model.full_state(row) for row in rows]


def from_listed(
    domain: Domain,
    problems: Sequence[Problem],
    listed: Sequence[ListedTask],
    options: ModelOptions | None = None,
    position: Position | None = None,
    *,
    skip_unsolvable: bool = False,
) -> Candidates:
    """The tasks of a task file; everything static comes from the problem.

    Raises
    ------
    ProvedImpossible
        A task without a plan; with ``skip_unsolvable`` only if no other task is left.
    BadInput
        An empty list, an atom that the problem does not have, or an initial state that the
        problem's initial state does not reach (such a state is taken for a mistake).
    """
    if not listed:
        raise BadInput(
            "the list of tasks is empty", position=position, remedy="Give at least one task."
        )
    ground = ground_tasks(domain, problems[0], listed, position)
    loaded = build(domain, problems, options, inits=[init for init, _ in ground])
    model = loaded.model
    space = explore(model, np.stack([task.init for task in loaded.tasks]))
    reached, _ = unique_rows(space.rows[:, : model.codec.fact_blocks])
    groups: dict[Goal, list[Rows]] = {}
    for number, (init, goal) in enumerate(ground, 1):
        row = model.state(init)
        if find_rows(reached, row[None, : model.codec.fact_blocks])[0] < 0:
            raise BadInput(
                f"task {number}: the state {model.state_text(row)} cannot be reached from the initial "
                f"state of {problems[0].source.name}",
                position=position,
                remedy="Is a fluent missing or one too many?  List all fluents that are true.",
            )
        groups.setdefault(goal, []).append(row)
    if model.remembers:  # a task starts with no action to remember: those are states of their own
        space = explore(model, np.stack([row for rows in groups.values() for row in rows]))
        states = len(reached)
    else:
        states = len(space)
    grouped = [TaskGroup(goal, np.stack(rows)) for goal, rows in groups.items()]

    def solved(kept: Sequence[TaskGroup]) -> list[bool]:
        served = {
            (g.goal, tuple(row.tolist())) for g in kept if g.inits is not None for row in g.inits
        }
        return [(goal, tuple(model.state(init).tolist())) in served for init, goal in ground]

    skipped: list[str] = []
    if skip_unsolvable and (kept := solvable(space, grouped)):
        good = solved(kept)
        skipped = [
            f"task {n} ({_init_text(t)} -> {_goal_text(t)})"
            for n, (t, ok) in enumerate(zip(listed, good, strict=True), 1)
            if not ok
        ]
        listed = [task for task, ok in zip(listed, good, strict=True) if ok]
        grouped = kept
    try:
        spaces = tuple(plan_spaces(space, grouped))
    except ProvedImpossible as error:
        number = solved(solvable(space, grouped)).index(False)
        raise ProvedImpossible(
            f"task {number + 1}: the goal {_goal_text(listed[number])} cannot be reached from {_init_text(listed[number])}",
            position=position,
            remedy=error.remedy,
        ) from None
    return Candidates("file", loaded, tuple(listed), spaces, states, tuple(skipped))


def _init_text(task: ListedTask) -> str:
    return " ".join(task.init) or NO_FACT


def _goal_text(task: ListedTask) -> str:
    return " ".join(task.goal) or "(and)"


def from_recorded(
    domain: Domain,
    problems: Sequence[Problem],
    listed: Sequence[ListedTask],
    options: ModelOptions | None = None,
    position: Position | None = None,
) -> Candidates:
    """Problems' tasks as a language file records them.

    Searched one by one, without the rest of the space.
    """
    ground = ground_tasks(domain, problems[0], listed, position)
    loaded = build(domain, problems, options, inits=[init for init, _ in ground])
    tasks = [
        PlanningTask(f"{n}", loaded.model.state(init), goal)
        for n, (init, goal) in enumerate(ground, 1)
    ]
    return Candidates("problems", loaded, tuple(listed), (search_each(loaded.model, tasks),), None)


def describe(space: PlanSpace, task: int) -> str:
    """``INIT -> GOAL`` in words of the model."""
    node = space.starts[task]
    init = space.model.state_text(space.rows[space.state[node]])
    goal = space.goals[space.goal[node]]
    empty = NO_FACT if isinstance(goal, FullState) else "(and)"
    return f"{init} -> {goal_text(space.model, goal) or empty}"


def _as_listed(domain: Domain, problem: Problem, task: PlanningTask) -> ListedTask:
    fluents = fluent_predicates(domain)
    init = sorted(show(a) for a in problem.init if a.predicate in fluents)
    return ListedTask(tuple(init), goal_atoms(task.goal))


def require_solvable(candidates: Candidates) -> None:
    """Raise `ProvedImpossible` when there is no task at all to build a language for."""
    if candidates.count == 0:
        raise ProvedImpossible(
            "there is no candidate task: no reachable state leads to another one"
        )
