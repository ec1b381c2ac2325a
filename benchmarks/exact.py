# SPDX-License-Identifier: GPL-3.0-or-later
"""The exact method at its limits: bounds, rounds, clauses and seconds, by seed.

    python -m benchmarks.exact [ROW ..] [--cost COST] [--asynchronous] [--seeds N] [--jobs N]
                               [--limit SECONDS] [--kept FILE]

Rows are those of Table 1, ``open-RxC`` and ``ring-RxC`` (two robots, all pairs of states),
``open-RxC-N`` (N robots), and CoDMAP problems by their names in `benchmarks.coverage`
(``codmap``: the first ten of each domain), one task under ``--cost``.  Without any, Table 1 and
some larger grids.  The columns: greedy's words (- where first differences are too many to list);
words after 10 s, and at the end, with the proved bound where that is smaller (7..8); refuted
partitions (*rounds*); failing tuples up to symmetry; walks of a part of the tasks; clauses; wall
and CPU seconds of the whole build; and the load of the machine over the last minute.  Every number
of words is that of a language verified by definition.  The time limit is for each row and seed; a
row that has no language within the limits is left out.
"""

from __future__ import annotations

import os
import re
import resource
from argparse import Namespace
from collections.abc import Sequence
from functools import partial
from time import perf_counter, process_time

from gridmap import open_grid, ring

from benchmarks import frame
from benchmarks.coverage import codmap, load
from benchmarks.frame import Figures, KeptRows, PrintedTable, columns, on_grid
from benchmarks.paper.suite import ROWS
from coordlang.commands.building import build_language
from coordlang.language.candidates import Candidates, all_pairs, from_problems
from planners.parallel.workers import Workers
from planners.pddl.model_options import ModelOptions
from planners.system.errors import OutOfMemory, OutOfTime, ProvedImpossible, UsageError
from planners.system.limits import time_limit

FURTHER = ("open-2x6", "open-3x4", "open-3x5", "open-4x4", "ring-4x5")
FIGURES = ("rounds", "counterexamples", "walks", "clauses")
#: Seconds of the first look.
EARLY = 10
COLUMNS = columns(
    "row -34, seed 4, greedy 6, 10 s 7, words 7, rounds 7, tuples 8, walks 6, clauses 8, "
    "s 7, CPU s 7, load 5"
)


def main() -> None:
    """Print the table."""
    parser = frame.arguments(__doc__, 600)
    parser.add_argument("--cost", choices=frame.COSTS, default="makespan+actions")
    parser.add_argument("--asynchronous", action="store_true", help="robots keep no common step")
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=1, help="processes of each search")
    given = parser.parse_args()
    done, table = KeptRows(given.kept), PrintedTable(*COLUMNS)
    for name in rows(given.rows):
        for seed in range(given.seeds):
            key = f"{name}/{given.cost}/{seed}/{given.limit:g}/{given.jobs}"
            key += "/asynchronous" if given.asynchronous else ""
            row = done.get(key, partial(measured, key, name, seed, given))
            if row["cells"]:
                table.print(name, seed, *row["cells"])


def rows(asked: Sequence[str]) -> list[str]:
    """The rows that are asked for."""
    if not asked:
        return [*(row.name for row in ROWS), *FURTHER]
    return [name for given in asked for name in (codmap(10) if given == "codmap" else (given,))]


def candidates_of(name: str, cost: str, *, asynchronous: bool = False) -> Candidates:
    """The candidate tasks of a row; those of Table 1 are always in step."""
    for row in ROWS:
        if row.name == name:
            return row.candidates()
    if "/" in name:
        loaded = load(name, cost)
        options = ModelOptions(cost=loaded.model.cost, asynchronous=asynchronous)
        return from_problems(loaded.domain, loaded.problems, options)
    match = re.fullmatch(r"(open|ring)-(\d+)x(\d+)(?:-(\d))?", name)
    if match is None:
        raise SystemExit(f"there is no row {name}")
    make = {"open": open_grid, "ring": ring}[match[1]]
    try:
        domain, problem = on_grid(name, make(int(match[2]), int(match[3])), int(match[4] or 2))
    except (UsageError, ValueError) as error:
        raise SystemExit(f"there is no row {name}: {error}") from None
    return all_pairs(domain, [problem], ModelOptions(asynchronous=asynchronous))


class Bounds:
    """What a build says of the number of words: by its lines of progress."""

    def __init__(self) -> None:
        self._since = perf_counter()
        self.greedy = 0
        self.early: str | None = None
        self.now = "-"

    def __call__(self, line: str) -> None:
        """Hear a line."""
        if self.early is None and perf_counter() - self._since > EARLY:
            self.early = self.now
        if (match := re.search(r"(\d+) to (\d+) needed", line)) is not None:
            low, high = match.groups()
            self.greedy = self.greedy or int(high)
            self.now = text_of(int(low), int(high))


def text_of(low: int, high: int) -> str:
    """Words with a bound."""
    return str(high) if low == high else f"{low}..{high}"


def measured(key: str, name: str, seed: int, given: Namespace) -> Figures:
    """The columns of a row after its seed; none if there are no greedy words in time."""
    wall, cpu = perf_counter(), _processor_time()
    bounds = Bounds()
    try:
        with time_limit(given.limit):
            candidates = candidates_of(name, given.cost, asynchronous=given.asynchronous)
            workers = Workers(given.jobs)
            built = build_language(
                candidates, "minimal", seed=seed, workers=workers, progress=bounds
            )
    except (OutOfTime, OutOfMemory, ProvedImpossible):
        return {"row": key, "version": frame.project(), "cells": []}
    guarantee, listed = built.language.guarantee, built.job.first_differences.divergences
    words = text_of(guarantee.lower_bound, guarantee.size)
    cells = [
        "-" if listed is None else bounds.greedy or guarantee.size,
        words if bounds.early is None else bounds.early,
        words,
        *(int(built.figures.get(name, 0)) for name in FIGURES),
        f"{perf_counter() - wall:.1f}",
        f"{_processor_time() - cpu:.1f}",
        f"{os.getloadavg()[0]:.1f}",
    ]
    return {"row": key, "version": frame.project(), "cells": cells}


def _processor_time() -> float:
    """CPU seconds of this process and of those that it had."""
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    return process_time() + children.ru_utime + children.ru_stime


if __name__ == "__main__":
    main()
