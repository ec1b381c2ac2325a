# SPDX-License-Identifier: GPL-3.0-or-later
"""Joint plans as unified-planning's plans, and back.

A *partial-order plan* says exactly what a joint plan does: every action of a step comes before
every action of the next one; those of one step do not interfere, so each linearisation is a plan.
A *time-triggered plan* says it with times 0, 1, ..  A *sequential plan* forgets which actions share
a step, and different joint plans may become equal.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from fractions import Fraction
from itertools import chain, pairwise, product
from typing import Any

import networkx
import unified_planning.plans as up
from unified_planning.engines import FailedValidationReason as Reason

from coordlang.unified.translation import Translated
from planners.joint.model import JointModel
from planners.pddl.robots import Team
from planners.search.plan_file import numbered_actions
from planners.search.plans import Plan, Plans, Texts
from planners.system.errors import UsageError


class Invalid(Exception):
    """Why a plan is none of the problem, in unified-planning's words its ``reason``, if any.

    ``action`` is the one that cannot be done, None where it is not one alone.
    """

    def __init__(self, why: str, reason: Reason | None = None, action: Any = None) -> None:
        super().__init__(why)
        self.reason, self.action = reason, action


def to_up(found: Translated, plans: Plans, plan: Plan, kind: Any, environment: Any) -> Any:
    """A joint plan as a unified-planning plan of ``kind`` (a `PlanKind`)."""
    steps: list[list[Any]] = [[] for _ in plan]
    for number, text in numbered_actions(plans, plan, plans.steps(plan)):
        steps[number].append(_instance(found, text))
    if kind == up.PlanKind.SEQUENTIAL_PLAN:
        return up.SequentialPlan([*chain(*steps)], environment)
    if kind == up.PlanKind.TIME_TRIGGERED_PLAN:
        timed = [(Fraction(n), action, None) for n, step in enumerate(steps) for action in step]
        return up.TimeTriggeredPlan(timed, environment)
    acting = [*filter(None, steps), []]
    followers = {action: after for step, after in pairwise(acting) for action in step}
    return up.PartialOrderPlan(followers, environment)


def _instance(found: Translated, text: str) -> up.ActionInstance:
    """The action that a PDDL text stands for: what `label` gives for it."""
    schema, *args = text[1:-1].split()
    members = found.schemas[schema]
    agent = None if None in members else args.pop(0)
    objects = tuple(found.objects[arg] for arg in args)
    return up.ActionInstance(members[agent], objects, agent and found.agents[agent])


def of_up(
    found: Translated, model: JointModel, team: Team, plan: Any
) -> list[tuple[Texts, dict[str, Any]]]:
    """The joint steps of a unified-planning plan: what each robot does, and the actions by text.

    A partial-order plan is read layer by layer, each action as early as its predecessors allow.
    Raises `Invalid`, and `UsageError` for a plan of another kind.
    """
    result = []
    for actions in _steps(plan):
        step: list[str | None] = [None] * len(model.robots)
        named = [(label(found, action), action) for action in actions]
        for text, action in named:
            for robot, part in _parts(model, team, found, text, action):
                if step[robot] is not None:
                    why = f"{model.robots[robot]} does {step[robot]} and {part} in one step"
                    raise Invalid(why, Reason.MUTEX_CONFLICT)
                step[robot] = part
        result.append((tuple(step), dict(named)))
    return result


def leaves_steps_open(plan: Any) -> bool:
    """Whether the order of a partial-order plan does not say in which steps its actions are."""
    if not isinstance(plan, up.PartialOrderPlan):
        return False
    before = networkx.transitive_closure_dag(networkx.DiGraph(plan.get_adjacency_list))
    pairs = (pair for one, other in pairwise(_steps(plan)) for pair in product(one, other))
    return not all(before.has_edge(*pair) for pair in pairs)


def _steps(plan: Any) -> Sequence[Sequence[Any]]:
    """The actions of a unified-planning plan, step by step."""
    if isinstance(plan, up.SequentialPlan):
        return [[action] for action in plan.actions]
    if isinstance(plan, up.TimeTriggeredPlan):
        steps: dict[Any, list[Any]] = defaultdict(list)
        for start, action, duration in plan.timed_actions:
            if duration is not None:
                why = f"{action} has a duration, and actions here have none"
                raise Invalid(why, Reason.INAPPLICABLE_ACTION, action)
            steps[start].append(action)
        return [steps[start] for start in sorted(steps)]
    if not isinstance(plan, up.PartialOrderPlan):
        raise UsageError(
            f"a {type(plan).__name__} cannot be validated",
            remedy="Plans are partial-order, sequential or time-triggered.",
        )
    order = networkx.DiGraph(plan.get_adjacency_list)
    if not networkx.is_directed_acyclic_graph(order):
        raise Invalid("the order of the plan's actions has a cycle", Reason.MUTEX_CONFLICT)
    return list(networkx.topological_generations(order))


def label(found: Translated, action: Any) -> str:
    """The ground action that an action instance stands for, as PDDL text.

    Raises `Invalid` for an action that is none of the problem's.
    """
    agents = {own.name: name for name, own in found.agents.items()}
    agent = action.agent and agents.get(action.agent.name)
    schemas = (s for s, members in found.schemas.items() if members.get(agent) == action.action)
    names = {thing: name for name, thing in found.objects.items()}
    values = [v.object() if v.is_object_exp() else None for v in action.actual_parameters]
    words = [next(schemas, None), *([agent] if action.agent else []), *map(names.get, values)]
    if None in words:
        why = f"{action} is no action of the problem"
        raise Invalid(why, Reason.INAPPLICABLE_ACTION, action)
    return f"({' '.join(map(str, words))})"


def _parts(
    model: JointModel, team: Team, found: Translated, text: str, action: Any
) -> list[tuple[int, str | None]]:
    """The robots that take part in an action, by its text, with their parts.

    Raises `Invalid` for a joint action that is never possible.
    """
    if not model.is_joint_action:
        name, *args = text[1:-1].split()
        schemas = {schema.name: schema for schema in found.domain.schemas}
        return [(robot, text) for robot in team.owners(schemas[name], tuple(args))]
    ground = next((ground for ground in model.actions if ground.label == text), None)
    if ground is None:
        raise Invalid(f"{action} is never possible", Reason.INAPPLICABLE_ACTION, action)
    return [(robot, part) for robot, part in enumerate(ground.parts) if part is not None]
