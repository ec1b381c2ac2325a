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

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from coordlang.language.flexibility import MANY, Floats
from planners.joint.states import bits
from planners.joint.tables import Bools
from planners.search.plan_space import PlanSpace
from planners.search.plans import Plan, Plans, counts

#: Plans of a task up to which its boxes are looked at.
MOST_PLANS = 3_000
#: Boxes that cannot grow, of one task and one division, that are looked at.
MOST_BOXES = 5_000


def flexibility_bounds(
    spaces: Sequence[PlanSpace],
    requires: Sequence[Bools],
    *,
    most_plans: int = MOST_PLANS,
    most_boxes: int = MOST_BOXES,
) -> Floats:
    """For each task an upper bound on E = sum_s n_s^2 / N under any language.

    N where the task does not require coordination.

    Parameters
    ----------
    spaces
        The plan spaces of the tasks.
    requires
        For each space, of which nodes coordination is required
        (`coordlang.required.divergences.required_nodes`).
    most_plans
        A task with more plans is bounded by their number.
    most_boxes
        Where there are more boxes a plan is bounded by the rows and columns that it can share.

    Returns
    -------
    Floats
        (tasks), in the order of the spaces.
    """
    bounds = [
        float(min(count, MANY)) if sizes is None else float(sum(sizes) / count)
        for count, sizes in _boxes_by_task(spaces, requires, most_plans, most_boxes)
    ]
    return np.array(bounds, np.float64)


def bits_bounds(
    spaces: Sequence[PlanSpace],
    requires: Sequence[Bools],
    *,
    most_plans: int = MOST_PLANS,
    most_boxes: int = MOST_BOXES,
) -> Floats:
    """For each task a lower bound on the bits that must be said, so that no mixture fails.

    The entropy of the sentence that is said of a plan drawn uniformly, under any division of the
    task's plans into sets that mix freely, whether words of states can make it or not: a plan in a
    set of n_s plans takes ``log2(N / n_s)`` bits, and n_s is at most the size of its largest box
    (Proposition 26 of docs/concepts.md).

    Parameters
    ----------
    spaces, requires, most_plans, most_boxes
        As in `flexibility_bounds`; the bound of a task with more plans is 0.
    """
    bounds = [
        0.0 if sizes is None else float(np.log2(count / np.array(sizes, np.float64)).mean())
        for count, sizes in _boxes_by_task(spaces, requires, most_plans, most_boxes)
    ]
    return np.array(bounds, np.float64)


def _boxes_by_task(
    spaces: Sequence[PlanSpace], requires: Sequence[Bools], most_plans: int, most_boxes: int
) -> Iterator[tuple[int, list[int] | None]]:
    """For each task the number of its plans and, of each, the size of its largest box.

    No sizes (None) where no coordination is required, or there are too many plans.
    """
    for space, required in zip(spaces, requires, strict=True):
        counted = counts(space)
        for start in space.starts.tolist():
            plans = Plans(space, start, counted)
            is_unbounded = not required[start] or plans.count > most_plans
            yield plans.count, None if is_unbounded else _box_sizes(list(plans), most_boxes)


def _box_sizes(plans: Sequence[Plan], most_boxes: int) -> list[int]:
    """For each plan the size of the largest box with it.

    Of all divisions of the robots the least size counts.
    """
    robots = len(plans[0][0])
    # With two robots both divisions are one table.
    divisions = range(robots) if robots > 2 else range(1)
    sizes = [_Table.of(plans, robot).box_sizes(most_boxes) for robot in divisions]
    return list(map(min, zip(*sizes, strict=True)))


@dataclass(frozen=True, slots=True)
class _Table:
    """Plans as cells: rows are the parts of one robot, columns those of all others.

    ``cells[row, column]`` is the number of the plan, ``rows`` the columns of each row, as bits.
    """

    cells: dict[tuple[int, int], int]
    rows: list[int]

    @classmethod
    def of(cls, plans: Sequence[Plan], robot: int) -> _Table:
        """The table for a robot."""
        row_of: dict[tuple[int, ...], int] = {}
        column_of: dict[tuple[tuple[int, ...], ...], int] = {}
        cells: dict[tuple[int, int], int] = {}
        for number, plan in enumerate(plans):
            own = tuple(step[robot] for step in plan)
            rest = tuple(step[:robot] + step[robot + 1 :] for step in plan)
            row = row_of.setdefault(own, len(row_of))
            cells[row, column_of.setdefault(rest, len(column_of))] = number
        rows = [0] * len(row_of)
        for row, column in cells:
            rows[row] |= 1 << column
        return cls(cells, rows)

    def box_sizes(self, most_boxes: int) -> list[int]:
        """For each plan the size of the largest box with it; no less where there are many boxes."""
        maximal = _intersections(self.rows, most_boxes)
        if maximal is None:
            return self._shared()
        boxes = [
            (sum(row & columns == columns for row in self.rows) * columns.bit_count(), columns)
            for columns in maximal
        ]
        sizes = [0] * len(self.cells)
        left = list(self.rows)
        for size, columns in sorted(boxes, reverse=True):
            for number, row in enumerate(self.rows):
                if row & columns == columns:
                    for column in bits(left[number] & columns):
                        sizes[self.cells[number, column]] = size
                    left[number] &= ~columns
        return sizes

    def _shared(self) -> list[int]:
        """For each plan: of the rows that have its column, the columns shared with its row.

        No box with it is larger.
        """
        sizes = [0] * len(self.cells)
        for (row, column), number in self.cells.items():
            sizes[number] = sum(
                (self.rows[row] & other).bit_count() for other in self.rows if other >> column & 1
            )
        return sizes


def _intersections(rows: Iterable[int], most: int) -> set[int] | None:
    """All intersections of rows but the empty one: the column sets of boxes that cannot grow.

    None if there are more than ``most``.
    """
    found: set[int] = set()
    for row in sorted(set(rows)):
        found |= {row & other for other in found} | {row}
        if len(found) > most:
            return None
    found.discard(0)
    return found
