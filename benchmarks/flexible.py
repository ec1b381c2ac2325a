# SPDX-License-Identifier: GPL-3.0-or-later
"""Plans that a sentence leaves open, and words saved: rows of Table 1 by method.

    python benchmarks/flexible.py [ROW ..] [--time-limit SECONDS]

The rows are GWB5 and GWB7 by default. One line for each language: words, the average over the
tasks of the plans left open (for a plan drawn uniformly, and for the first plan in our order), the
upper bound for every language, tasks in which the first plan's sentence leaves more than one plan
open and their average, communication saving (all plans in expectation; first plans; first plans
with a sentence shorter than the plan), seconds.

The paper gives for its own language of GWB7: 4 words, 12.1 plans a task (14.7 over 774 tasks),
saving 27.3 % (33.3 % over 784 plans).
"""

from __future__ import annotations

import argparse
from time import perf_counter
from typing import Literal

import numpy as np
from printed_table import PrintedTable

from coordlang.building import Built, build_language
from coordlang.evaluation.material.suite import ROWS, World, find_domains
from coordlang.language.flexibility import flexibility
from coordlang.required.divergences import required_nodes
from coordlang.tasks.candidates import Candidates
from coordlang.vocabulary.flexibility_bound import flexibility_bounds
from planners.limits import time_limit

#: Label, method, the language to prefer.
LANGUAGES: tuple[tuple[str, str, Literal["flexible"] | None], ...] = (
    ("greedy", "greedy", None),
    ("separating", "separating", None),
    ("minimal", "minimal", None),
    ("minimal, flexible", "minimal", "flexible"),
)
COLUMNS = (
    ("row", 5),
    ("language", 18),
    ("words", 5),
    ("open", 6),
    ("first", 6),
    ("bound", 6),
    ("tasks > 1", 9),
    ("their", 6),
    ("saving", 7),
    ("first", 7),
    ("shorter", 14),
    ("s", 6),
)
PAPER = ("GWB7", "the paper's", 4, "", "12.1", "", 774, "14.7", "", "27.3 %", "33.3 % of 784", "")


def measures(candidates: Candidates, built: Built) -> list[str]:
    """The columns from "open" to "shorter", without the bound."""
    partition = built.language.partition(candidates.model)
    words = [partition.word_of(space.rows)[space.state] for space in candidates.spaces]
    found = flexibility(candidates.spaces, words)
    several = found.first > 1.5
    shorter = found.first_saving > 1e-9
    saved = f"{100 * found.first_saving[shorter].mean():.1f} % of {shorter.sum():,}"
    return [
        f"{found.value:.2f}",
        f"{found.first.mean():.2f}",
        f"{several.sum():,}",
        f"{found.first[several].mean():.1f}" if several.any() else "",
        f"{100 * found.saving.mean():.1f} %",
        f"{100 * found.first_saving.mean():.1f} %",
        saved if shorter.any() else "",
    ]


def print_row(row: World, seconds: float, table: PrintedTable) -> None:
    """Build all languages of a row, each in at most so many seconds."""
    candidates = row.candidates(find_domains(None))
    requires = [required_nodes(space) for space in candidates.spaces]
    bound = f"{np.mean(flexibility_bounds(candidates.spaces, requires)):.2f}"
    if row.name == PAPER[0]:
        table.print(*PAPER)
    for label, method, prefer in LANGUAGES:
        start = perf_counter()
        with time_limit(seconds):
            built = build_language(candidates, method, prefer=prefer)
        taken = perf_counter() - start
        left, first, *others = measures(candidates, built)
        size = built.language.guarantee.size
        table.print(row.name, label, size, left, first, bound, *others, f"{taken:.1f}")


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("rows", nargs="*", default=["GWB5", "GWB7"])
    parser.add_argument(
        "--time-limit", type=float, default=120, help="seconds for each language (default: 120)"
    )
    arguments = parser.parse_args()
    table = PrintedTable(*COLUMNS)
    for row in ROWS:
        if row.name in arguments.rows:
            print_row(row, arguments.time_limit, table)


if __name__ == "__main__":
    main()
