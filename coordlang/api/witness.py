# SPDX-License-Identifier: GPL-3.0-or-later
"""A miscoordination as text and as JSON."""

from __future__ import annotations

from typing import Any

from coordlang.required.miscoordination import Miscoordination
from planners.joint.model import NO_FACT


def witness_data(witness: Miscoordination | None) -> dict[str, Any] | None:
    """Return a miscoordination as JSON data; None for none."""
    if witness is None:
        return None
    data: dict[str, Any] = {
        "task": witness.task,
        "robots": list(witness.robots),
        "plans": [[list(step) for step in plan] for plan in witness.plans],
        "states": [list(states) for states in witness.states],
        "mixture": [list(step) for step in witness.mixture],
        "mixed_states": list(witness.mixed_states),
        "step": witness.step,
        "reason": witness.reason,
    }
    if witness.sentence is not None:
        data["sentence"] = list(witness.sentence)
    return data


def witness_text(witness: Miscoordination) -> str:
    """Return which plan each robot follows, what they do together, and the step that breaks."""
    width = max(len(text or "idle") for plan in witness.plans for step in plan for text in step) + 2
    lines = [f"  task: {witness.task}"]
    for robot, plan, states in zip(witness.robots, witness.plans, witness.states, strict=True):
        lines.append(f"  {robot} follows this optimal plan:")
        lines += [_step(witness.robots, n, step, width) for n, step in enumerate(plan, 1)]
        lines.append(f"         reaches {states[-1] or NO_FACT}")
    lines.append("  together they do:")
    for number, (step, state) in enumerate(zip(witness.mixture, witness.mixed_states, strict=True)):
        mark = "  <-- breaks here" if number == witness.step else ""
        lines.append(f"    {state or NO_FACT}")
        lines.append(_step(witness.robots, number + 1, step, width) + mark)
    lines.append(f"  step {witness.step + 1} breaks: {witness.reason}")
    return "\n".join(lines)


def _step(robots: tuple[str, ...], number: int, step: tuple[str | None, ...], width: int) -> str:
    does = [f"{robot}: {text or 'idle'}" for robot, text in zip(robots, step, strict=True)]
    columns = "".join(f"{own:<{width + 6}}" for own in does)
    return f"    {number:>3}  {columns.rstrip()}"
