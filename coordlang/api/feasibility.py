# SPDX-License-Identifier: GPL-3.0-or-later
"""What is feasible with a task: the growth of its search, and what it means for the commands."""

from __future__ import annotations

from planners.notebook import counted
from planners.search.growth import Growth
from planners.search.outlook import Outlook

#: States, and joint steps out of one layer, beyond which a search is not likely to end.
_MOST_STATES, _MOST_STEPS = 20_000_000, 50_000_000
#: Reachable states up to which fewest words were proved for all tasks (README.md).
_PROVABLE = 132
#: Reachable states up to which languages for all tasks were built in minutes (docs/evaluation.md).
_ALL_TASKS = 1_000
#: Layers that are shown.
_SHOWN = 8


def feasibility(growth: Growth, outlook: Outlook) -> list[tuple[str, str]]:
    """Return lines (name, text): labels, layers, bound, what these mean, what to try."""
    lines = [
        ("labels", _labels(growth)),
        ("first layers", _layers(growth)),
        ("bound", _bound(growth, outlook)),
        ("this task", _this_task(growth, outlook)),
        ("--tasks all", _all_tasks(growth)),
    ]
    if growth.solvable is None and _is_too_large(growth):
        lines.append(("try", _smaller(growth)))
    return lines


def _labels(growth: Growth) -> str:
    each = [f"{robot} {growth.choices[robot]:,} of {n:,}" for robot, n in growth.labels.items()]
    return f"{', '.join(each)} possible at the start, idling included"


def _layers(growth: Growth) -> str:
    sizes = [f"{size:,}" for size in growth.layers]
    if len(sizes) > _SHOWN:
        sizes = [*sizes[: _SHOWN - 2], "..", sizes[-1]]
    text = ", ".join(sizes)
    if growth.next_steps is None:
        return f"{text} states, and no other can be reached"
    steps = counted(growth.next_steps, "joint step")
    states = f"{text} state{'s' * (growth.states > 1)}"
    return f"{states}; not looked at: the next, with at most about {steps} into it"


def _bound(growth: Growth, outlook: Outlook) -> str:
    if outlook.at_least is None:
        return f"{outlook.heuristic}: no plan is possible"
    text = f"{outlook.heuristic}: makespan {outlook.at_least:,} at least"
    if outlook.within:
        sizes = [f"{size:,}" for size in outlook.within]
        if len(sizes) > _SHOWN:
            sizes = [*sizes[: _SHOWN - 2], "..", sizes[-1]]
        text += f", by which {', '.join(sizes)} of these states are left"
    if outlook.solver_after is not None and growth.next_steps is not None:
        text += f"; a SAT solver is asked after {counted(outlook.solver_after, 'joint step')}"
    return text


def _this_task(growth: Growth, outlook: Outlook) -> str:
    if growth.solvable is False:
        return "no plan: the goal cannot be reached"
    if growth.makespan is not None:
        return f"makespan {growth.makespan:,}: plans, coordination and build are feasible"
    at_least = max(growth.at_least or 0, outlook.at_least or 0)
    least = f"makespan {at_least:,} at least"
    if growth.expected is not None:
        by = f"{growth.factor:.1f} times the one before"
        least += f": about {_rounded(growth.expected)} states if each layer is {by}"
    return f"{least}; {_outlook(growth, outlook)}"


def _outlook(growth: Growth, outlook: Outlook) -> str:
    if _is_too_large(growth) and outlook.solver_after is not None:
        return (
            "too many to search them all; whether the bounds suffice is not known: "
            "set a --time-limit"
        )
    if _is_too_large(growth):
        return "plans, and all that needs them, are not likely to end"
    if growth.expected is None:
        return "whether plans ends is not known: set a --time-limit"
    return "plans ends in seconds to minutes if the makespan is not much more: set a --time-limit"


def _is_too_large(growth: Growth) -> bool:
    return (growth.next_steps or 0) > _MOST_STEPS or (growth.expected or 0) > _MOST_STATES


def _all_tasks(growth: Growth) -> str:
    if growth.next_steps is not None:
        return f"more than {counted(growth.states, 'state')}: use coordlang tasks, or list tasks"
    size = (
        f"{counted(growth.states, 'state')}, "
        f"at most {counted(growth.states * (growth.states - 1), 'task')}"
    )
    if growth.states <= _PROVABLE:
        return f"{size}: every method is feasible"
    if growth.states <= _ALL_TASKS:
        return f"{size}: greedy and separating; minimal is not likely to end with a proof"
    return f"{size}: use coordlang tasks, or list tasks"


def _smaller(growth: Growth) -> str:
    """What makes the search smaller; the robot with most choices is the one to leave out first."""
    most = max(growth.choices, key=lambda robot: growth.choices[robot])
    fewer = f"fewer robots ({most} has most choices)" if len(growth.choices) > 1 else ""
    return ", ".join(filter(None, (fewer, "fewer objects", "only a part of the goal")))


def _rounded(number: float) -> str:
    """Two digits of a number: ``1,200``, ``3.4e+09``."""
    if number < 1_000_000:
        return f"{float(f'{number:.2g}'):,.0f}"
    return f"{number:.1e}"
