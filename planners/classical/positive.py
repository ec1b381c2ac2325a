# SPDX-License-Identifier: GPL-3.0-or-later
"""A classical task without negative conditions, for planners that read none.

A fact that some condition wants false gets a partner that is true exactly where the fact is false.
Every action keeps the two apart, so plans stay the same, one for one.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from planners.classical.task import ClassicalAction, ClassicalTask, Condition


def with_positive_goal(task: ClassicalTask) -> ClassicalTask:
    """The task with a goal of positive literals only."""
    partner = _partners(task, task.goal)
    return replace(
        _with_partners(task, partner),
        goal=_positive(task.goal, partner),
    )


def with_positive_conditions(task: ClassicalTask) -> ClassicalTask:
    """The task with positive literals only, in the goal and in all preconditions."""
    conditions = [condition for action in task.actions for condition in action.preconditions]
    partner = _partners(task, (*task.goal, *conditions))
    changed = _with_partners(task, partner)
    return replace(
        changed,
        goal=_positive(task.goal, partner),
        actions=tuple(
            replace(action, preconditions=_positive(action.preconditions, partner))
            for action in changed.actions
        ),
    )


def _partners(task: ClassicalTask, conditions: Iterable[Condition]) -> dict[int, int]:
    """Fact that a condition wants false -> the number of its partner."""
    wanted = sorted({fact for fact, positive in conditions if not positive})
    return {fact: len(task.facts) + number for number, fact in enumerate(wanted)}


def _with_partners(task: ClassicalTask, partner: dict[int, int]) -> ClassicalTask:
    true = {new for fact, new in partner.items() if fact not in task.init}
    return replace(
        task,
        facts=(*task.facts, *(f"(not {task.facts[fact]})" for fact in partner)),
        init=task.init | true,
        actions=tuple(_with_both(action, partner) for action in task.actions),
    )


def _with_both(action: ClassicalAction, partner: dict[int, int]) -> ClassicalAction:
    """The action, which changes partners the other way round."""
    return replace(
        action,
        adds=(*action.adds, *(partner[fact] for fact in action.deletes if fact in partner)),
        deletes=(*action.deletes, *(partner[fact] for fact in action.adds if fact in partner)),
    )


def _positive(conditions: Iterable[Condition], partner: dict[int, int]) -> tuple[Condition, ...]:
    return tuple(
        (fact, True) if positive else (partner[fact], True) for fact, positive in conditions
    )
