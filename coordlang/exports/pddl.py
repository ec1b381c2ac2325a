# SPDX-License-Identifier: GPL-3.0-or-later
"""A task under a sentence as plain PDDL, so that any planner can take part.

The plain task of `planners.classical` gets facts and actions that follow the sentence
(`coordlang.exports.naming`): after each joint step the state is *named* by its word, and then
the sentence *stays* at this word or *goes on* to the next one, both without cost.

Why its optimal plans are exactly the plans with the sentence, one to one:

1. Without naming, its plans stand one to one for the joint plans of the task, at the same cost
   (`planners.classical`). Naming costs nothing and only forbids.  So no plan is cheaper than an
   optimal plan of the task.
2. In a state on an optimal plan of the task exactly one naming is possible, that of its word
   (`exclusive_terms`), and after it at most one action: which one, the word decides.  So an optimal
   plan of the task has at most one counterpart, and has it exactly if its words are, one after
   another, those of the sentence.
3. Some plan has the sentence (`TaskLanguage.plans_with`), so the optimal cost is that of the task.
   Then each plan of that cost is an optimal plan of the task, passes only through states on optimal
   plans of the task, and by 2 it has the sentence.

With slack the sentence is followed at most as many times as joint steps are allowed.  Then every
plan, not only the optimal ones, is a plan within the slack that has the sentence, with all, some or
none of its rest at the end.

States elsewhere never matter to optimal plans, so this needs no list of all states, and holds for
tasks that the language does not cover, too.  A plan of higher cost follows the sentence as far as
it stays in states that the language maps.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

from coordlang.execution.guided_search import plan_under_sentence
from coordlang.execution.task_language import TaskLanguage
from coordlang.exports.membership import exclusive_terms, refuse_seen_slack
from coordlang.exports.naming import RobotLabel, named_by_words
from planners.classical import (
    ClassicalAction,
    ClassicalTask,
    action_names,
    compile_classical,
    to_pddl,
    with_positive_conditions,
    with_positive_goal,
)
from planners.joint.model import IDLE, JointModel, PlanningTask
from planners.search.plans import Plan
from planners.system.errors import BadInput, UsageError
from planners.system.messages import echoed


@dataclass(frozen=True, slots=True)
class PddlExport:
    """A task under a sentence for other planners.

    ``classical`` is the task as data, ``domain`` and ``problem`` the same as PDDL text, ``cost``
    the total cost of an optimal plan.  ``labels`` are for each action, by its name in the PDDL, the
    labels that robots take in it: all robots (explicit form), one, or none (bookkeeping).  So many
    ``terms`` tell which word a state belongs to.
    """

    model: JointModel
    classical: ClassicalTask
    domain: str
    problem: str
    labels: dict[str, tuple[RobotLabel, ...]]
    cost: int
    terms: int

    def joint_plan(self, names: Sequence[str]) -> Plan:
        """The joint plan that a plan of the exported problem stands for, given by its actions.

        Raises `BadInput` for an action that the problem does not have, or a plan that ends within a
        step.
        """
        steps: list[dict[int, int]] = []
        for number, name in enumerate(names, 1):
            labels = self._labels_of(number, name)
            if not steps or any(robot in steps[-1] for robot, _ in labels):
                steps.append({})
            steps[-1].update(labels)
        plan = [step for step in steps if step]
        robots = range(len(self.model.robots))
        for number, step in enumerate(plan, 1):
            for robot in robots:
                if robot not in step:
                    raise BadInput(
                        f"in step {number} of the plan {self.model.robots[robot]} chooses nothing: "
                        "the plan is cut off",
                        remedy="Give the whole plan that the planner wrote.",
                    )
        return tuple(tuple(step[robot] for robot in robots) for step in plan)

    def _labels_of(self, number: int, name: str) -> tuple[RobotLabel, ...]:
        labels = self.labels.get(name.lower())
        if labels is None:
            raise BadInput(
                f"action {number} of the plan, {echoed(name)}, is none of the exported problem",
                remedy="Give a plan of the problem that this command exports, with the same "
                "arguments.",
            )
        return labels


def export_pddl(
    task_language: TaskLanguage,
    words: Sequence[int],
    limit: int = 2000,
    *,
    strips_only: bool = False,
) -> PddlExport:
    """Write the task under a sentence as PDDL; its optimal plans are exactly those of the sentence.

    ``classical.cost`` of a plan's total cost is that of the joint plan, (makespan, second
    component). Up to ``limit`` plain actions every joint action is written as one; beyond, robots
    choose one after another (see `planners.classical.compile_classical`).  With ``strips_only``
    there are neither negative conditions nor costs: then the plans with the fewest actions are
    those of the sentence.

    Raises `NoPlanFits`, and `UsageError` under ``strips_only`` where actions without costs do not
    count joint steps; with slack, for words that see it, and where more than joint steps counts.
    """
    _require_slack_told(task_language.model)
    space, model = task_language.plans_with(words), task_language.model
    makespan, second = space.cost_of(0)
    steps = makespan if model.slack else None
    if model.slack:
        makespan, second = plan_under_sentence(task_language, words).cost
    start = space.starts[0]
    task = PlanningTask("task", space.rows[space.state[start]], space.goals[space.goal[start]])
    plain = compile_classical(model, task, limit, longest=max(1, steps or makespan))
    labels = [_labels(model, plain, action) for action in plain.actions]
    tests = exclusive_terms(task_language)
    named = named_by_words(task_language, words, plain, labels, tests, steps)
    labels += [()] * (len(named.actions) - len(labels))
    if strips_only:
        _require_steps_counted(plain, model)
        named = with_positive_conditions(named)
    else:
        named = with_positive_goal(named)
    domain, problem = to_pddl(named, costs=not strips_only)
    return PddlExport(
        model=model,
        classical=named,
        domain=domain,
        problem=problem,
        labels=dict(zip(action_names(named), labels, strict=True)),
        cost=plain.step_cost * makespan + second,
        terms=sum(map(len, tests)),
    )


def _require_slack_told(model: JointModel) -> None:
    """Raise `UsageError` where slack cannot be said by counting joint steps."""
    refuse_seen_slack(model, "--to pddl")
    if model.slack and model.cost != "makespan":
        raise UsageError(
            f"--to pddl counts the joint steps of plans within slack, and --cost {model.cost} "
            "counts more",
            remedy="Build the language with --cost makespan; `coordlang understand`, `plan` and "
            "`choices` give its plans.",
        )


def _require_steps_counted(plain: ClassicalTask, model: JointModel) -> None:
    """Raise `UsageError` where fewest actions are not least cost.

    In the explicit form each joint step takes as many actions as any other: itself, the naming of
    its state, and one that stays at the word or goes on.
    """
    if plain.form != "explicit":
        raise UsageError(
            "without costs every joint action must be one action, and there are too many",
            remedy="Use a greater --max-actions, or leave out --for pyperplan.",
        )
    if model.cost != "makespan":
        raise UsageError(
            f"--for pyperplan writes no costs, and --cost {model.cost} needs them",
            remedy="Leave out --for pyperplan, or build the language with --cost makespan.",
        )


def plan_names(text: str) -> list[str]:
    """Read the actions of a plan file of another planner.

    One ``(name)`` a line, perhaps with a step before it.  Comments (``;``) are left out.  Raises
    `BadInput` for a line that is not an action.
    """
    names = []
    for number, raw in enumerate(text.splitlines(), 1):
        line = raw.split(";")[0].strip()
        match = re.fullmatch(
            r"(?:\d+(?:\.\d+)?\s*:\s*)?(?:\(\s*([^\s()]+)\s*\)|([^\s()]+?)(?:\(\))?)(?:\s*\[.*\])?",
            line,
        )
        if match:
            names.append(match[1] or match[2])
        elif line:
            raise BadInput(
                f"line {number} of the plan: expected '(action)', found {echoed(raw.strip())}",
                remedy="Give a plan file as planners write it: one action a line, "
                "comments behind ';'.",
            )
    return names


def _labels(
    model: JointModel, plain: ClassicalTask, action: ClassicalAction
) -> tuple[RobotLabel, ...]:
    """The labels that robots take in a plain action, by its name."""
    if plain.form == "explicit":
        if action.name == "reach the goal":
            return ()
        texts = re.findall(rf"{IDLE}|\([^()]*\)", action.name)
        return _of_texts(model, [None if text == IDLE else text for text in texts])
    if not action.name.startswith("choose "):
        return ()
    chooser, text = action.name.removeprefix("choose ").split(" ", 1)
    if model.is_joint_action:
        return _of_texts(model, next(a.parts for a in model.actions if a.label == text))
    robot = model.robots.index(chooser)
    label = model.label_number(robot, None if text == IDLE else text)
    assert label is not None, action.name
    return ((robot, label),)


def _of_texts(model: JointModel, texts: Sequence[str | None]) -> tuple[RobotLabel, ...]:
    """The labels of all robots."""
    numbers = model.numbers(texts)
    assert numbers is not None, texts
    return tuple(enumerate(numbers))
