# SPDX-License-Identifier: GPL-3.0-or-later
"""Candidate tasks: the tasks that a language must serve, and their plan spaces."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import compress
from typing import Literal

import numpy as np

from coordlang.language.listed import ListedTask, goal_text, listed_task, model_of_listed
from coordlang.language.reached import MOST_STATES, explored_if_small, surely_unreachable, unchecked
from coordlang.language.shared_search import SharedSearch
from planners.joint.model import NO_FACT, FullState, Goal, JointModel, PlanningTask
from planners.joint.tables import Ints, Rows, find_rows, unique_rows
from planners.loading import PlanningInstance, build
from planners.pddl.lifted import Domain, Problem
from planners.pddl.model_options import ModelOptions
from planners.search.kept_plans import search, search_each
from planners.search.optimal_plans import joined, plan_spaces, solvable
from planners.search.plan_space import PlanSpace
from planners.search.portions import Explored, PlanSpaces, Searched, Source
from planners.search.reachable import explore
from planners.system.errors import BadInput, Position, ProvedImpossible, note

Kind = Literal["problems", "all", "file"]


@dataclass(frozen=True, slots=True)
class Candidates:
    """The candidate tasks ``T`` over one joint model.

    ``kind`` "problems": the problems' own tasks; "all": every ordered pair of different reachable
    states; "file": ``listed``.  ``spaces`` are their optimal plans, in batches over one common
    table of states; ``count`` is the number of tasks.  ``states`` is the number of reachable states
    where the whole space was explored, else None. ``skipped`` names tasks that were left out
    because they have no plan.  ``source`` makes the plan spaces of any portion of the goals, where
    that is done as jobs.
    """

    kind: Kind
    loaded: PlanningInstance
    listed: tuple[ListedTask, ...]
    spaces: Sequence[PlanSpace]
    source: Source
    states: int | None
    skipped: tuple[str, ...] = ()

    @property
    def model(self) -> JointModel:
        """The joint model of the tasks."""
        return self.loaded.model

    @property
    def count(self) -> int:
        """How many tasks there are."""
        return self.source.tasks

    @property
    def rows(self) -> Rows:
        """The table of states that every plan space's state numbers refer to."""
        return self.source.rows


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
        listed.append(listed_task(domain, problem, task))
    plans = joined(spaces)
    return Candidates(
        "problems", loaded, tuple(listed), (plans,), Searched(plans), None, tuple(skipped)
    )


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
    source = Explored(space, _to_each_state(loaded.model, space.rows))
    return Candidates("all", loaded, (), PlanSpaces(source), source, len(space))


def _all_pairs_remembering(loaded: PlanningInstance, inits: Rows) -> Candidates:
    """The same pairs of states as without ``--remember-actions``.

    Every task starts with no action to remember.
    """
    model = loaded.model
    forgetting = replace(model.without_slack, codec=replace(model.codec, memory=None))
    base = explore(forgetting, model.codec.facts_part(inits))
    zeros = np.zeros((len(base), len(model.robots)), np.uint64)
    starts = np.hstack((base.rows, zeros))
    groups = []
    for space in plan_spaces(base, _to_each_state(forgetting, base.rows)):
        goal_of_task, state = space.goal[space.starts], space.state[space.starts]
        for number, goal in enumerate(space.goals):
            mine = state[goal_of_task == number]
            if len(mine):
                groups.append((goal, starts[mine]))
    extended = explore(model, starts)
    source = Explored(extended, groups)
    return Candidates("all", loaded, (), PlanSpaces(source), source, len(base))


def _to_each_state(model: JointModel, rows: Rows) -> list[tuple[Goal, None]]:
    """For each state the tasks to get there, from every state that can."""
    return [(model.full_state(row), None) for row in rows]


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

    A small space is explored once for all of them; in a large one each task is searched by itself,
    and of its initial state only state variables are checked (a note says what is not).

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
    loaded, tasks = model_of_listed(domain, problems, listed, options, position)
    model = loaded.model
    space = explored_if_small(model, np.stack([task.init for task in loaded.tasks]))
    if space is None:
        return _one_by_one(loaded, problems[0], listed, tasks, position, skip_unsolvable)
    reached, _ = unique_rows(model.codec.facts_part(space.rows))
    inits = model.codec.facts_part(np.stack([task.init for task in tasks]))
    _refuse(model, tasks, np.flatnonzero(find_rows(reached, inits) < 0), problems[0], position)
    by_goal = _by_goal(tasks)
    if model.remembers:  # a task starts with no action to remember: those are states of their own
        space = explore(model, np.concatenate([inits for _, inits in by_goal]))
    kept = solvable(space, by_goal) if skip_unsolvable else []
    skipped: tuple[str, ...] = ()
    if kept:
        served = _served(tasks, kept)
        skipped = tuple(
            f"task {number} ({_init_text(task)} -> {_goal_text(task)})"
            for number, (task, good) in enumerate(zip(listed, served, strict=True), 1)
            if not good
        )
        listed = list(compress(listed, served))
    try:
        spaces = tuple(plan_spaces(space, kept or by_goal))
    except ProvedImpossible as error:
        number = _served(tasks, solvable(space, by_goal)).index(False)
        raise _unsolvable(number + 1, listed[number], position, error) from None
    source = Explored(space, kept or by_goal)
    return Candidates("file", loaded, tuple(listed), spaces, source, len(reached), skipped)


