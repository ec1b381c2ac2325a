# SPDX-License-Identifier: GPL-3.0-or-later
"""A miscoordination as text and as JSON."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from itertools import chain
from typing import Any

import msgspec

from coordlang.commands.terminal import HELD, WIDTH, alike
from coordlang.required.miscoordination import Miscoordination, Step
from planners.joint.model import IDLE, NO_FACT
from planners.joint.states import split_atoms
from planners.system.messages import named

_MARK = f"  <--{HELD}breaks{HELD}here"


def witness_data(witness: Miscoordination | None) -> dict[str, Any] | None:
    """A miscoordination as JSON data; None for none."""
    if witness is None:
        return None
    data: dict[str, Any] = msgspec.to_builtins(witness)
    del data["kind"]
    if witness.sentence is None:
        del data["sentence"]
    return data


def witness_text(witness: Miscoordination) -> str:
    """Which plan each robot follows, what they do together, and the step that breaks; for `fitted`.

    Robots with equal plans are named together.  Where the robots of a step do not fit into a page,
    those that idle are left out, and states of more than a line are shown by what changes.
    """
    robots = witness.robots
    texts = [own or IDLE for step in chain(*witness.plans, witness.mixture) for own in step]
    cell = max(map(len, texts)) + max(8, max(map(len, robots)) + 4)
    is_sparse = 9 + cell * len(robots) > WIDTH
    step_line = partial(_step_line, robots, cell, is_sparse)
    lines = [f"  task: {witness.task}"]
    if is_sparse:
        lines.append("  robots that idle in a step are left out")
    lines += _plan_lines(witness, step_line)
    lines.append("  together they do:")
    states = witness.mixed_states
    for number, (step, before) in enumerate(zip(witness.mixture, (None, *states), strict=False)):
        lines.append(f"    {_state_text(before, states[number])}")
        lines.append(step_line(number + 1, step) + _MARK * (number == witness.step))
    lines.append(f"  step {witness.step + 1} breaks: {witness.reason}")
    return "\n".join(lines)


def _step_line(robots: Sequence[str], cell: int, is_sparse: bool, number: int, step: Step) -> str:
    does = [
        f"{robot}: {own or IDLE}".ljust(cell)
        for robot, own in zip(robots, step, strict=True)
        if own is not None or not is_sparse
    ]
    return f"    {number:>3}  {''.join(does).rstrip() or 'all robots idle'}"


def _plan_lines(witness: Miscoordination, step_line: Callable[[int, Step], str]) -> Iterator[str]:
    """The plans that robots follow, each once, and the states that they reach."""
    reached = None
    for group in alike(list(zip(witness.plans, witness.states, strict=True))):
        follow = "follows" if len(group) == 1 else "follow"
        yield f"  {named([witness.robots[n] for n in group])} {follow} this {witness.kind}:"
        yield from (step_line(n, step) for n, step in enumerate(witness.plans[group[0]], 1))
        state = witness.states[group[0]][-1] or NO_FACT
        is_known = len(state) > WIDTH - 20 and state == reached
        yield f"         reaches {'the same state' if is_known else state}"
        reached = state


def _state_text(before: str | None, state: str) -> str:
    """A state, or what is different from the state before where that is shorter."""
    text = state or NO_FACT
    if before is None or len(text) + 4 <= WIDTH:
        return text
    old, new = split_atoms(before), split_atoms(state)
    changes = []
    for what, atoms, others in (("now", new, old), ("no longer", old, new)):
        if own := [atom for atom in atoms if atom not in others]:
            changes.append(f"{what} {' '.join(own)}")
    return ", ".join(changes) or "nothing has changed"
