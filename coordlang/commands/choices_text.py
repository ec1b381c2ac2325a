# SPDX-License-Identifier: GPL-3.0-or-later
"""Robots' choices as tables: state by state what may be done, where it leads, what is known."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import zip_longest
from typing import TYPE_CHECKING

from coordlang.commands.layout import alike, named, packed, wrapped
from coordlang.execution.drawing import distinguishing
from coordlang.language.candidates import describe
from planners.system.notebook import counted

if TYPE_CHECKING:
    from coordlang.commands.choices import RobotsChoices
    from coordlang.execution.choices import RobotChoices

#: States of an automaton beyond which a table is cut.
STATES_SHOWN = 40
_MAY_DO = "may do"
#: Characters that what is known has at least beside what may be done.
_LEAST_ROOM = 30


def choices_text(found: RobotsChoices, width: int, *, is_checked: bool) -> str:
    """Each robot's automaton as a table; robots whose automata are equal are shown together."""
    used, mixtures = found.found.task_language, found.found.mixtures
    lines = [
        *wrapped(f"The task {describe(used.space, used.task)}", width, "", "  "),
        f'"{found.sentence}" leaves {counted(found.plans, "plan")} open.',
    ]
    if is_checked and mixtures is not None and mixtures.holds:
        number = counted(found.combinations, "combination")
        nodes = counted(mixtures.nodes, "node")
        lines.append(
            f"checked: {number} of own subplans, all {used.model.kept_plans} ({nodes} walked)"
        )
    tables = [_table(found, found.found.robots[robot], width) for robot in found.chosen]
    for group in alike(tables):
        robots = named([used.model.robots[found.chosen[number]] for number in group])
        may, table = "may" if len(group) == 1 else "may each", tables[group[0]]
        lines += ["", *wrapped(f"{robots} {may} {table[0]}", width, "", "  "), *table[1:]]
    return "\n".join(lines) + "\n"


def _table(found: RobotsChoices, own: RobotChoices, width: int) -> list[str]:
    """The automaton state by state: what may be done there, where it leads, what is known there."""
    automaton = own.automaton
    subplans = counted(automaton.count, "subplan")
    states = counted(len(automaton), "state")
    rows = _rows(found, own)[:STATES_SHOWN]
    lines = [f"follow {subplans} ({states}):", *(_row_lines(rows, width) if rows else ())]
    rest = automaton.layers[-1].start - len(rows)
    if rest > 0:
        lines.append(f"  .. and {counted(rest, 'state')} more; --format json has all of them")
    return lines


def _row_lines(rows: Sequence[_Row], width: int) -> Iterator[str]:
    """Columns as wide as they need be; broken into lines where they do not fit.

    Then each alternative has a line of its own, and so many atoms as fit stand beside it.
    """
    head = ("step", "state", "left")
    numbers = [
        max(map(len, column)) for column in zip(head, *(row.numbers for row in rows), strict=True)
    ]
    indent = sum(numbers) + 2 * len(numbers) + 2
    whole = [(" | ".join(row.moves), " ".join(row.knows)) for row in rows]
    broken = indent + max(len(m) for m, _ in whole) + 2 + max(len(k) for _, k in whole) > width
    shown = [
        (row.moves[:1] + tuple(f"| {move}" for move in row.moves[1:]) if broken else (moves,), row)
        for row, (moves, _) in zip(rows, whole, strict=True)
    ]
    may_do = max(len(_MAY_DO), *(len(line) for lines, _ in shown for line in lines))
    room = max(_LEAST_ROOM, width - indent - may_do - 2) if broken else width

    def line(left: Sequence[str], move: str, atoms: str) -> str:
        cells = [cell.rjust(size) for cell, size in zip(left, numbers, strict=True)]
        return "  ".join(["", *cells, move.ljust(may_do), atoms]).rstrip()

    yield line(head, _MAY_DO, "knows")
    for moves, row in shown:
        atoms = packed(row.knows, room, "", "") if broken else [" ".join(row.knows)]
        for number, (move, known) in enumerate(zip_longest(moves, atoms, fillvalue="")):
            yield line(row.numbers if number == 0 else ("",) * len(head), move, known)


@dataclass(frozen=True, slots=True)
class _Row:
    """One state of an automaton: its step, number and subplans left, moves, and what is known."""

    numbers: tuple[str, str, str]
    moves: tuple[str, ...]
    knows: tuple[str, ...]


def _rows(found: RobotsChoices, own: RobotChoices) -> list[_Row]:
    """A row for each state in which something may be done, of the first steps."""
    model, automaton = found.found.task_language.model, own.automaton
    rows = []
    for step, states in enumerate(automaton.layers[:-1], 1):
        if states.start >= STATES_SHOWN:
            break
        for state, atoms in zip(states, distinguishing(found.found, own, states), strict=True):
            moves = tuple(
                f"{model.label_text(own.robot, label) or 'idle'} -> {to}"
                for label, to in automaton.moves(state)
            )
            numbers = str(step), str(state), f"{automaton.left[state]:,}"
            rows.append(_Row(numbers, moves, tuple(atoms)))
    return rows
