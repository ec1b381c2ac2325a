# SPDX-License-Identifier: GPL-3.0-or-later
"""A miscoordination as text and as JSON."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import msgspec

from coordlang.commands.layout import WIDTH, alike, atoms_of, named, packed, wrapped
from coordlang.required.miscoordination import Miscoordination
from planners.joint.model import IDLE, NO_FACT

_REACHES = "         reaches "
_MARK = "  <-- breaks here"
#: In place of a step's number.
_NUMBER = " " * 9


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
    steps = _Steps.of(witness, width)
    lines = wrapped(f"task: {witness.task}", width, "  ", "      ")
    if steps.sparse:
        lines.append("  robots that idle in a step are left out")
    reached: str | None = None
    for group in alike(list(zip(witness.plans, witness.states, strict=True))):
        follow = "follows" if len(group) == 1 else "follow"
        robots = named([witness.robots[number] for number in group])
        lines += wrapped(f"{robots} {follow} this {witness.kind}:", width, "  ", "      ")
        for number, step in enumerate(witness.plans[group[0]], 1):
            lines += steps.lines(number, step)
        state = witness.states[group[0]][-1] or NO_FACT
        long = len(_REACHES) + len(state) > width
        shown = "the same state" if long and state == reached else state
        lines += wrapped(shown, width, _REACHES, " " * 13)
        reached = state
    lines += ["  together they do:", *_together(witness, steps)]
    lines += wrapped(f"step {witness.step + 1} breaks: {witness.reason}", width, "  ", "      ")
    return "\n".join(lines)


def _together(witness: Miscoordination, steps: _Steps) -> Iterator[str]:
    """The states of the mixture and what is done in each."""
    before: str | None = None
    for number, (step, state) in enumerate(zip(witness.mixture, witness.mixed_states, strict=True)):
        yield from _state_lines(before, state, steps.width)
        before = state
        shown = steps.lines(number + 1, step)
        if number == witness.step:
            if len(shown[-1]) + len(_MARK) > steps.width:
                shown.append(" " * 7)
            shown[-1] += _MARK
        yield from shown


def _state_lines(before: str | None, state: str, width: int) -> list[str]:
    """A state, or what is different from the state before where that is shorter."""
    text = state or NO_FACT
    if before is None or len(text) + 4 <= width:
        return wrapped(text, width, "    ", "      ")
    old, new = atoms_of(before), atoms_of(state)
    now = [atom for atom in new if atom not in old]
    gone = [atom for atom in old if atom not in new]
    parts = [f"now {' '.join(now)}"] if now else []
    parts += [f"no longer {' '.join(gone)}"] if gone else []
    return wrapped(", ".join(parts) or "nothing has changed", width, "    ", "      ")


@dataclass(frozen=True, slots=True)
class _Steps:
    """How joint steps are shown: one cell for each robot, in columns.

    ``sparse``: all robots do not fit into one line; only those that act are shown, in as many
    lines as they need.
    """

    robots: tuple[str, ...]
    cell: int
    width: int
    sparse: bool

    @classmethod
    def of(cls, witness: Miscoordination, width: int) -> _Steps:
        robots = witness.robots
        steps = [step for plan in (*witness.plans, witness.mixture) for step in plan]
        text = max(len(own or IDLE) for step in steps for own in step)
        own = text + max(map(len, robots)) + 2
        cell = max(text + 8, own + 2)
        sparse = len(_NUMBER) + cell * (len(robots) - 1) + own > width
        return cls(robots, own + 2 if sparse else cell, width, sparse)

    def lines(self, number: int, step: tuple[str | None, ...]) -> list[str]:
        does = [
            f"{robot}: {own or IDLE}".ljust(self.cell)
            for robot, own in zip(self.robots, step, strict=True)
            if own is not None or not self.sparse
        ]
        indent = f"    {number:>3}  "
        if not does:
            return [f"{indent}all robots idle"]
        if not self.sparse:
            return ["".join((indent, *does)).rstrip()]
        return packed(does, self.width, indent, _NUMBER, gap="")
