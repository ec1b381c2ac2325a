# SPDX-License-Identifier: GPL-3.0-or-later
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

from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from coordlang.language.flexibility import MANY, Floats
from coordlang.required.divergences import required_nodes
from planners.search.plan_space import PlanSpace
from planners.search.plans import Plan, Plans, counts

#: Plans of a task up to which its boxes are looked at, and boxes that cannot grow, of one task and
#: one division of the robots.
_PLANS, _BOXES = 3_000, 5_000


def largest_boxes(spaces: Sequence[PlanSpace]) -> Iterator[tuple[int, list[int] | None]]:
    """For each task the number of its plans and, of each, the size of its largest box.

    No sizes (None) where no coordination is required, or there are too many plans; no less than the
    size where there are too many boxes.
    """
    for space in spaces:
        counted, required = counts(space), required_nodes(space)
        for start in space.starts.tolist():
            plans = Plans(space, start, counted)
            is_unbounded = not required[start] or plans.count > _PLANS
            yield plans.count, None if is_unbounded else _box_sizes(list(plans))


def flexibility_bounds(spaces: Sequence[PlanSpace]) -> Floats:
    """(tasks) an upper bound on E = sum_s n_s^2 / N under any language.

    N where the task does not require coordination.
    """
    bounds = [
        float(min(count, MANY)) if sizes is None else float(sum(sizes) / count)
        for count, sizes in largest_boxes(spaces)
    ]
    return np.array(bounds, np.float64)


def _box_sizes(plans: Sequence[Plan]) -> list[int]:
    """For each plan the size of the largest box with it.

    Of all divisions of the robots the least size counts.
    """
    robots = len(plans[0][0])
    # With two robots both divisions are one table.
    divisions = range(robots) if robots > 2 else range(1)
    sizes = [_of_division(plans, robot) for robot in divisions]
    return list(map(min, zip(*sizes, strict=True)))


def _of_division(plans: Sequence[Plan], robot: int) -> list[int]:
    """For each plan the size of the largest box with it; no less where there are many boxes."""
    cells, rows = _table(plans, robot)
    maximal = _intersections(rows)
    if maximal is None:
        return [_shared(rows, *cell) for cell in cells]

    def size(columns: int) -> int:
        return sum(row & columns == columns for row in rows) * columns.bit_count()

    boxes = sorted(((size(columns), columns) for columns in maximal), reverse=True)
    return [
        next(n for n, columns in boxes if columns & column and not columns & ~rows[row])
        for row, column in cells
    ]


def _shared(rows: Sequence[int], row: int, column: int) -> int:
    """What the rows with a column share with one of them: no box with this cell is larger."""
    return sum((rows[row] & other).bit_count() for other in rows if other & column)


def _table(plans: Sequence[Plan], robot: int) -> tuple[list[tuple[int, int]], list[int]]:
    """The row and the column of each plan, and the columns of each row; sets of columns are bits.

    Rows are the parts of one robot, columns those of all others.
    """
    row_of: dict[tuple[int, ...], int] = {}
    column_of: dict[tuple[tuple[int, ...], ...], int] = {}
    cells, rows = [], defaultdict[int, int](int)
    for plan in plans:
        row = row_of.setdefault(tuple(step[robot] for step in plan), len(row_of))
        rest = tuple(step[:robot] + step[robot + 1 :] for step in plan)
        column = 1 << column_of.setdefault(rest, len(column_of))
        rows[row] |= column
        cells.append((row, column))
    return cells, list(rows.values())


def _intersections(rows: Iterable[int]) -> set[int] | None:
    """All intersections of rows but the empty one: the column sets of boxes that cannot grow.

    None if there are too many.
    """
    found: set[int] = set()
    for row in sorted(set(rows)):
        found |= {row & other for other in found} | {row}
        if len(found) > _BOXES:
            return None
    found.discard(0)
    return found
