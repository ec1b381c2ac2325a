# SPDX-License-Identifier: GPL-3.0-or-later
"""Tasks as a file lists them, made of patterns or in a joint model: texts to atoms and back."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Iterator, Sequence, Set
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Annotated, Any

import msgspec
import numpy as np

from planners.grounding.instantiate import goal_grounder
from planners.joint.model import FullState, Goal, JointModel, PlanningTask, show
from planners.joint.states import split_atoms
from planners.joint.tables import Bools
from planners.loading import PlanningInstance, build
from planners.pddl.formula_tree import conjuncts, formula_text
from planners.pddl.formulas import read_formula
from planners.pddl.lifted import And, Atom, Domain, Formula, Problem
from planners.pddl.model_options import ModelOptions
from planners.pddl.names import Names
from planners.pddl.robots import fluent_predicates
from planners.pddl.sexpr import Source, parse
from planners.search.optimal_plans import distances_to
from planners.search.reachable import explore
from planners.system.errors import BadInput, Position, ProvedImpossible, UsageError, note
from planners.system.files import FileFormat, doc, read_bytes

#: What messages call tasks that are of no file.
TASKS_GIVEN = Position("the tasks")


@dataclass(frozen=True, slots=True)
class ListedTask:
    """A task as a file lists it, as PDDL text."""

    init: Annotated[tuple[str, ...], doc("The fluents that are true at the start, as PDDL atoms.")]
    goal: Annotated[
        tuple[str, ...],
        doc("PDDL literals or formulas that must all hold at the end."),
    ]


def listed_task(domain: Domain, problem: Problem, task: PlanningTask) -> ListedTask:
    """A problem's own task as a file lists it."""
    fluents = fluent_predicates(domain)
    init = sorted(show(atom) for atom in problem.init if atom.predicate in fluents)
    return ListedTask(tuple(init), goal_atoms(task.goal))


def model_of_listed(
    domain: Domain,
    problems: Sequence[Problem],
    listed: Sequence[ListedTask],
    options: ModelOptions | None = None,
    position: Position = TASKS_GIVEN,
) -> tuple[PlanningInstance, list[PlanningTask]]:
    """The joint model in which listed tasks can start, and these tasks in it, named by number.

    Everything static comes from the first problem.

    Raises `BadInput` for a text that is no atom or formula of the problem.
    """
    ground = [*ground_tasks(domain, problems[0], listed, position)]
    loaded = build(domain, problems, options, inits=[init for init, _ in ground])
    tasks = [
        PlanningTask(f"{number}", loaded.model.state(init), goal)
        for number, (init, goal) in enumerate(ground, 1)
    ]
    return loaded, tasks


def goal_text(model: JointModel, goal: Goal) -> str:
    """A goal as PDDL text."""
    if isinstance(goal, FullState):
        return " ".join(model.codec.facts.texts[fact] for fact in goal.facts)
    return " ".join(goal_atoms(goal)) or "(and)"


def goal_atoms(goal: Goal) -> tuple[str, ...]:
    """The parts of a goal formula as a task file lists them."""
    assert not isinstance(goal, FullState)
    return tuple(map(formula_text, conjuncts(goal)))


def ground_tasks(
    domain: Domain, problem: Problem, listed: Iterable[ListedTask], position: Position = TASKS_GIVEN
) -> Iterator[tuple[frozenset[Atom], Formula]]:
    """The true fluents at the start, and the ground goal, of each task.

    Everything static comes from the problem.  Raises `BadInput` for a text that is no atom or
    formula of it.
    """
    names = Names(domain.types, domain.predicates, objects=problem.objects)
    fluents, ground = fluent_predicates(domain), goal_grounder(domain, problem)
    for task in listed:
        goal = And(tuple(_read_text(names, text, position) for text in task.goal))
        yield _read_init(names, problem, fluents, task, position), ground(goal)


def _read_init(
    names: Names,
    problem: Problem,
    fluents: Set[str],
    task: ListedTask,
    position: Position,
) -> frozenset[Atom]:
    atoms = set()
    for text in task.init:
        formula = _read_text(names, text, position)
        if not isinstance(formula, Atom):
            raise position.fail(
                f"{text} is no atom: 'init' lists what is true",
                "Leave out what is false: all that 'init' does not list.",
            )
        if formula.predicate not in fluents and formula not in problem.init:
            raise position.fail(
                f"{text} is static and false in {problem.source.name}",
                "Tasks of one file share their static facts: leave it out.",
            )
        atoms.add(formula)
    return frozenset(atom for atom in atoms if atom.predicate in fluents)


def _read_text(names: Names, text: str, position: Position) -> Formula:
    try:
        parts = split_atoms(text)
        if len(parts) != 1:
            raise position.fail("expected one PDDL literal", "As in (at r1 a) or (not (at r1 a)).")
        root = parse(Source(position.file, parts[0]))
        return read_formula(names, root)
    except BadInput as error:
        raise BadInput(f"{text}: {error.what}", position=position, remedy=error.remedy) from None


class TaskFile(msgspec.Struct, frozen=True):
    """A task file, version 1.  Keys that are not listed here are ignored by readers."""

    format: Annotated[str, doc("What kind of file this is.")]
    version: Annotated[int, doc("Readers refuse a version that they do not know.")]
    tasks: Annotated[list[ListedTask], doc("The tasks; each goal may be partial.")]


TASKS = FileFormat("tasks", "task file", TaskFile, "coordlang/tasks")


def read_task_file(path: str | Path) -> tuple[ListedTask, ...]:
    """Read a task file (docs/formats.md).  Raises `BadInput` for anything else."""
    position = Position(str(path))
    return _once(TASKS.decode(read_bytes(path), position), position)


