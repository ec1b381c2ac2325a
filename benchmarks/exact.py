# SPDX-License-Identifier: GPL-3.0-or-later
"""The exact method at its limits: bounds, work and time, row by row and seed by seed.

    python benchmarks/exact.py [ROW ..] [--time-limit SECONDS] [--seeds N] [--jobs N] [--kept FILE]

Rows are those of Table 1, ``open-RxC`` and ``ring-RxC`` (two robots, all pairs of states), and
``open-RxC-N`` (N robots).  The columns: words, with the proved bound where that is smaller (7..8);
refuted partitions (*rounds*), of abstract states and of equivariant words; failing tuples up to
symmetry; walks of a part of the tasks; clauses; wall and CPU seconds of the whole build; and the
load of the machine over the last minute.  Every number of words is that of a language verified by
definition.  ``--kept`` keeps rows that are done in a file, so that a run that was killed goes on;
the time limit is for each row and seed.
"""

from __future__ import annotations

import argparse
import os
import resource
from argparse import Namespace
from functools import partial
from pathlib import Path
from time import perf_counter, process_time

from kept_rows import Figures, KeptRows
from minimal import inputs
from printed_table import PrintedTable

from coordlang.building import build_language
from coordlang.evaluation.material.suite import ROWS
from coordlang.tasks.candidates import Candidates
from planners.limits import time_limit
from planners.pieces.processes import Processes

FURTHER = ("open-2x6", "open-3x4", "open-3x5", "open-4x4", "ring-4x5")
FIGURES = ("rounds", "abstract_rounds", "equivariant_rounds", "counterexamples", "walks", "clauses")
COLUMNS = (
    ("row", 9),
    ("seed", 4),
    ("words", 7),
    ("rounds", 7),
    ("abstract", 8),
    ("equiv.", 7),
    ("tuples", 8),
    ("walks", 6),
    ("clauses", 8),
    ("s", 7),
    ("CPU s", 7),
    ("load", 5),
)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("rows", nargs="*")
    parser.add_argument("--time-limit", type=float, default=600, help="seconds for each row, seed")
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=1, help="processes of each search")
    parser.add_argument("--kept", type=Path, help="a file with the rows that are done")
    arguments = parser.parse_args()
    wanted = arguments.rows or [*(row.name for row in ROWS), *FURTHER]
    done, table = KeptRows(arguments.kept), PrintedTable(*COLUMNS)
    for name, _, candidates in inputs(wanted):
        for seed in range(arguments.seeds):
            key = f"{name}/{seed}/{arguments.time_limit:g}/{arguments.jobs}"
            row = done.get(key, partial(measured, key, candidates, seed, arguments))
            table.print(name, seed, *row["cells"])


def measured(key: str, candidates: Candidates, seed: int, arguments: Namespace) -> Figures:
    """The columns of a row after its seed."""
    wall, cpu = perf_counter(), _processor_time()
    with time_limit(arguments.time_limit):
        runner = Processes(arguments.jobs)
        built = build_language(candidates, "minimal", seed=seed, runner=runner)
    guarantee = built.language.guarantee
    low, high = guarantee.lower_bound, guarantee.size
    cells = [
        str(high) if low == high else f"{low}..{high}",
        *(int(built.figures.get(name, 0)) for name in FIGURES),
        f"{perf_counter() - wall:.1f}",
        f"{_processor_time() - cpu:.1f}",
        f"{os.getloadavg()[0]:.1f}",
    ]
    return {"row": key, "cells": cells}


def _processor_time() -> float:
    """CPU seconds of this process and of those that it had."""
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    return process_time() + children.ru_utime + children.ru_stime


if __name__ == "__main__":
    main()
