"""Plan -> sentence; and what is wrong with a plan that has none."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from coordlang.language.sentences import sentence
from coordlang.tasks.task_file import formula_text
from coordlang.use.sentence.task_language import TaskLanguage
from planners.errors import BadInput, Position, Refuted
from planners.joint.model import IDLE, FullState, JointModel
from planners.pddl.lifted import And
from planners.search.plan_file import NoSuchAction, Texts, read_plans
from planners.search.plans import Plan
from planners.tables import Rows


class NotAPlan(Refuted):
    """These joint steps are no plan of the task.

    ``step`` is the first step that cannot be taken, from 0; the plan's length if only the goal
    fails at the end.
    """

    def __init__(
        self, step: int, reason: str, position: Position | None = None, remedy: str | None = None
    ) -> None:
        super().__init__(f"this is no plan: {reason}", position=position, remedy=remedy)
        self.step = step


class NotOptimal(Refuted):
    """A plan of the task, but not an optimal one: only optimal plans have a sentence.

    ``step`` is the first step, from 0, with which it is the beginning of no optimal plan any more;
    ``excess`` is its cost above the optimal one: (steps, second component).
    """

    def __init__(self, step: int, excess: tuple[int, int], reason: str) -> None:
        super().__init__(f"this plan is not optimal: {reason}")
        self.step = step
        self.excess = excess


def sentence_of_plan(task_language: TaskLanguage, plan: Sequence[Texts]) -> tuple[int, ...]:
    """The sentence of an optimal plan (the paper's TSC), as word numbers; `TaskLanguage.text`
    writes it.

    ``plan[k][i]`` is the subaction of robot i in step k as text, None if it idles (as
    `planners.search.plan_file.read_plans` gives it).  O(steps) expansions.  Raises `NotAPlan` or
    `NotOptimal` with the first step that breaks.
    """
    numbers, rows, second = follow(task_language, plan)
    space, node = task_language.space, task_language.start
    words = [int(task_language.word[node])]
    makespan, optimal = space.cost_of(task_language.task)
    for step, labels in enumerate(numbers):
        edge = _edge(task_language, node, labels)
        if edge is None:
            excess = len(plan) - makespan, second - optimal
            raise NotOptimal(
                step, excess, _leaves(task_language, plan[step], rows[step], step, excess)
            )
        node = int(space.target[edge])
        words.append(int(task_language.word[node]))
    return sentence(words)


def follow(task_language: TaskLanguage, plan: Sequence[Texts]) -> tuple[Plan, list[Rows], int]:
    """The label numbers, the states and the second cost of a plan, optimal or not.  Raises
    `NotAPlan`.
    """
    model, space = task_language.model, task_language.space
    row = space.rows[space.state[task_language.start]]
    rows, second, numbers = [row], 0, []
    for number, step in enumerate(plan):
        labels = _numbers(model, step, number)
        steps = model.successors(rows[-1][None, :])
        found = (steps.labels == labels).all(axis=1).nonzero()[0]
        if not len(found):
            raise NotAPlan(
                number,
                f"step {number + 1} cannot be taken: {model.why_not(rows[-1], labels)}",
                remedy=f"The state before it is {model.state_text(rows[-1])}.",
            )
        rows.append(steps.result[found[0]])
        second += int(steps.cost[found[0]])
        numbers.append(labels)
    if not model.holds(space.goals[space.goal[task_language.start]], rows[-1][None, :])[0]:
        raise NotAPlan(len(plan), f"after {_steps(len(plan))} {_missing(task_language, rows[-1])}")
    return tuple(numbers), rows, second


def read_plan_file(path: str | Path, model: JointModel) -> list[tuple[Texts, ...]]:
    """The plans of a plan file (docs/formats.md), in the spelling of the model.

    Raises `BadInput` for a file that is none or holds no plan, `NotAPlan` for an action that the
    problem does not have.
    """
    try:
        plans = read_plans(path, model)
    except NoSuchAction as error:
        raise NotAPlan(
            error.step, f"in step {error.step + 1}, {error.what}", position=error.position
        ) from None
    if not plans:
        raise BadInput("there is no plan in it", position=Position(str(path)))
    return [tuple(tuple(map(_spelling, step)) for step in plan) for plan in plans]


def _spelling(text: str | None) -> str | None:
    if text is None or text.strip().lower() == IDLE:
        return None
    return "(" + " ".join(re.findall(r"[^\s()]+", text.lower())) + ")"


def _numbers(model: JointModel, step: Texts, number: int) -> tuple[int, ...]:
    found = model.numbers(step)
    if found is None:
        robot, text = next(
            (robot, text)
            for robot, own, text in zip(model.robots, model.labels, step, strict=True)
            if text is not None and text not in own
        )
        raise NotAPlan(
            number,
            f"in step {number + 1}, {robot} has no subaction {text}",
            remedy="It is misspelt, belongs to another robot, or can never be applied in this problem.",
        )
    return found


def _missing(task_language: TaskLanguage, row: Rows) -> str:
    """The first part of the goal that does not hold."""
    model, space = task_language.model, task_language.space
    goal = space.goals[space.goal[task_language.start]]
    if isinstance(goal, FullState):
        return "the state is not the goal state"
    parts = goal.parts if isinstance(goal, And) else (goal,)
    part = next(part for part in parts if not model.holds(part, row[None, :])[0])
    return f"the goal is not reached: {formula_text(part)} does not hold"


def _edge(task_language: TaskLanguage, node: int, labels: Sequence[int]) -> int | None:
    space = task_language.space
    first = int(space.first[node])
    found = (space.labels[first : int(space.first[node + 1])] == labels).all(axis=1).nonzero()[0]
    return first + int(found[0]) if len(found) else None


def _leaves(
    task_language: TaskLanguage, step: Texts, row: Rows, number: int, excess: tuple[int, int]
) -> str:
    """How much too costly a plan is, and where it leaves all optimal plans."""
    model, space = task_language.model, task_language.space
    makespan, second = space.cost_of(task_language.task)
    more, dearer = excess
    if more:
        wrong = f"it takes {_steps(makespan + more)}, and {makespan} {'is' if makespan == 1 else 'are'} enough"
    else:
        what = "subactions" if model.cost == "makespan+actions" else "action costs of"
        wrong = f"its {_steps(makespan)} are as few as can be, but with {second + dearer} {what} where {second} are enough"
    if number == makespan:
        return f"{wrong}: the goal holds before step {number + 1} already"
    doing = ", ".join(f"{r} {t or 'idles'}" for r, t in zip(model.robots, step, strict=True))
    return f"{wrong}; with step {number + 1} ({doing}) it leaves all optimal plans, at {model.state_text(row)}"


def _steps(number: int) -> str:
    return f"{number} step{'s' * (number != 1)}"
