"""Boxes: the largest sets of plans that mix freely.

What follows from them for the flexibility of any language.

If a set of plans is RC-free, every mixture of it is an optimal plan.  Split the robots into one
robot i and the others: the plans are then cells of a table, rows the parts of robot i, columns the
parts of all others, and an RC-free set of cells lies in a *box*, some rows times some columns, all
of whose cells are optimal plans.  So a sentence that plan x has leaves at most m(x) plans open, the
number of cells of the largest box with x in it (for any choice of i), and E is at most the average
of m(x) over the plans of the task, whatever the language and its number of words (Proposition 10
of docs/concepts.md).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from coordlang.language.flexibility import MANY, Floats
from planners.joint.states import bits
from planners.search.plan_space import PlanSpace
from planners.search.plans import Plan, Plans, counts
from planners.tables import Bools

#: Tasks with more plans than this are bounded by their number of plans.
MOST_PLANS = 3_000
#: Boxes looked at for one task; with more of them a plan is bounded by the rows and columns that it
#: can share.
_BOXES = 5_000


def flexibility_bounds(spaces: Sequence[PlanSpace], requires: Sequence[Bools]) -> Floats:
    """For each task an upper bound on E = sum_s n_s^2 / N under any language.

    N where the task does not require coordination, and where it has more than `MOST_PLANS` plans.
    ``requires`` is what `coordlang.required.composition_walk.walk` says of the nodes of each space.
    """
    bounds: list[float] = []
    for space, required in zip(spaces, requires, strict=True):
        counted = counts(space)
        for start in space.starts.tolist():
            plans = Plans(space, start, counted)
            if not required[start] or plans.count > MOST_PLANS:
                bounds.append(float(min(plans.count, MANY)))
            else:
                bounds.append(_average_box(list(plans)))
    return np.array(bounds, np.float64)


def _average_box(plans: Sequence[Plan]) -> float:
    """The size of the largest box with a plan in it, averaged over the plans.

    Of all divisions the least for each plan.
    """
    robots = len(plans[0][0])
    divisions = (
        range(robots) if robots > 2 else range(1)
    )  # with two robots both divisions are one table
    sizes = list(zip(*(_box_sizes(plans, robot) for robot in divisions), strict=True))
    return float(sum(map(min, sizes)) / len(plans))


def _box_sizes(plans: Sequence[Plan], robot: int) -> list[int]:
    """For each plan the size of the largest box with it.

    Rows are the robot's parts, columns those of all others.
    """
    row_of: dict[tuple[int, ...], int] = {}
    column_of: dict[tuple[tuple[int, ...], ...], int] = {}
    cells: dict[tuple[int, int], int] = {}
    for number, plan in enumerate(plans):
        own = tuple(step[robot] for step in plan)
        rest = tuple(step[:robot] + step[robot + 1 :] for step in plan)
        cells[row_of.setdefault(own, len(row_of)), column_of.setdefault(rest, len(column_of))] = (
            number
        )
    rows = [0] * len(row_of)
    for row, column in cells:
        rows[row] |= 1 << column
    closed = _closed(set(rows))
    if closed is None:
        return _shared(rows, cells)
    boxes = [
        (sum(row & columns == columns for row in rows) * columns.bit_count(), columns)
        for columns in closed
    ]
    sizes = [0] * len(plans)
    left = list(rows)
    for size, columns in sorted(boxes, reverse=True):
        for number, row in enumerate(rows):
            if row & columns == columns:
                for column in bits(left[number] & columns):
                    sizes[cells[number, column]] = size
                left[number] &= ~columns
    return sizes


def _closed(rows: set[int]) -> set[int] | None:
    """The column sets of the boxes that cannot grow.

    All intersections of rows; None if there are too many.
    """
    closed: set[int] = set()
    for row in sorted(rows):
        closed |= {row & other for other in closed} | {row}
        if len(closed) > _BOXES:
            return None
    closed.discard(0)
    return closed


def _shared(rows: Sequence[int], cells: Mapping[tuple[int, int], int]) -> list[int]:
    """For each plan: of the rows that have its column, the columns shared with its row.

    No box with it is larger.
    """
    sizes = [0] * len(cells)
    for (row, column), number in cells.items():
        sizes[number] = sum(
            (rows[row] & other).bit_count() for other in rows if other >> column & 1
        )
    return sizes
