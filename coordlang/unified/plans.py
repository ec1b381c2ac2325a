# SPDX-License-Identifier: GPL-3.0-or-later
"""Joint plans as unified-planning's plans, and back.

A joint plan is a sequence of steps in each of which several robots act.  A *partial-order plan*
says exactly this: every action of a step comes before every action of the next one.  Actions that
share a step do not interfere, so that each of its linearisations is a plan, too.  A *time-triggered
plan* says it with times 0, 1, ..  A *sequential plan* forgets which actions share a step, and
different joint plans may become equal.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from fractions import Fraction
from typing import Any

from coordlang.unified.translation import Translated
from planners.joint.model import JointModel
from planners.pddl.robots import Team
from planners.search.plan_file import Texts
from planners.search.plans import Plan, Plans


class NoSteps(Exception):
    """A plan that is no sequence of joint steps: one robot does two things at once."""


def to_up(found: Translated, plans: Plans, plan: Plan, kind: Any, environment: Any) -> Any:
    """A joint plan as a unified-planning plan of ``kind`` (a `PlanKind`)."""
    from unified_planning.plans import PartialOrderPlan, PlanKind, SequentialPlan, TimeTriggeredPlan

    steps = [[_instance(found, text) for text in step] for step in _actions(plans, plan)]
    if kind == PlanKind.SEQUENTIAL_PLAN:
        return SequentialPlan([action for step in steps for action in step], environment)
    if kind == PlanKind.TIME_TRIGGERED_PLAN:
        timed = [(Fraction(n), action, None) for n, step in enumerate(steps) for action in step]
        return TimeTriggeredPlan(timed, environment)
    return PartialOrderPlan(_followers([step for step in steps if step]), environment)


def _followers(steps: Sequence[list[Any]]) -> dict[Any, list[Any]]:
    """For each action those of the next step."""
    after = [*steps[1:], []]
    return {
        action: list(following)
        for step, following in zip(steps, after, strict=False)
        for action in step
    }


def of_up(
    found: Translated, model: JointModel, team: Team, plan: Any
) -> list[tuple[Texts, tuple[Any, ...]]]:
    """The joint steps of a unified-planning plan: what each robot does, and the actions.

    A partial-order plan is read layer by layer, each action as early as its predecessors allow.
    Raises `NoSteps`.
    """
    result = []
    for actions in _steps(plan):
        step: list[str | None] = [None] * len(model.robots)
        for action in actions:
            text = label(found, action)
            for robot, part in _parts(model, team, found, text):
                if step[robot] is not None:
                    raise NoSteps(
                        f"{model.robots[robot]} does {step[robot]} and {part} in one step"
                    )
                step[robot] = part
        result.append((tuple(step), tuple(actions)))
    return result


def label(found: Translated, action: Any) -> str:
    """The ground action that an action instance stands for, as PDDL text.

    Raises `KeyError` for a foreign action.
    """
    agent = None
    if action.agent is not None:
        agent = next(name for name, a in found.agents.items() if a.name == action.agent.name)
    schema = next(s for s, members in found.schemas.items() if members.get(agent) == action.action)
    names = {o.name: name for name, o in found.objects.items()}
    args = [names[value.object().name] for value in action.actual_parameters]
    return f"({' '.join((schema, *([agent] if agent else []), *args))})"


def _actions(plans: Plans, plan: Plan) -> list[list[str]]:
    """The ground actions of each step; a shared one once, idling left out."""
    model, rows = plans.space.model, plans.space.rows
    steps = []
    for state, labels in zip(plans.states(plan), plan, strict=False):
        whole = model.joint_action(rows[state], labels)
        own = dict.fromkeys(model.texts(labels))
        steps.append([text for text in own if text is not None] if whole is None else [whole])
    return steps


def _instance(found: Translated, text: str) -> Any:
    from unified_planning.plans import ActionInstance

    schema, *args = text[1:-1].split()
    members = found.schemas[schema]
    if None in members:
        return ActionInstance(members[None], tuple(found.objects[arg] for arg in args))
    agent, *rest = args
    return ActionInstance(
        members[agent], tuple(found.objects[arg] for arg in rest), found.agents[agent]
    )


def _steps(plan: Any) -> list[list[Any]]:
    """The actions of a unified-planning plan, step by step."""
    from unified_planning.plans import PlanKind

    if plan.kind == PlanKind.SEQUENTIAL_PLAN:
        return [[action] for action in plan.actions]
    if plan.kind == PlanKind.TIME_TRIGGERED_PLAN:
        steps: dict[Any, list[Any]] = defaultdict(list)
        for start, action, _ in plan.timed_actions:
            steps[start].append(action)
        return [steps[start] for start in sorted(steps)]
    return _layers(plan.get_adjacency_list)


def _layers(following: Mapping[Any, Sequence[Any]]) -> list[list[Any]]:
    """The actions of a partial order, each as early as its predecessors allow."""
    open_before: dict[Any, int] = dict.fromkeys(following, 0)
    for actions in following.values():
        for action in actions:
            open_before[action] = open_before.get(action, 0) + 1
    layer = [action for action, count in open_before.items() if not count]
    layers = []
    while layer:
        layers.append(layer)
        after = []
        for action in layer:
            for later in following.get(action, ()):
                open_before[later] -= 1
                if not open_before[later]:
                    after.append(later)
        layer = after
    return layers


def _parts(model: JointModel, team: Team, found: Translated, text: str) -> list[tuple[int, str]]:
    """Which robots do what in a ground action."""
    if not model.is_joint_action:
        name, *args = text[1:-1].split()
        schema = next(s for s in found.domain.schemas if s.name == name)
        return [(robot, text) for robot in team.owners(schema, tuple(args))]
    robots = range(len(model.robots))
    action = next((action for action in model.actions if action.label == text), None)
    if action is None:  # it can never be applied, so the plan is refused for that
        return [(robot, text) for robot in robots]
    return _acting((robot, action.part_of(robot)) for robot in robots)


def _acting(parts: Iterable[tuple[int, str | None]]) -> list[tuple[int, str]]:
    """The robots that do not idle, with their parts."""
    return [(robot, part) for robot, part in parts if part is not None]
