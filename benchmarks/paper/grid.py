# SPDX-License-Identifier: GPL-3.0-or-later
"""The shipped grid maps: cells named by row and column, robots in cells."""

from __future__ import annotations

import re
from collections.abc import Sequence
from string import ascii_lowercase

from planners.joint.model import JointModel
from planners.joint.tables import Rows
from planners.search.plan_space import PlanSpace


def is_cell(name: str) -> bool:
    """Say whether an object is called as cells are, by row and column, as in ``c1-3``."""
    return re.fullmatch(r"[a-z]+\d+-\d+", name) is not None


def cell_position(cell: str) -> tuple[int, int]:
    """Return the row and column of a cell."""
    row, column = cell.lstrip(ascii_lowercase).split("-")
    return int(row), int(column)


def destinations(model: JointModel, robot: int) -> list[str | None]:
    """Return where each label of a robot leads: the last argument of its action; None for idle."""
    arguments = {action.label: action.args for action in model.actions}
    own = [arguments.get(text, ()) for text in model.labels[robot]]
    return [None, *(args[-1] if args else None for args in own[1:])]


def entered_cells(model: JointModel, robot: int) -> list[str | None]:
    """Return the `destinations` that are cells; None for a label that leads to none."""
    found = destinations(model, robot)
    return [name if name is not None and is_cell(name) else None for name in found]


def placement(cells: Sequence[str]) -> tuple[str, ...]:
    """Return the atoms that say that robots r1, r2 .. are in these cells."""
    return tuple(f"(at r{number} {cell})" for number, cell in enumerate(cells, 1))


def task_cells(space: PlanSpace, task: int) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the robots' cells at the start and at the end of a task.

    All optimal plans of the task must end in one state.
    """
    start = int(space.starts[task])
    end = space.nodes_on(start, space.first_path(start))[-1]
    rows = space.rows[space.state[[start, end]]]
    return _robot_cells(space.model, rows[0]), _robot_cells(space.model, rows[1])


def _robot_cells(model: JointModel, row: Rows) -> tuple[str, ...]:
    """The cell of each robot in a state."""
    cell = {}
    for number in model.codec.true_facts(row):
        atom = model.codec.facts.atoms[number]
        if atom.predicate == "at":
            robot, place = atom.args
            cell[robot] = place
    return tuple(cell[robot] for robot in model.robots)
