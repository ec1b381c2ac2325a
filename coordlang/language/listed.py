# SPDX-License-Identifier: GPL-3.0-or-later
"""Tasks as a file lists them, and the same tasks in a joint model: texts to atoms and back."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Annotated

from msgspec import Meta

from planners.grounding import ground_goal
from planners.joint.model import FullState, Goal, JointModel, PlanningTask, show
from planners.joint.states import split_atoms
from planners.loading import PlanningInstance, build
from planners.pddl.formula_tree import conjuncts, formula_text
from planners.pddl.formulas import read_formula
from planners.pddl.lifted import And, Atom, Domain, Formula, Problem
from planners.pddl.model_options import ModelOptions
from planners.pddl.names import Names
from planners.pddl.robots import fluent_predicates
from planners.pddl.sexpr import Source, parse
from planners.system.errors import BadInput, Position


@dataclass(frozen=True, slots=True)
class ListedTask:
    """A task as a file lists it, as PDDL text."""

    init: Annotated[
        tuple[str, ...], Meta(description="The fluents that are true at the start, as PDDL atoms.")
    ]
    goal: Annotated[
        tuple[str, ...],
        Meta(description="PDDL literals or formulas that must all hold at the end."),
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
    position: Position | None = None,
) -> tuple[PlanningInstance, list[PlanningTask]]:
    """The joint model in which listed tasks can start, and these tasks in it, named by number.

    Everything static comes from the first problem.

    Raises `BadInput` for a text that is no atom or formula of the problem.
    """
    ground = [ground_task(domain, problems[0], task, position) for task in listed]
    loaded = build(domain, problems, options, inits=[init for init, _ in ground])
    tasks = [
        PlanningTask(f"{number}", loaded.model.state(init), goal)
        for number, (init, goal) in enumerate(ground, 1)
    ]
    return loaded, tasks


def planning_task(
    model: JointModel,
    domain: Domain,
    problem: Problem,
    listed: ListedTask,
    position: Position | None = None,
) -> PlanningTask:
    """A listed task in a joint model.  Raises `BadInput` as `model_of_listed` does."""
    init, goal = ground_task(domain, problem, listed, position)
    return PlanningTask("listed", model.state(init), goal)


def goal_text(model: JointModel, goal: Goal) -> str:
    """A goal as PDDL text."""
    if isinstance(goal, FullState):
        return " ".join(model.codec.facts.texts[fact] for fact in goal.facts)
    return " ".join(goal_atoms(goal)) or "(and)"


def goal_atoms(goal: Goal) -> tuple[str, ...]:
    """The parts of a goal formula as a task file lists them."""
    assert not isinstance(goal, FullState)
    return tuple(map(formula_text, conjuncts(goal)))


def ground_task(
    domain: Domain, problem: Problem, task: ListedTask, position: Position | None = None
) -> tuple[frozenset[Atom], Formula]:
    """The true fluents at the start, and the ground goal.

    Everything static comes from the problem.  Raises `BadInput` for a text that is no atom or
    formula of it.
    """
    goal = And(tuple(_read_text(domain, problem, text, position) for text in task.goal))
    return _read_init(domain, problem, task, position), ground_goal(domain, problem, goal)


def _read_init(
    domain: Domain, problem: Problem, task: ListedTask, position: Position | None
) -> frozenset[Atom]:
    fluents = fluent_predicates(domain)
    atoms = set()
    for text in task.init:
        formula = _read_text(domain, problem, text, position)
        if not isinstance(formula, Atom):
            raise BadInput(
                f"{text} is no atom: 'init' lists what is true",
                position=position,
                remedy="Leave out what is false: all that 'init' does not list.",
            )
        if formula.predicate not in fluents and formula not in problem.init:
            raise BadInput(
                f"{text} is static and false in {problem.source.name}",
                position=position,
                remedy="Tasks of one file share their static facts: leave it out.",
            )
        atoms.add(formula)
    return frozenset(atom for atom in atoms if atom.predicate in fluents)


def _read_text(domain: Domain, problem: Problem, text: str, position: Position | None) -> Formula:
    try:
        parts = split_atoms(text)
        if len(parts) != 1:
            raise BadInput(
                "expected one PDDL literal", remedy="As in (at r1 a) or (not (at r1 a))."
            )
        document = parse(Source(position.file if position else "task", parts[0]))
        names = replace(Names.of(document, domain), functions={}, objects=problem.objects)
        return read_formula(names, names.document.root)
    except BadInput as error:
        raise BadInput(f"{text}: {error.what}", position=position, remedy=error.remedy) from None
