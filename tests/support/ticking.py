# SPDX-License-Identifier: GPL-3.0-or-later
"""A classical task in which every action changes something, for planners that drop those that do not.

Fast Downward's translator, which K* and SymK use, drops operators without effects, and a joint step
in which all robots wait is one.  Here each action comes twice: it makes a fact true, or false again.
"""

from __future__ import annotations

from dataclasses import replace

from planners.classical import ClassicalAction, ClassicalTask


def ticking(task: ClassicalTask) -> ClassicalTask:
    """The same plans, one to one."""
    tick = len(task.facts)

    def twice(action: ClassicalAction) -> tuple[ClassicalAction, ClassicalAction]:
        on = replace(
            action,
            name=f"{action.name} tick",
            preconditions=(*action.preconditions, (tick, False)),
            adds=(*action.adds, tick),
        )
        off = replace(
            action,
            name=f"{action.name} tock",
            preconditions=(*action.preconditions, (tick, True)),
            deletes=(*action.deletes, tick),
        )
        return on, off

    actions = tuple(both for action in task.actions for both in twice(action))
    return replace(task, facts=(*task.facts, "(tick)"), actions=actions)