def tasks_from_data(data: Any, position: Position) -> tuple[ListedTask, ...]:
    """Read the data of a task file.  Raises `BadInput` for anything else."""
    return _once(TASKS.decode(msgspec.json.encode(data, enc_hook=str), position), position)


def task_data(tasks: Sequence[ListedTask]) -> list[dict[str, list[str]]]:
    """Tasks as a file lists them."""
    return [{"init": list(task.init), "goal": list(task.goal)} for task in tasks]


def tasks_text(tasks: Sequence[ListedTask]) -> str:
    """A task file, one task a line."""
    lines = ",\n".join(f"  {json.dumps(task)}" for task in task_data(tasks))
    return f'{{"format": "{TASKS.format}", "version": {TASKS.version},\n "tasks": [\n{lines}]}}\n'


def each_once(tasks: Sequence[ListedTask]) -> tuple[ListedTask, ...]:
    """The tasks with their texts in lower case, with single spaces; each one once."""

    def plain(texts: Sequence[str]) -> tuple[str, ...]:
        return tuple(" ".join(text.lower().split()) for text in texts)

    plain_tasks = [ListedTask(plain(task.init), plain(task.goal)) for task in tasks]
    return tuple(plain_tasks[number] for number in first_of_equal(plain_tasks))


def first_of_equal(tasks: Sequence[ListedTask]) -> list[int]:
    """The numbers of the tasks that no task before them equals, in whatever order their texts."""
    first: dict[tuple[frozenset[str], frozenset[str]], int] = {}
    for number, task in enumerate(tasks):
        first.setdefault((frozenset(task.init), frozenset(task.goal)), number)
    return list(first.values())


def _once(file: TaskFile, position: Position) -> tuple[ListedTask, ...]:
    once = each_once(file.tasks)
    if again := len(file.tasks) - len(once):
        note(
            f"{again:,} of {len(file.tasks):,} tasks repeat another one: every task counts once",
            position=position,
        )
    return once


#: Entries of the table (goals, states) filled at a time.
_BATCH = 2_000_000


def varied_tasks(
    loaded: PlanningInstance, starts: Sequence[str], goals: Sequence[str]
) -> tuple[ListedTask, ...]:
    """The tasks that the patterns describe, sorted.

    A *pattern* is an atom in which ``?`` stands for any one name, as ``(at r1 ?)``.  A task starts
    in the problem's initial state or in a reachable state that differs from it in atoms of the
    ``starts`` only; its goal is a conjunction of one atom of each of the ``goals`` that some
    reachable state satisfies.  It is one if the goal can be reached and does not hold already.

    Without ``goals`` the problem's own goal is the only one.

    Raises `UsageError` for a pattern that no fact of the model matches, `ProvedImpossible` if there
    is no such task. O(reachable joint steps x goals).
    """
    model = loaded.model
    task = loaded.tasks[0]
    space = explore(model, task.init[None, :])
    facts, names = model.codec.truth(space.rows), model.codec.facts.texts
    free = [fact for pattern in starts for fact in _matching(names, pattern)]
    own = facts[space.numbers(task.init[None, :])[0]]
    here = np.flatnonzero(np.delete(facts == own, free, axis=1).all(axis=1))
    wanted: list[Goal] = [task.goal]
    if goals:
        atoms = model.codec.facts.atoms
        chosen = _goals(facts, [_matching(names, pattern) for pattern in goals])
        wanted = [And(tuple(map(atoms.__getitem__, goal))) for goal in chosen]
    size, found = max(1, _BATCH // len(space)), list[ListedTask]()
    for first in range(0, len(wanted), size):
        some = wanted[first : first + size]
        for goal, far in zip(some, distances_to(space, some), strict=True):
            text = goal_atoms(goal)
            for start in here[far[here] > 0].tolist():
                init = tuple(map(names.__getitem__, np.flatnonzero(facts[start])))
                found.append(ListedTask(init, text))
    if not found:
        raise ProvedImpossible(
            f"there is no such task: none of {len(here):,} starts reaches one of {len(wanted):,} "
            "goals that it is not at",
            remedy="Give patterns that match more atoms: ? stands for any one name.",
        )
    return tuple(sorted(found, key=lambda task: (task.init, task.goal)))


def _goals(facts: Bools, matching: Sequence[Sequence[int]]) -> list[tuple[int, ...]]:
    """The conjunctions of one matching fact of each pattern that some state satisfies."""
    columns = sorted({fact for found in matching for fact in found})
    goals: set[tuple[int, ...]] = set()
    for row in np.unique(facts[:, columns], axis=0):
        true = {columns[n] for n in np.flatnonzero(row)}
        choices = [[fact for fact in found if fact in true] for found in matching]
        goals |= {tuple(sorted(set(choice))) for choice in product(*choices)}
    return sorted(goals)


def _matching(names: Sequence[str], pattern: str) -> list[int]:
    """The numbers of the facts that a pattern matches."""
    wanted = " ".join(pattern.lower().replace("(", " ( ").replace(")", " ) ").split())
    wanted = wanted.replace("( ", "(").replace(" )", ")")
    expression = re.escape(wanted).replace(r"\?", r"[^ ()]+")
    found = [n for n, fact in enumerate(names) if re.fullmatch(expression, fact)]
    if not found:
        raise UsageError(
            f"no fluent of this problem matches {pattern}",
            remedy="A pattern is an atom with ? for any one name, as in '(at r1 ?)'; coordlang "
            "inspect lists the fluents.",
        )
    return found
