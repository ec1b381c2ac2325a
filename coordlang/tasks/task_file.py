"""Task files (docs/formats.md), and the PDDL text of the states and goals in them."""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from planners.errors import BadInput, Position
from planners.grounding import ground_goal
from planners.joint.model import FullState, Goal, JointModel, show
from planners.joint.states import split_atoms
from planners.pddl.formulas import read_formula
from planners.pddl.lifted import And, Atom, Domain, Formula, Not, Or, Problem, Truth
from planners.pddl.names import Names
from planners.pddl.robots import fluent_predicates
from planners.pddl.sexpr import Source, parse

FORMAT = "coordlang/tasks"
VERSION = 1


@dataclass(frozen=True, slots=True)
class ListedTask:
    """A task as a task file lists it.

    True fluents at the start, literals (or formulas) at the end, as PDDL text.
    """

    init: tuple[str, ...]
    goal: tuple[str, ...]


def read_task_file(path: str | Path) -> tuple[ListedTask, ...]:
    """Read a task file (docs/formats.md).  Raises `BadInput` for anything else."""
    position = Position(str(path))
    try:
        data = json.loads(
            sys.stdin.read() if str(path) == "-" else Path(path).read_text("utf-8-sig")
        )
    except OSError as error:
        raise BadInput(f"cannot be read: {error.strerror}", position=position) from None
    except (ValueError, RecursionError) as error:
        raise BadInput(f"this is no JSON: {error}", position=position) from None
    return tasks_from_data(data, position)


def tasks_from_data(data: Any, position: Position) -> tuple[ListedTask, ...]:
    """The tasks in the data of a task file."""
    if not isinstance(data, dict) or data.get("format") != FORMAT:
        raise BadInput(f'expected a task file: {{"format": "{FORMAT}", ..}}', position=position)
    if data.get("version") != VERSION or data.get("version") is True:
        raise BadInput(
            f"task file version {data.get('version')!r}, expected {VERSION}", position=position
        )
    tasks = data.get("tasks")
    if not isinstance(tasks, list):
        raise BadInput("expected a list 'tasks'", position=position)
    return tuple(_listed(entry, number, position) for number, entry in enumerate(tasks, 1))


def task_data(tasks: Sequence[ListedTask]) -> dict[str, Any]:
    """The data of a task file."""
    return {
        "format": FORMAT,
        "version": VERSION,
        "tasks": [{"init": list(t.init), "goal": list(t.goal)} for t in tasks],
    }


def tasks_text(tasks: Sequence[ListedTask]) -> str:
    """A task file, one task a line."""
    lines = ",\n".join(f"  {json.dumps(task)}" for task in task_data(tasks)["tasks"])
    return f'{{"format": "{FORMAT}", "version": {VERSION},\n "tasks": [\n{lines}]}}\n'


def ground_tasks(
    domain: Domain, problem: Problem, listed: Sequence[ListedTask], position: Position | None = None
) -> list[tuple[frozenset[Atom], Formula]]:
    """Listed tasks as (true fluents, ground goal); everything static comes from the problem."""
    return [
        (
            _read_init(domain, problem, task, position),
            ground_goal(
                domain,
                problem,
                And(tuple(_read_text(domain, problem, text, position) for text in task.goal)),
            ),
        )
        for task in listed
    ]


def goal_text(model: JointModel, goal: Goal) -> str:
    """A goal as PDDL text."""
    if isinstance(goal, FullState):
        return " ".join(model.codec.facts.texts[fact] for fact in goal.facts)
    return " ".join(
        formula_text(part) for part in (goal.parts if isinstance(goal, And) else (goal,))
    )


def goal_atoms(goal: Goal) -> tuple[str, ...]:
    """The parts of a goal formula as a task file lists them."""
    assert not isinstance(goal, FullState)
    parts = goal.parts if isinstance(goal, And) else (goal,)
    return tuple(formula_text(p) for p in parts if p != Truth(True))


def formula_text(formula: Formula) -> str:
    """A ground formula as PDDL text."""
    match formula:
        case Atom():
            return show(formula)
        case Not(part):
            return f"(not {formula_text(part)})"
        case And(parts) | Or(parts):
            name = "and" if isinstance(formula, And) else "or"
            return "(" + " ".join((name, *map(formula_text, parts))) + ")"
        case Truth(value):
            return "(and)" if value else "(or)"
    raise AssertionError(formula)


def _listed(entry: Any, number: int, position: Position) -> ListedTask:
    fields = []
    for key in ("init", "goal"):
        value = entry.get(key) if isinstance(entry, dict) else None
        if not isinstance(value, list) or not all(isinstance(v, str) for v in value):
            raise BadInput(f"task {number}: expected a list of texts {key!r}", position=position)
        fields.append(tuple(" ".join(v.lower().split()) for v in value))
    return ListedTask(*fields)


def _names(domain: Domain, problem: Problem, text: str, position: Position | None) -> Names:
    document = parse(Source(position.file if position else "task", text))
    return Names(
        document, frozenset(domain.types), domain.predicates, {}, {}, frozenset(problem.objects)
    )


def _read_init(
    domain: Domain, problem: Problem, task: ListedTask, position: Position | None
) -> frozenset[Atom]:
    fluents = fluent_predicates(domain)
    atoms = set()
    for text in task.init:
        formula = _read_text(domain, problem, text, position)
        if not isinstance(formula, Atom):
            raise BadInput(f"{text} is no atom: 'init' lists what is true", position=position)
        if formula.predicate not in fluents and formula not in problem.init:
            raise BadInput(
                f"{text} is static and false in {problem.source.name}", position=position
            )
        atoms.add(formula)
    return frozenset(atom for atom in atoms if atom.predicate in fluents)


def _read_text(domain: Domain, problem: Problem, text: str, position: Position | None) -> Formula:
    try:
        parts = split_atoms(text)
        if len(parts) != 1:
            raise BadInput("expected one PDDL literal")
        names = _names(domain, problem, parts[0], position)
        return read_formula(names, names.document.root)
    except BadInput as error:
        raise BadInput(f"{text}: {error.what}", position=position, remedy=error.remedy) from None
