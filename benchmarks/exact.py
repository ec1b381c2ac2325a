# SPDX-License-Identifier: GPL-3.0-or-later
"""The exact method at its limits: bounds, rounds, clauses and seconds, by seed.

    python -m benchmarks.exact [ROW ..] [--seeds N] [--jobs N] [--limit SECONDS] [--kept FILE]

Rows are those of Table 1, then ``open-RxC`` and ``ring-RxC`` (two robots, all pairs of states), and
``open-RxC-N`` (N robots); without any, Table 1 and some larger ones.  The columns: words, with the
proved bound where that is smaller (7..8); refuted partitions (*rounds*); failing tuples up to
symmetry; walks of a part of the tasks; clauses; wall and CPU seconds of the whole build; and the
load of the machine over the last minute.  Every number of words is that of a language verified by
definition.  The time limit is for each row and seed.
"""

from __future__ import annotations

import os
import re
import resource
from argparse import Namespace
from functools import partial
from time import perf_counter, process_time

from gridmap import open_grid, ring

from benchmarks import frame
from benchmarks.frame import Figures, KeptRows, PrintedTable, on_grid
from benchmarks.paper.suite import ROWS
from coordlang.commands.building import build_language
from coordlang.language.candidates import Candidates, all_pairs
from planners.parallel.workers import Workers
from planners.system.limits import time_limit

FURTHER = ("open-2x6", "open-3x4", "open-3x5", "open-4x4", "ring-4x5")
FIGURES = ("rounds", "counterexamples", "walks", "clauses")
COLUMNS = (
    ("row", 9),
    ("seed", 4),
    ("words", 7),
    ("rounds", 7),
    ("tuples", 8),
    ("walks", 6),
    ("clauses", 8),
    ("s", 7),
    ("CPU s", 7),
    ("load", 5),
)


def main() -> None:
    """Print the table."""
    parser = frame.arguments(__doc__, 600)
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=1, help="processes of each search")
    given = parser.parse_args()
    done, table = KeptRows(given.kept), PrintedTable(*COLUMNS)
    for name in given.rows or [*(row.name for row in ROWS), *FURTHER]:
        for seed in range(given.seeds):
            key = f"{name}/{seed}/{given.limit:g}/{given.jobs}"
            row = done.get(key, partial(measured, key, name, seed, given))
            table.print(name, seed, *row["cells"])


def candidates_of(name: str) -> Candidates:
    """The candidate tasks of a row."""
    for row in ROWS:
        if row.name == name:
            return row.candidates()
    match = re.fullmatch(r"(open|ring)-(\d+)x(\d+)(?:-(\d))?", name)
    if match is None:
        raise SystemExit(f"there is no row {name}")
    make = {"open": open_grid, "ring": ring}[match[1]]
    domain, problem = on_grid(name, make(int(match[2]), int(match[3])), int(match[4] or 2))
    return all_pairs(domain, [problem])


def measured(key: str, name: str, seed: int, given: Namespace) -> Figures:
    """The columns of a row after its seed."""
    candidates = candidates_of(name)
    wall, cpu = perf_counter(), _processor_time()
    with time_limit(given.limit):
        workers = Workers(given.jobs)
        built = build_language(candidates, "minimal", seed=seed, workers=workers)
    guarantee = built.language.guarantee
    low, high = guarantee.lower_bound, guarantee.size
    cells = [
        str(high) if low == high else f"{low}..{high}",
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
