# SPDX-License-Identifier: GPL-3.0-or-later
"""Words of published tasks: greedy's, and how many are left when words are merged.

    python -m benchmarks.merging [ROW ..] [--cost COST] [--limit SECONDS] [--kept FILE]

Rows are the problems of the twelve CoDMAP domains that `benchmarks.coverage` names (the first ten
of each by size); those whose plans or greedy words are not there within 10 s are left out.  The
columns: robots, nodes of the plan graph, greedy's words, words after merging for so many seconds at
most (a star: no two words are left to merge), walks of the tasks, failing tuples up to symmetry.
"""

from __future__ import annotations

from argparse import Namespace
from functools import partial

import numpy as np

from benchmarks import frame
from benchmarks.coverage import codmap, load
from benchmarks.frame import Figures, KeptRows, PrintedTable
from coordlang.commands.building import build_language
from coordlang.language.candidates import from_problems
from coordlang.symmetry.group import symmetry_group
from coordlang.vocabulary.job import word_count
from coordlang.vocabulary.merging import merged
from coordlang.vocabulary.refuter import Refuter
from planners.pddl.model_options import ModelOptions
from planners.system.errors import CoordlangError, OutOfTime
from planners.system.limits import time_limit

COLUMNS = (
    ("row", -34),
    ("robots", 6),
    ("nodes", 7),
    ("greedy", 6),
    ("merged", 7),
    ("walks", 6),
    ("tuples", 7),
)
#: Seconds for the plans and for greedy's words.
_FIRST = 10


def main() -> None:
    """Print the table."""
    parser = frame.arguments(__doc__, 10)
    parser.add_argument("--cost", default="makespan+actions")
    given = parser.parse_args()
    done, table = KeptRows(given.kept), PrintedTable(*COLUMNS)
    for name in given.rows or codmap(10):
        key = f"{name}/{given.cost}/{given.limit:g}"
        row = done.get(key, partial(measured, key, name, given))
        if row["cells"]:
            table.print(name, *row["cells"])


def measured(key: str, name: str, given: Namespace) -> Figures:
    """The columns of a row after its name; none where greedy's words are not there in time."""
    try:
        with time_limit(_FIRST):
            loaded = load(name, given.cost)
            candidates = from_problems(
                loaded.domain, loaded.problems, ModelOptions(cost=given.cost)
            )
            built = build_language(candidates, "greedy")
    except CoordlangError:
        return {"row": key, "version": frame.project(), "cells": []}
    states = built.job.states
    word = built.language.partition(candidates.model).word_of(candidates.rows).astype(np.int64)
    first = best = {state: int(word[state]) for state in states}
    end, refuter = "", None
    try:
        with time_limit(given.limit):
            group = symmetry_group(candidates)
            refuter = Refuter(candidates.spaces, group, len(candidates.rows), 0, first=word)
            for fewer in merged(first, states, refuter):
                best = fewer
            end = "*"
    except OutOfTime:
        pass
    (space,) = candidates.spaces
    work = (refuter.walks, len(refuter.pool)) if refuter else (0, 0)
    cells = [space.robots, len(space), word_count(first), f"{word_count(best)}{end}", *work]
    return {"row": key, "version": frame.project(), "cells": cells}


if __name__ == "__main__":
    main()