def _refuse(
    model: JointModel,
    tasks: Sequence[PlanningTask],
    unreachable: Sequence[int] | Ints,
    problem: Problem,
    position: Position | None,
) -> None:
    """Raise `BadInput` for the first of the tasks whose start cannot be reached, if there is one.

    Such a state is taken for a mistake.
    """
    if len(unreachable):
        number = int(unreachable[0])
        raise BadInput(
            f"task {number + 1}: the state {model.state_text(tasks[number].init)} cannot be "
            "reached "
            f"from the initial state of {problem.source.name}",
            position=position,
            remedy="Is a fluent missing or one too many?  List all fluents that are true.",
        )


def _one_by_one(
    loaded: PlanningInstance,
    problem: Problem,
    listed: Sequence[ListedTask],
    tasks: Sequence[PlanningTask],
    position: Position | None,
    skip_unsolvable: bool,
) -> Candidates:
    """Listed tasks in a large space, each searched by itself, see `from_listed`."""
    model = loaded.model
    starts = [task.init for task in loaded.tasks]
    inits = np.stack([task.init for task in tasks])
    _refuse(model, tasks, surely_unreachable(model, starts, inits), problem, position)
    if unknown := unchecked(starts, inits):
        note(
            f"{len(unknown):,} of {len(tasks):,} tasks start elsewhere than the problem, which has "
            f"more than {MOST_STATES:,} states or many joint steps: that it reaches these states "
            "is not checked",
            position=position,
        )
    known = SharedSearch(model)
    spaces: list[PlanSpace] = []
    kept: list[ListedTask] = []
    skipped: list[str] = []
    for number, (text, task) in enumerate(zip(listed, tasks, strict=True), 1):
        try:
            spaces.append(known.search(task))
        except ProvedImpossible as error:
            if not skip_unsolvable or len(skipped) == len(tasks) - 1:
                raise _unsolvable(number, text, position, error) from None
            skipped.append(f"task {number} ({_init_text(text)} -> {_goal_text(text)})")
            continue
        kept.append(text)
    plans = joined(spaces)
    return Candidates("file", loaded, tuple(kept), (plans,), Searched(plans), None, tuple(skipped))


def _unsolvable(
    number: int, task: ListedTask, position: Position | None, error: ProvedImpossible
) -> ProvedImpossible:
    return ProvedImpossible(
        f"task {number}: the goal {_goal_text(task)} cannot be reached from {_init_text(task)}",
        position=position,
        remedy=error.remedy,
    )


def _by_goal(tasks: Sequence[PlanningTask]) -> list[tuple[Goal, Rows]]:
    """Goals, each with the initial states of its tasks."""
    inits: dict[Goal, list[Rows]] = {}
    for task in tasks:
        inits.setdefault(task.goal, []).append(task.init)
    return [(goal, np.stack(rows)) for goal, rows in inits.items()]


def _served(tasks: Sequence[PlanningTask], kept: Sequence[tuple[Goal, Rows]]) -> list[bool]:
    """Of each task whether it is among goals with initial states."""
    known = {(goal, init.tobytes()) for goal, inits in kept for init in inits}
    return [(task.goal, task.init.tobytes()) in known for task in tasks]


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

    They are searched one by one, without the rest of the space.
    """
    loaded, tasks = model_of_listed(domain, problems, listed, options, position)
    plans = search_each(loaded.model, tasks)
    return Candidates("problems", loaded, tuple(listed), (plans,), Searched(plans), None)


def describe(space: PlanSpace, task: int) -> str:
    """``INIT -> GOAL`` in words of the model."""
    node = space.starts[task]
    init = space.model.state_text(space.rows[space.state[node]])
    goal = space.goals[space.goal[node]]
    empty = NO_FACT if isinstance(goal, FullState) else "(and)"
    return f"{init} -> {goal_text(space.model, goal) or empty}"


def require_solvable(candidates: Candidates) -> None:
    """Raise `ProvedImpossible` when there is no task at all to build a language for."""
    if candidates.count == 0:
        raise ProvedImpossible(
            "there is no candidate task: no reachable state leads to another one",
            remedy="`coordlang inspect` shows what robots can do at the start.",
        )
