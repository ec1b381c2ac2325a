# SPDX-License-Identifier: GPL-3.0-or-later
"""Among languages with equally many words, one whose sentences leave many plans open.

Maximises the average of E = sum_s n_s^2 / N over the candidate tasks
(`coordlang.language.sentences`) by local search (`coordlang.vocabulary.local_search`), with
necessary clauses as constraints.  A partition without counterexample is verified by definition
before it counts.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from coordlang.language.sentences import MANY, Flexibility
from coordlang.required.choices import Choices
from coordlang.required.plan_table import PlanTable
from coordlang.vocabulary.job import Assignment, Job, Outcome
from coordlang.vocabulary.languages import Languages
from coordlang.vocabulary.local_search import WORK, LocalSearch
from planners.joint.tables import Floats, Ints
from planners.search.plan_space import PlanSpace
from planners.search.plans import Plan, Plans, counts
from planners.system.limits import run_until_stopped

#: Differences that are due to rounding.
_ROUNDING = 1e-9


def flexible(job: Job, found: Outcome, work: int = WORK) -> Outcome:
    """A language with as many words as ``found`` has, at least as flexible.

    Anytime: out of time or memory, or interrupted, the best verified language so far is returned,
    with the error in ``stopped``.

    The bound on the number of words is that of ``found``.  ``figures`` also hold ``flexibility``
    (plans left open, averaged over tasks), ``flexibility_before`` (that of ``found``),
    ``flexibility_bound`` (which no language exceeds) and ``communication_saving``; nothing of these
    where they are too much work to measure, or it was ended before.
    """
    search = _Search(job, found)
    stopped = run_until_stopped(lambda: search.run(work))
    return search.outcome(stopped)


class _Search(LocalSearch):
    """``partition`` is the most flexible one that was verified."""

    def __init__(self, job: Job, found: Outcome) -> None:
        super().__init__(job, found.size)
        self._found = found
        self.partition: Assignment = found.partition
        #: How many plans ``found`` leaves open, and how many ``partition``; None: not measured.
        self._before: Flexibility | None = None
        self._after: Flexibility | None = None
        self._bound: float | None = None
        self._pending = False
        self._improvements = 0

    def outcome(self, stopped: BaseException | None) -> Outcome:
        """The best language, with what is known of it."""
        figures: dict[str, float] = {**self._found.figures, "moves": self.moves}
        figures["improvements"] = self._improvements
        if self._before is not None and self._after is not None:
            figures |= self._measures(self._before, self._after)
        return replace(self._found, partition=self.partition, figures=figures, stopped=stopped)

    def _measures(self, before: Flexibility, after: Flexibility) -> dict[str, float]:
        if after.value < before.value:  # of many plans some were measured, and misled the search
            after, self.partition = before, self._found.partition
        bound = sum(min(plans, MANY) for plans in after.plans) / len(after.plans)
        if self._bound is not None:
            assert after.value <= self._bound * (1 + _ROUNDING), "no language exceeds the bound"
            bound = max(self._bound, after.value)  # in another order sums differ in last digits
        return {
            "flexibility": after.value,
            "flexibility_first_plan": float(after.first.mean()),
            "flexibility_before": before.value,
            "flexibility_bound": bound,
            "communication_saving": float(after.saving.mean()),
        }

    def run(self, work: int) -> None:
        """Search until the bound is reached, or it does not pay any more."""
        job = self._job
        spaces, states = job.candidates.spaces, len(job.candidates.rows)
        self._before = self._after = self._measured(self.partition)
        self._bound = float(flexibility_bounds(spaces).mean())
        if self._words < 2 or self._is_met:
            return
        self._languages = languages = self._found.languages or Languages.of(job)
        self.clauses = languages.clauses
        self.table = PlanTable(spaces, states, job.seed, mixtures=False)
        self.best_word = job.word(self.partition)
        self.best = float(self.values(self.best_word, np.arange(len(self.table))).sum())
        self.anneal(self.best_word, languages.group.permutations, work)

    def values(self, word: Ints, tasks: Ints) -> Floats:
        """How many plans of some tasks are not left open."""
        return self.table.plans_ruled_out(word, tasks)

    def offer(self, word: Ints, values: Floats) -> None:
        """Look for counterexamples to a partition better than the best; none: it is the best."""
        value = float(values.sum())
        if value < self.best * (1 - _ROUNDING) and self._languages.holds(self._job.partition(word)):
            self.best, self.best_word, self._pending = value, word, True

    def settle(self) -> bool:
        """Verify the best partition, if it is new; whether it reaches the bound."""
        if self._pending:
            partition = self._job.partition(self.best_word)
            self._job.check(partition)
            self._after, self.partition = self._measured(partition), partition
            self._pending = False
            self._improvements += 1
        return self._is_met

    @property
    def _is_met(self) -> bool:
        assert self._bound is not None
        assert self._after is not None
        return self._after.value >= self._bound * (1 - _ROUNDING)

    def _measured(self, partition: Assignment) -> Flexibility:
        job = self._job
        return Flexibility(job.candidates.spaces, job.of_nodes(job.word(partition)))


#: Plans of a task up to which its boxes are looked at, and boxes that cannot grow, of one task and
#: one division of the robots.
_PLANS, _BOXES = 3_000, 5_000


def largest_boxes(spaces: Sequence[PlanSpace]) -> Iterator[tuple[int, list[int] | None]]:
    """For each task the number of its plans and, of each, the size of its largest box.

    No sizes (None) where no coordination is required, or there are too many plans; no less than the
    size where there are too many boxes.
    """
    for space in spaces:
        counted, required = counts(space), Choices(space).requires
        for start in space.starts.tolist():
            plans = Plans(space, start, counted)
            is_unbounded = not required[start] or plans.count > _PLANS
            yield plans.count, None if is_unbounded else _box_sizes(list(plans))


def flexibility_bounds(spaces: Sequence[PlanSpace]) -> Floats:
    """(tasks) an upper bound on E (`Flexibility`) under any language; N where none is required."""
    bounds = [
        float(min(count, MANY)) if sizes is None else float(sum(sizes) / count)
        for count, sizes in largest_boxes(spaces)
    ]
    return np.array(bounds, np.float64)


def _box_sizes(plans: Sequence[Plan]) -> list[int]:
    """For each plan the size of the largest box with it, the least over divisions of robots."""
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
    """All intersections of rows but the empty one, boxes that cannot grow; None: too many."""
    found: set[int] = set()
    for row in sorted(set(rows)):
        found |= {row & other for other in found} | {row}
        if len(found) > _BOXES:
            return None
    found.discard(0)
    return found
