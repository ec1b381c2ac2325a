# SPDX-License-Identifier: GPL-3.0-or-later
"""A miscoordination as text and as JSON."""

from __future__ import annotations

from typing import Any

import msgspec

from coordlang.commands.layout import HELD, WIDTH, alike, named, wrapped
from coordlang.required.miscoordination import Miscoordination, Step
from planners.joint.model import IDLE, NO_FACT
from planners.joint.states import split_atoms

_MARK = "  <-- breaks here"
#: In place of a step's number, and of the number and "reaches".
_NUMBER, _REACHED = 9 * " ", 13 * " "


def witness_data(witness: Miscoordination | None) -> dict[str, Any] | None:
    """A miscoordination as JSON data; None for none."""
    if witness is None:
        return None
    data: dict[str, Any] = msgspec.to_builtins(witness)
    del data["kind"]
    if witness.sentence is None:
        del data["sentence"]
    return data


def witness_text(witness: Miscoordination, width: int = WIDTH) -> str:
    """Return which plan each robot follows, what they do together, and the step that breaks.

    Robots with equal plans are named together.  Lines are no longer than ``width``, as far as
    single atoms and subactions allow: where the robots of a step do not fit into one line, those
    that idle are left out, and states of more than a line are shown by what changes.
    """
    robots = witness.robots
    texts = [own or IDLE for plan in (*witness.plans, witness.mixture) for s in plan for own in s]
    longest = max(map(len, texts))
    cell = longest + max(8, max(map(len, robots)) + 4)
    is_sparse = len(_NUMBER) + cell * len(robots) > width

    def step_lines(number: int, step: Step) -> list[str]:
        does = [
            f"{robot}:{HELD}{(own or IDLE).replace(' ', HELD)}".ljust(cell)
            for robot, own in zip(robots, step, strict=True)
            if own is not None or not is_sparse
        ]
        text = "".join(does).rstrip() or "all robots idle"
        return wrapped(text, width, f"    {number:>3}  ", _NUMBER)

    lines = wrapped(f"task: {witness.task}", width, "  ", "      ")
    if is_sparse:
        lines.append("  robots that idle in a step are left out")
    reached = None
    for group in alike(list(zip(witness.plans, witness.states, strict=True))):
        follow = "follows" if len(group) == 1 else "follow"
        who = named([robots[number] for number in group])
        lines += wrapped(f"{who} {follow} this {witness.kind}:", width, "  ", "      ")
        for number, step in enumerate(witness.plans[group[0]], 1):
            lines += step_lines(number, step)
        state = witness.states[group[0]][-1] or NO_FACT
        is_long = len(_REACHED) + len(state) > width
        shown = "the same state" if is_long and state == reached else state
        lines += wrapped(f"reaches {shown}", width, _NUMBER, _REACHED)
        reached = state
    lines.append("  together they do:")
    before = None
    for number, (step, state) in enumerate(zip(witness.mixture, witness.mixed_states, strict=True)):
        lines += _state_lines(before, state, width)
        before = state
        lines += step_lines(number + 1, step)
        if number == witness.step:
            if len(lines[-1]) + len(_MARK) > width:
                lines.append(7 * " ")
            lines[-1] += _MARK
    lines += wrapped(f"step {witness.step + 1} breaks: {witness.reason}", width, "  ", "      ")
    return "\n".join(lines)


def _state_lines(before: str | None, state: str, width: int) -> list[str]:
    """A state, or what is different from the state before where that is shorter."""
    text = state or NO_FACT
    if before is not None and len(text) + 4 > width:
        old, new = split_atoms(before), split_atoms(state)
        parts = {
            "now": " ".join(atom for atom in new if atom not in old),
            "no longer": " ".join(atom for atom in old if atom not in new),
        }
        changes = [f"{what} {atoms}" for what, atoms in parts.items() if atoms]
        text = ", ".join(changes) or "nothing has changed"
    return wrapped(text, width, "    ", "      ")
