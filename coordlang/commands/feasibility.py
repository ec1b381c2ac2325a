# SPDX-License-Identifier: GPL-3.0-or-later
"""What is feasible with a task: how large its search is, and what it means for the commands."""

from __future__ import annotations

from planners.search.search_estimate import SearchEstimate
from planners.system.notebook import counted

#: States, and joint steps out of one layer, beyond which a search is not likely to end.
_MOST_STATES, _MOST_STEPS = 20_000_000, 50_000_000
#: Reachable states up to which fewest words were proved for all tasks (README.md).
_PROVABLE = 132
#: Reachable states up to which languages for all tasks were built in minutes (docs/evaluation.md).
_ALL_TASKS = 1_000
#: Layers that are shown.
_SHOWN = 8


def feasibility(found: SearchEstimate) -> list[tuple[str, str]]:
    """Return lines (name, text): labels, layers, bound, what these mean, what to try."""
    lines = [
        ("labels", _labels(found)),
        ("first layers", _layers(found)),
        ("bound", _bound(found)),
        ("this task", _this_task(found)),
        ("--tasks all", _all_tasks(found)),
    ]
    if found.solvable is None and _is_too_large(found):
        lines.append(("try", _smaller(found)))
    return lines


def _labels(found: SearchEstimate) -> str:
    each = [f"{robot} {found.choices[robot]:,} of {n:,}" for robot, n in found.labels.items()]
    return f"{', '.join(each)} possible at the start, idling included"


def _layers(found: SearchEstimate) -> str:
    sizes = [f"{size:,}" for size in found.layers]
    if len(sizes) > _SHOWN:
        sizes = [*sizes[: _SHOWN - 2], "..", sizes[-1]]
    text = ", ".join(sizes)
    if found.next_steps is None:
        return f"{text} states, and no other can be reached"
    steps = counted(found.next_steps, "joint step")
    states = f"{text} state{'s' * (found.states > 1)}"
    return f"{states}; not looked at: the next, with at most about {steps} into it"


def _bound(found: SearchEstimate) -> str:
    if found.at_least is None:
        return f"{found.heuristic}: no plan is possible"
    text = f"{found.heuristic}: makespan {found.at_least:,} at least"
    if found.within:
        sizes = [f"{size:,}" for size in found.within]
        if len(sizes) > _SHOWN:
            sizes = [*sizes[: _SHOWN - 2], "..", sizes[-1]]
        text += f", by which {', '.join(sizes)} of these states are left"
    if found.solver_after is not None and found.next_steps is not None:
        text += f"; a SAT solver is asked after {counted(found.solver_after, 'joint step')}"
    return text


def _this_task(found: SearchEstimate) -> str:
    if found.solvable is False:
        return "no plan: the goal cannot be reached"
    if found.makespan is not None:
        return f"makespan {found.makespan:,}: plans, coordination and build are feasible"
    at_least = max(found.hmax or 0, found.at_least or 0)
    least = f"makespan {at_least:,} at least"
    if found.expected is not None:
        by = f"{found.factor:.1f} times the one before"
        least += f": about {_rounded(found.expected)} states if each layer is {by}"
    return f"{least}; {_whether_it_ends(found)}"


def _whether_it_ends(found: SearchEstimate) -> str:
    if _is_too_large(found) and found.solver_after is not None:
        return (
            "too many to search them all; whether the bounds suffice is not known: "
            "set a --time-limit"
        )
    if _is_too_large(found):
        return "plans, and all that needs them, are not likely to end"
    if found.expected is None:
        return "whether plans ends is not known: set a --time-limit"
    return "plans ends in seconds to minutes if the makespan is not much more: set a --time-limit"


def _is_too_large(found: SearchEstimate) -> bool:
    return (found.next_steps or 0) > _MOST_STEPS or (found.expected or 0) > _MOST_STATES


def _all_tasks(found: SearchEstimate) -> str:
    if found.next_steps is not None:
        return f"more than {counted(found.states, 'state')}: use coordlang tasks, or list tasks"
    size = (
        f"{counted(found.states, 'state')}, "
        f"at most {counted(found.states * (found.states - 1), 'task')}"
    )
    if found.states <= _PROVABLE:
        return f"{size}: every method is feasible"
    if found.states <= _ALL_TASKS:
        return f"{size}: greedy and separating; minimal is not likely to end with a proof"
    return f"{size}: use coordlang tasks, or list tasks"


def _smaller(found: SearchEstimate) -> str:
    """What makes the search smaller; the robot with most choices is the one to leave out first."""
    most = max(found.choices, key=lambda robot: found.choices[robot])
    fewer = f"fewer robots ({most} has most choices)" if len(found.choices) > 1 else ""
    return ", ".join(filter(None, (fewer, "fewer objects", "only a part of the goal")))


def _rounded(number: float) -> str:
    """Two digits of a number: ``1,200``, ``3.4e+09``."""
    if number < 1_000_000:
        return f"{float(f'{number:.2g}'):,.0f}"
    return f"{number:.1e}"
