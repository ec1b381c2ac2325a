# SPDX-License-Identifier: GPL-3.0-or-later
"""The least numbers of words, with bounds: running example, T-shaped map and rows of Table 1.

    python benchmarks/minimal.py [ROW ..] [--time-limit SECONDS] [--methods METHOD,METHOD]

The methods are *greedy*; *alpha*: least under the alpha part of Theorem 3; *separating*: under
alpha or beta; *minimal*: least of all languages. For each the words, with the proved bound where
that is smaller (7..8: between 7 and 8), and seconds; for *minimal* also rounds, counterexamples,
clauses and the symmetries of the model. Where the paper has an exact value (GW1: 3), it is the one
in brackets. The time limit is for each method and row.

Further rows on demand: ``open-RxC`` and ``ring-RxC``, two robots on an open grid or on its border,
all pairs of states; ``open-RxC-N`` with N robots:

    python benchmarks/minimal.py open-2x5 open-3x4 ring-4x4 --methods minimal --time-limit 600
"""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Iterator
from pathlib import Path
from time import perf_counter

from printed_table import PrintedTable

from coordlang.building import Built, build_language
from coordlang.evaluation.material.paper import TABLE_1
from coordlang.evaluation.material.suite import ROWS, World
from coordlang.tasks.candidates import Candidates, all_pairs
from planners.limits import time_limit
from planners.pddl import parse_problem, read_domain
from planners.pddl.sexpr import Source

DOMAINS = Path(__file__).parents[1] / "domains"
sys.path.insert(0, str(DOMAINS))
from generate import problem_text, scenario  # noqa: E402 - beside the domains
from gridmap import open_grid, ring  # noqa: E402 - beside the domains

METHODS = ("greedy", "alpha", "separating", "minimal")
FIGURES = ("rounds", "counterexamples", "clauses", "symmetries")
COLUMNS = (
    ("row", 12),
    ("paper", 7),
    ("greedy", 7),
    ("alpha", 9),
    ("s", 6),
    ("separating", 10),
    ("s", 7),
    ("minimal", 8),
    ("s", 7),
    ("rounds", 7),
    ("counter", 10),
    ("clauses", 8),
    ("sym", 6),
)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("rows", nargs="*")
    parser.add_argument("--time-limit", type=float, help="seconds for each method and row")
    parser.add_argument("--methods", default=",".join(METHODS))
    arguments = parser.parse_args()
    wanted = arguments.methods.split(",")
    table = PrintedTable(*COLUMNS)
    begin = perf_counter()
    unproved = 0
    for name, paper, candidates in inputs(arguments.rows):
        cells: list[object] = []
        for method in METHODS:
            if method in wanted:
                found, proved = measured(candidates, method, arguments.time_limit)
            else:
                found, proved = [None] * width_of(method), True
            cells += found
            unproved += not proved
        table.print(name, paper, *cells)
    print(f"{perf_counter() - begin:.1f} s in total; numbers without proof: {unproved}")


def width_of(method: str) -> int:
    """The number of columns of a method."""
    return {"greedy": 1, "minimal": 2 + len(FIGURES)}.get(method, 2)


def measured(
    candidates: Candidates, method: str, seconds: float | None
) -> tuple[list[object], bool]:
    """The columns of a method, and whether its number of words is proved to be the least."""
    start = perf_counter()
    with time_limit(seconds):
        built = build_language(
            candidates,
            "separating" if method == "alpha" else method,
            alpha_only=method == "alpha",
        )
    size, bound = built.language.guarantee.size, bound_of(built, method)
    if method == "greedy":  # nothing is proved of it
        return [size], True
    words: object = size if bound == size else f"{bound}..{size}"
    cells: list[object] = [words, f"{perf_counter() - start:.1f}"]
    if method == "minimal":
        cells += [int(built.figures.get(name, 0)) for name in FIGURES]
    return cells, bound == size


def inputs(wanted: list[str]) -> Iterator[tuple[str, str, Candidates]]:
    """The rows: name, the paper's words, candidate tasks."""
    for folder in ("three-cells", "t-map"):
        if not wanted or folder in wanted:
            yield folder, "3", World(folder, folder, "problem", "all").candidates(DOMAINS)
    for row in ROWS:
        if not wanted or row.name in wanted:
            paper = TABLE_1[row.name]
            exact = f" ({paper.exact})" if paper.exact else ""
            yield row.name, f"{paper.words}{exact}", row.candidates(DOMAINS)
    for name in wanted:
        if match := re.fullmatch(r"(open|ring)-(\d+)x(\d+)(?:-(\d))?", name):
            make = {"open": open_grid, "ring": ring}[match[1]]
            domain = read_domain(DOMAINS / "grid" / "domain.pddl")
            floor, robots = make(int(match[2]), int(match[3])), int(match[4] or 2)
            text = problem_text(scenario(name, floor, robots), "grid")
            yield name, "-", all_pairs(domain, [parse_problem(Source(name, text), domain)])


def bound_of(built: Built, method: str) -> int:
    """The lower bound on the words of the method's kind."""
    if method in ("alpha", "separating"):
        return int(built.figures["separating_lower_bound"])
    return built.language.guarantee.lower_bound


if __name__ == "__main__":
    main()
