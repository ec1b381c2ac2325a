# SPDX-License-Identifier: GPL-3.0-or-later
"""Plan files: IPC text and JSON, written and read (docs/formats.md)."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Annotated, Any

import msgspec
from msgspec import Meta

from planners.grounding.actions import GroundAction
from planners.joint.model import JointModel, spelled
from planners.pddl.model_options import Execution
from planners.search.plans import Plan, Plans, Texts, texts
from planners.system.errors import BadInput, Position, Refuted
from planners.system.files import FileFormat, read_text
from planners.system.messages import echoed

#: Larger counts are written as strings: not every JSON reader has big integers.
_EXACT = 2**53
#: A larger step number is a mistake, not a plan with so many steps in which all robots idle.
_MOST_STEPS = 1_000_000


#: A count as it stands in JSON.
Count = int | Annotated[str, Meta(pattern=r"^\d+$")]


class ListedPlan(msgspec.Struct, frozen=True):
    """One plan."""

    actions: Annotated[
        list[list[str | None]],
        Meta(description="For each step the subaction of each robot, null for idling."),
    ]
    cost: Annotated[int | None, Meta(description="The makespan.")] = None


class PlansFile(msgspec.Struct, frozen=True):
    """Plans as JSON.  Keys that are not listed here are ignored by readers."""

    plans: Annotated[list[ListedPlan], Meta(description="The listed plans.")]
    count: Annotated[
        Count | None,
        Meta(description="The exact number of optimal plans; a string if it is above 2^53."),
    ] = None
    complete: Annotated[bool | None, Meta(description="Whether all of them are listed.")] = None
    optimal_cost: Annotated[int | None, Meta(description="The least makespan.")] = None
    execution: Annotated[
        Execution | None,
        Meta(description="Without a common step plans that differ in timing alone count once."),
    ] = None
    optimal_second_cost: Annotated[
        int | None, Meta(description="The least second cost, where the cost has two parts.")
    ] = None
    robots: Annotated[list[str] | None, Meta(description="The order of the robots in a step.")] = (
        None
    )
    slack: Annotated[
        int | None,
        Meta(description="Steps that plans may take more than the least makespan, if any."),
    ] = None


PLANS = FileFormat("plans", "JSON plan file", PlansFile)


def json_count(number: int) -> int | str:
    """A count as it stands in JSON: a string above 2^53."""
    return number if number <= _EXACT else str(number)


class NotAPlan(Refuted):
    """These joint steps are no plan of the task.

    ``step`` is the first one that cannot be taken, from 0; the plan's length if only the goal fails
    at the end.
    """

    def __init__(
        self, step: int, reason: str, position: Position | None = None, remedy: str | None = None
    ) -> None:
        super().__init__(f"this is no plan: {reason}", position=position, remedy=remedy)
        self.step = step


class WholeStep(tuple[str | None, ...]):
    """What robots do in a joint step that a plan gives as a joint action: ``action``."""

    action: GroundAction


#: What ends a line; other separators may stand in a comment.
_LINE_END = re.compile(r"\r\n?|\n")
#: The comments with which a plan of `coordlang plans`, or of another planner, begins and ends.
_BEGIN = re.compile(r"\s*;\s*(?:sampled )?plan \d+\b", re.IGNORECASE)
_END = re.compile(r"\s*;\s*(?:makespan|cost) = \d", re.IGNORECASE)
_LINE = re.compile(
    r"(?:(?P<step>\d+)(?:\.0+)?\s*:)?\s*(?P<action>\([^()]*\))\s*(?:\[\s*[\d.]+\s*\])?$"
)


def to_ipc(plans: Plans, plan: Plan) -> str:
    """An IPC plan file of a plan's steps (`Plans.steps`).

    Joint-action PDDL: one ``(action args)`` a line.  Otherwise one subaction a line with its step,
    ``0: (move r1 a b)``, idling left out, a shared subaction once.  Then ``; makespan = 3``.
    """
    steps = plans.steps(plan)
    lines = [
        text if plans.space.model.is_joint_action else f"{number}: {text}"
        for number, text in numbered_actions(plans, plan, steps)
    ]
    return "\n".join([*lines, f"; makespan = {len(steps)}"]) + "\n"


def to_plansys2(plans: Plans, plan: Plan) -> str:
    """A plan as PlanSys2 reads it from a planner: ``0.000: (move r1 a b)  [1.000]``.

    The time is the joint step, and each action lasts one step.  Lines before one with "Solution
    Found" are skipped by its readers.
    """
    actions = numbered_actions(plans, plan, plans.steps(plan))
    lines = [f"{number}.000: {text}  [1.000]" for number, text in actions]
    return "\n".join([";;;; Solution Found", *lines]) + "\n"


def numbered_actions(plans: Plans, plan: Plan, steps: Plan) -> Iterator[tuple[int, str]]:
    """The actions of a plan, each with its joint step: joint actions, or robots' subactions.

    ``steps`` are its `Plans.steps`.
    """
    model, rows = plans.space.model.in_step, plans.space.rows
    for number, (state, labels) in enumerate(zip(plans.states(plan), steps, strict=False)):
        whole = model.stepper.joint_action(model.codec.facts_part(rows[state]), labels)
        own = model.texts(labels) if whole is None else (whole,)
        yield from ((number, text) for text in dict.fromkeys(own) if text is not None)


def to_json(plans: Plans, listed: Sequence[Plan]) -> dict[str, Any]:
    """The data of a JSON plan file: the listed plans, the exact number of all, the optimal cost."""
    model = plans.space.model.in_step
    data: dict[str, Any] = {
        "plans": [
            {"cost": len(steps), "actions": [list(step) for step in texts(model, steps)]}
            for steps in map(plans.steps, listed)
        ],
        "count": json_count(plans.count),
        "complete": len(listed) == plans.count,
        "optimal_cost": plans.space.least_makespan(0),
        "robots": list(model.robots),
    }
    if model.slack:
        data["slack"] = model.slack
    if model.is_asynchronous:
        data["execution"] = "asynchronous"
    if model.cost != "makespan":
        _, data["optimal_second_cost"] = plans.space.cost_of(0)
    return data


def read_plans(path: str | Path, model: JointModel) -> list[tuple[Texts, ...]]:
    """The plans of a plan file, JSON or IPC text.

    Raises `BadInput`, with the line, for a file that is no plan file or holds no plan, `NotAPlan`
    for an action that the problem does not have.
    """
    position = Position(str(path))
    text = read_text(path)
    if not text.lstrip().startswith("{"):
        return [_from_ipc(text, model, str(path))]
    if plans := _from_json(text, model, position):
        return plans
    raise position.fail("there is no plan in it", "`coordlang plans DOMAIN PROBLEM` writes plans.")


def only_one_plan(text: str, position: Position) -> None:
    """Raise `BadInput`, with the line, where a second plan begins in IPC text.

    It begins with its comment, after the closing comment of the plan before it, or with step
    numbers that start again: they may repeat.
    """
    begun = ended = False
    numbers: list[int] = []  # of the actions so far
    for line, raw in enumerate(_LINE_END.split(text), 1):
        second, action = False, raw.partition(";")[0].strip()
        if action:
            number = _step_number(action, numbers)
            second = ended or (numbers[:1] == [number] and number < numbers[-1])
            begun = True
            numbers.append(number)
        elif _BEGIN.match(raw):
            second, begun = begun, True
        elif numbers and _END.match(raw):
            ended = True
        if second:
            raise Position(position.file, line, 1).fail(
                "this file holds several plans: a second one begins here",
                "Write one plan a file (`coordlang plans --max 1`), or use the JSON form.",
            )


def _step_number(action: str, before: Sequence[int]) -> int:
    """The step of an action; one without a number is in the step before."""
    found = re.match(r"(\d{1,8})(?:\.\d+)?\s*:", action)
    if found:
        return int(found[1])
    return before[-1] if before else -1


def _from_json(text: str, model: JointModel, position: Position) -> list[tuple[Texts, ...]]:
    file = PLANS.decode(text.encode(), position)
    robots = model.robots if file.robots is None else file.robots
    if sorted(robots) != sorted(model.robots):
        raise position.fail(
            f"the robots of these plans are {echoed(', '.join(robots))}, not "
            f"{', '.join(model.robots)}",
            "Give plans of this task, with the order of its robots.",
        )
    for plan in file.plans:
        for number, step in enumerate(plan.actions):
            require_one_each(model, step, number, position)
    order = [robots.index(robot) for robot in model.robots]
    return [tuple(tuple(step[k] for k in order) for step in plan.actions) for plan in file.plans]


def require_one_each(
    model: JointModel, step: Sequence[object], number: int, position: Position | None = None
) -> None:
    """Raise `BadInput` for a step that has not one text or None for each robot."""
    if len(step) != len(model.robots):
        raise BadInput(
            f"step {number} must have one text or null for each of {', '.join(model.robots)}",
            position=position,
            remedy='As in ["(move r1 a b)", null]: null is a robot that idles.',
        )


def _from_ipc(text: str, model: JointModel, name: str) -> tuple[Texts, ...]:
    only_one_plan(text, Position(name))
    steps: dict[int, Texts] = {}
    for number, raw in enumerate(_LINE_END.split(text), 1):
        line = raw.split(";")[0].strip().lower()
        if not line:
            continue
        match = _LINE.match(line)
        if match is None:
            raise Position(name, number, 1).fail(
                f"expected '0: (action args)', found {echoed(raw.strip())}",
                "`coordlang plans DOMAIN PROBLEM` writes plans in this form.",
            )
        action = spelled(match["action"])
        step = int(match["step"][-8:]) if match["step"] else max(steps, default=-1) + 1
        if match["step"] and (len(match["step"]) > 8 or step > _MOST_STEPS):
            raise Position(name, number, 1).fail(
                f"step {match['step'][:20]} is too many steps",
                "Steps are counted from 0, one number for all that happens at the same time.",
            )
        _put(steps, step, action, model, Position(name, number, 1))
    idle = (None,) * len(model.robots)
    return tuple(steps.get(k, idle) for k in range(max(steps, default=-1) + 1))


def _put(
    steps: dict[int, Texts], step: int, action: str, model: JointModel, position: Position
) -> None:
    """Enter an action for the robots that it belongs to."""
    ground = next((a for a in model.actions if a.label == action), None)
    if ground is None:
        raise NotAPlan(
            step,
            f"in step {step + 1}, {action} is no action of this problem",
            position=position,
            remedy="`coordlang inspect DOMAIN PROBLEM` shows what the robots can do. Leave out of "
            "a plan what it calls idling.",
        )
    if model.is_joint_action:
        if step in steps:
            raise position.fail(
                f"two joint actions in one step: {action} is the second",
                "Each line of a joint-action plan is a step of its own.",
            )
        steps[step] = whole = WholeStep(ground.parts)
        whole.action = ground
        return
    own = [*steps.get(step, (None,) * len(model.robots))]
    for robot in ground.owners:
        if own[robot] is not None:
            raise position.fail(
                f"{model.robots[robot]} does two things in one step: {own[robot]} and {action}",
                "Give one of them another step number.",
            )
        own[robot] = action
    steps[step] = tuple(own)
