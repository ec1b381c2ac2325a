"""Plans that a sentence leaves open, and words saved: GWB5 and GWB7 by method, beside the paper's
figures.

    python benchmarks/flexible.py [ROW ..] [--time-limit SECONDS]

One line for each language: words, the average over the tasks of the plans left open (for a plan
drawn uniformly, and for the first plan in our order), the bound that no language exceeds, tasks in
which the first plan's sentence leaves more than one plan open and their average, communication
saving (all plans in expectation; first plans; first plans with a sentence shorter than the plan),
seconds.  "+ overlap" enlarges the words of the language above it.

The paper gives for its own language of GWB7: 4 words, 12.1 plans a task (14.7 over 774 tasks),
saving 27.3 % (33.3 % over 784 plans).
"""

from __future__ import annotations

import argparse
import sys
from time import perf_counter
from typing import Literal

import numpy as np
from table1 import ROWS, candidates_of

from coordlang.building import Built, build_language
from coordlang.language.flexibility import flexibility
from coordlang.required.composition_walk import walk
from coordlang.tasks.candidates import Candidates
from coordlang.vocabulary.flexibility_bound import flexibility_bounds
from planners.limits import time_limit

#: Label, method, the language to prefer, whether words may overlap.
LANGUAGES: tuple[tuple[str, str, Literal["flexible"] | None, bool], ...] = (
    ("greedy", "greedy", None, False),
    ("separating", "separating", None, False),
    ("minimal", "minimal", None, False),
    ("minimal + overlap", "minimal", None, True),
    ("minimal, flexible", "minimal", "flexible", False),
    ("flexible + overlap", "minimal", "flexible", True),
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


def line(cells: tuple[str, ...]) -> str:
    return "  ".join(f"{cell:>{width}}" for cell, (_, width) in zip(cells, COLUMNS, strict=True))


def measures(candidates: Candidates, built: Built) -> tuple[str, ...]:
    """The columns from "open" to "shorter", without the bound."""
    table = built.language.partition(candidates.model)
    found = flexibility(
        candidates.spaces, [table.word_of(space.rows)[space.state] for space in candidates.spaces]
    )
    several = found.first > 1.5
    shorter = found.first_saving > 1e-9
    return (
        f"{found.value:.2f}",
        f"{found.first.mean():.2f}",
        f"{several.sum():,}",
        f"{found.first[several].mean():.1f}" if several.any() else "",
        f"{100 * found.saving.mean():.1f} %",
        f"{100 * found.first_saving.mean():.1f} %",
        f"{100 * found.first_saving[shorter].mean():.1f} % of {shorter.sum():,}"
        if shorter.any()
        else "",
    )


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("rows", nargs="*", default=["GWB5", "GWB7"])
    parser.add_argument(
        "--time-limit", type=float, default=120, help="seconds for each language (default: 120)"
    )
    arguments = parser.parse_args()
    print(line(tuple(name for name, _ in COLUMNS)))
    for row in ROWS:
        if row.name not in arguments.rows:
            continue
        candidates = candidates_of(row)
        requires = [walk(space).requires for space in candidates.spaces]
        bound = f"{np.mean(flexibility_bounds(candidates.spaces, requires)):.2f}"
        if row.name == "GWB7":
            print(
                line(
                    (
                        row.name,
                        "the paper's",
                        "4",
                        "",
                        "12.1",
                        "",
                        "774",
                        "14.7",
                        "",
                        "27.3 %",
                        "33.3 % of 784",
                        "",
                    )
                )
            )
        for label, method, prefer, overlap in LANGUAGES:
            start = perf_counter()
            with time_limit(arguments.time_limit):
                built = build_language(candidates, method, prefer=prefer, overlap=overlap)
            seconds = f"{perf_counter() - start:.1f}"
            words = str(built.language.guarantee.size)
            left, first, several, their, saving, first_saving, shorter = measures(candidates, built)
            if overlap:  # the other columns are about partitions
                left = f"{built.figures['overlapping_flexibility']:.2f}"
                first = several = their = saving = first_saving = shorter = ""
            print(
                line(
                    (
                        row.name,
                        label,
                        words,
                        left,
                        first,
                        bound,
                        several,
                        their,
                        saving,
                        first_saving,
                        shorter,
                        seconds,
                    )
                )
            )
            sys.stdout.flush()
    return 0


if __name__ == "__main__":
    sys.exit(main())
