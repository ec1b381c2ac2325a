# SPDX-License-Identifier: GPL-3.0-or-later
"""Candidate tasks: the tasks that a language must serve, and their plan spaces."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np

from coordlang.language.listed import (
    TASKS_GIVEN,
    ListedTask,
    first_of_equal,
    goal_text,
    listed_task,
    model_of_listed,
)
from planners.joint.model import NO_FACT, Goal, JointModel, PlanningTask
from planners.joint.tables import Bools, Rows, find_rows, unique_rows
from planners.loading import PlanningInstance, build
from planners.pddl.lifted import Domain, Problem
from planners.pddl.model_options import ModelOptions
from planners.search.asynchronous import as_executed
from planners.search.goals import searched
from planners.search.kept_plans import search
from planners.search.optimal_plans import distances_to, joined, solvable
from planners.search.plan_space import PlanSpace
from planners.search.portions import Explored, Searched, Source
from planners.search.reachable import Exploration, Space, explore
from planners.search.state_variables import state_variables
from planners.system.errors import Position, ProvedImpossible, note

Kind = Literal["problems", "all", "file"]

#: A space of more states than this, or with more joint steps composed, is not explored for listed
#: tasks: they are searched one by one.
MOST_STATES = 20_000
MOST_STEPS = 4_000_000


@dataclass(frozen=True)
class Candidates:
    """The candidate tasks ``T`` over one joint model.

    ``kind`` "problems": the problems' own tasks; "all": every ordered pair of different reachable
    states; "file": ``listed``.  ``source`` makes their plan spaces, those of any portion of the
    goals where that is done as jobs.  ``states`` is the number of reachable states where the whole
    space was explored, else None.  ``skipped`` names tasks that were left out because they have no
    plan.
    """

    kind: Kind
    loaded: PlanningInstance
    source: Source
    states: int | None = None
    listed: tuple[ListedTask, ...] = ()
    skipped: tuple[str, ...] = ()

    @cached_property
    def spaces(self) -> Sequence[PlanSpace]:
        """The optimal plans of the tasks, in batches over one common table of states."""
        return self.source.spaces

    @property
    def model(self) -> JointModel:
        """The joint model of the tasks."""
        return self.loaded.model

    @property
    def count(self) -> int:
        """How many tasks there are."""
        return self.source.tasks

    @property
    def are_pairs_of_facts(self) -> bool:
        """Whether they are all pairs of states, in which nothing but facts counts."""
        model = self.model
        has_more = model.remembers or model.slack or model.is_asynchronous
        return self.kind == "all" and not has_more

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
    """The tasks of the given problems, each one once.

    Raises `ProvedImpossible` for an unsolvable one, naming it; with ``skip_unsolvable`` only if
    there is no other.
    """
    loaded = build(domain, problems, options)
    pairs = zip(problems, loaded.tasks, strict=True)
    listed = [listed_task(domain, problem, task) for problem, task in pairs]
    numbers = first_of_equal(listed)
    listed = [listed[number] for number in numbers]
    tasks = [loaded.tasks[number] for number in numbers]
    return _one_by_one("problems", loaded, listed, tasks, skip_unsolvable)


def all_pairs(
    domain: Domain, problems: Sequence[Problem], options: ModelOptions | None = None
) -> Candidates:
    """Every ordered pair of different states reachable in the problem, the second from the first.

    Goals are full states.  With ``--remember-actions`` they are the same pairs: every task starts
    with no action to remember.
    """
    loaded = build(domain, problems, options)
    model, inits = loaded.model, _inits(loaded.tasks)
    if not model.remembers:
        space = explore(model, inits)
        return Candidates("all", loaded, Explored(space, _to_each_state(space)), len(space))
    forgetting = replace(model.without_slack, codec=replace(model.codec, memory=None))
    base = explore(forgetting, model.codec.facts_part(inits))
    starts = model.codec.remembering(base.rows, np.full((len(base), len(model.robots)), -1))
    goals = [goal for goal, _ in _to_each_state(base)]
    far = zip(goals, distances_to(base, goals), strict=True)
    groups = [(goal, starts[steps > 0]) for goal, steps in far if (steps > 0).any()]
    return Candidates("all", loaded, Explored(explore(model, starts), groups), len(base))


def _to_each_state(space: Space) -> list[tuple[Goal, Rows | None]]:
    """For each state the tasks to get there, from every state that can."""
    return [(space.model.full_state(row), None) for row in space.rows]


def from_listed(
    domain: Domain,
    problems: Sequence[Problem],
    listed: Sequence[ListedTask],
    options: ModelOptions | None = None,
    position: Position = TASKS_GIVEN,
    *,
    kind: Kind = "file",
    skip_unsolvable: bool = False,
) -> Candidates:
    """The tasks of a task file; everything static comes from the problem.

    A small space is explored once for all of them; in a large one each task is searched by itself,
    and of its initial state only state variables are checked (a note says what is not).  Those of
    ``kind`` "problems", as a language file records them, are searched one by one.

    Raises `ProvedImpossible` for a task without a plan; with ``skip_unsolvable`` only if no other
    task is left.  Raises `BadInput` for an empty list, an atom that the problem does not have, or
    an initial state that the problem's does not reach (such a state is taken for a mistake).
    """
    if not listed:
        raise position.fail("the list of tasks is empty", "Give at least one task.")
    loaded, tasks = model_of_listed(domain, problems, listed, options, position)
    if kind == "problems":
        return _one_by_one(kind, loaded, listed, tasks)
    model, starts, inits = loaded.model, _inits(loaded.tasks), _inits(tasks)
    space = explored_if_small(model, starts)
    if space is None:
        _refuse_first(_surely_unreachable(model, starts, inits), loaded, inits, position)
        _note_unchecked(loaded, tasks, position)
        return _one_by_one("file", loaded, listed, tasks, skip_unsolvable, position)
    reached, _ = unique_rows(model.codec.facts_part(space.rows))
    unreachable = find_rows(reached, model.codec.facts_part(inits)) < 0
    _refuse_first(unreachable, loaded, inits, position)
    if model.remembers:  # a task starts with no action to remember: those are states of their own
        space = explore(model, inits)
    source, lost = _by_goal(space, tasks)
    if lost and not (skip_unsolvable and source.goals):
        remedy = searched(model, tasks[lost[0]].goal, space.rows)
        raise _unsolvable(lost[0], listed[lost[0]], position, remedy)
    skipped = {number: _named(number, listed[number]) for number in lost}
    served = tuple(task for number, task in enumerate(listed) if number not in skipped)
    return Candidates("file", loaded, source, len(reached), served, tuple(skipped.values()))


def _inits(tasks: Sequence[PlanningTask]) -> Rows:
    return np.stack([task.init for task in tasks])


def _refuse_first(
    unreachable: Bools, loaded: PlanningInstance, inits: Rows, position: Position
) -> None:
    """Raise `BadInput` for the first initial state of a task that the problem does not reach."""
    for number in np.flatnonzero(unreachable)[:1].tolist():
        raise position.fail(
            f"task {number + 1}: the state {loaded.model.state_text(inits[number])} cannot be "
            f"reached from the initial state of {loaded.problems[0].source.name}",
            "Is a fluent missing or one too many?  List all fluents that are true.",
        )


def _by_goal(space: Space, tasks: Sequence[PlanningTask]) -> tuple[Explored, list[int]]:
    """Tasks in an explored space, by goal; and the numbers of those that have no plan."""
    by_goal: dict[Goal, list[Rows]] = {}
    for task in tasks:
        by_goal.setdefault(task.goal, []).append(task.init)
    kept = solvable(space, [(goal, np.stack(inits)) for goal, inits in by_goal.items()])
    served = {(goal, init.tobytes()) for goal, inits in kept for init in inits}
    tasks_of = enumerate((task.goal, task.init.tobytes()) for task in tasks)
    return Explored(space, kept), [number for number, task in tasks_of if task not in served]


def explored_if_small(model: JointModel, inits: Rows) -> Space | None:
    """All states that are reachable, if they are few: see `MOST_STATES` and `MOST_STEPS`.

    Work is bounded before it is done: by products of the robots' own choices.
    """
    found, left = Exploration(model, inits), MOST_STEPS
    while len(found.layers[-1]):
        if found.states > MOST_STATES:
            return None
        left -= model.stepper.most_steps(model.codec.facts_part(found.layer))
        if left < 0:
            return None
        found.layers.append(found.expand())
    return found.space()


def _surely_unreachable(model: JointModel, starts: Rows, inits: Rows) -> Bools:
    """Which states no start can reach, as far as state variables prove it.

    Of the facts of a state variable exactly one is true in every state that a start reaches.
    """
    true = model.codec.truth(inits)
    possible = np.zeros(len(inits), np.bool_)
    for start in starts:
        own = np.ones(len(inits), np.bool_)
        for variable in state_variables(model, start):
            own &= true[:, list(variable.facts)].sum(axis=1) == 1
        possible |= own
    return ~possible


def _note_unchecked(
    loaded: PlanningInstance, tasks: Sequence[PlanningTask], position: Position
) -> None:
    """Say how many listed tasks start where it is not checked that the problem comes there."""
    known = {task.init.tobytes() for task in loaded.tasks}
    if unknown := sum(task.init.tobytes() not in known for task in tasks):
        note(
            f"{unknown:,} of {len(tasks):,} tasks start elsewhere than the problem, which has "
            f"more than {MOST_STATES:,} states or many joint steps: that it reaches these states "
            "is not checked",
            position=position,
        )


def _one_by_one(
    kind: Kind,
    loaded: PlanningInstance,
    listed: Sequence[ListedTask],
    tasks: Sequence[PlanningTask],
    skip_unsolvable: bool = False,
    position: Position = TASKS_GIVEN,
) -> Candidates:
    """Each task searched by itself; those without a plan are left out if they may be, but one.

    Tasks of a file with one goal share what is found.
    """
    kept: list[ListedTask] = []
    plans: dict[Goal, list[PlanSpace]] = {}
    spaces: list[PlanSpace] = []
    skipped: list[str] = []
    for number, (text, task) in enumerate(zip(listed, tasks, strict=True)):
        try:
            spaces.append(_search_once(loaded.model, task, plans if kind == "file" else {}))
            kept.append(text)
        except ProvedImpossible as error:
            if skip_unsolvable and len(skipped) < len(tasks) - 1:
                skipped.append(task.position.file if task.position else _named(number, text))
            elif kind == "file":
                raise _unsolvable(number, text, position, error.remedy) from None
            else:
                raise
    source = Searched(as_executed(joined(spaces)))
    return Candidates(kind, loaded, source, listed=tuple(kept), skipped=tuple(skipped))


def _search_once(
    model: JointModel, task: PlanningTask, found: dict[Goal, list[PlanSpace]]
) -> PlanSpace:
    """The plan space of a task: part of one that was found before, if it starts on plans there.

    From a state on an optimal plan the plan space holds all optimal plans to that goal; with slack,
    plans of another task may have used some of it.
    """
    if model.slack:
        return search(model, task)
    for space in found.setdefault(task.goal, []):
        state = int(find_rows(space.rows, task.init[None, :])[0])
        for node in np.flatnonzero(space.state == state)[:1].tolist():
            cost = int(space.cost[space.first_path(node)].sum())
            return space.with_tasks(np.array([node]), np.array([cost]))
    found[task.goal].append(search(model, task))
    return found[task.goal][-1]


def _texts(task: ListedTask) -> tuple[str, str]:
    return " ".join(task.init) or NO_FACT, " ".join(task.goal) or "(and)"


def _named(number: int, task: ListedTask) -> str:
    return f"task {number + 1} ({' -> '.join(_texts(task))})"


def _unsolvable(
    number: int, task: ListedTask, position: Position, remedy: str | None
) -> ProvedImpossible:
    init, goal = _texts(task)
    return ProvedImpossible(
        f"task {number + 1}: the goal {goal} cannot be reached from {init}",
        position=position,
        remedy=remedy,
    )


def describe(space: PlanSpace, task: int) -> str:
    """``INIT -> GOAL`` in words of the model."""
    node = space.starts[task]
    init = space.model.state_text(space.rows[space.state[node]])
    goal = goal_text(space.model, space.goals[space.goal[node]])
    return f"{init} -> {goal or NO_FACT}"


def require_solvable(candidates: Candidates) -> None:
    """Raise `ProvedImpossible` when there is no task at all to build a language for."""
    if candidates.count == 0:
        raise ProvedImpossible(
            "there is no candidate task: no reachable state leads to another one",
            remedy="`coordlang inspect` shows what robots can do at the start.",
        )
