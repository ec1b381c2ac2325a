"""The least numbers of words for the running example, the T-shaped map and the rows of Table 1,
with bounds.

    python benchmarks/minimal.py [ROW ..] [--time-limit SECONDS] [--methods
    greedy,alpha,separating,minimal]

For each method its words, with the proved bound where that is smaller (7..8: between 7 and 8), and
seconds: *greedy*; *alpha*: least under the alpha part of Theorem 3; *separating*: under alpha or
beta; *minimal*: least of all languages, with its rounds, counterexamples, clauses and the
symmetries of the model.  Where the paper has an exact value (GW1: 3), it is the one in brackets.
The time limit is for each method and row.

Further rows on demand: ``open-RxC`` and ``ring-RxC``, two robots on an open grid or on its border,
all pairs of states:

    python benchmarks/minimal.py open-2x5 open-2x6 open-3x4 open-3x5 ring-4x4 ring-4x5 --methods
    minimal --time-limit 600
"""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Iterator
from pathlib import Path
from time import perf_counter

from table1 import ROWS, candidates_of

from coordlang.building import Built, build_language
from coordlang.tasks.candidates import Candidates, all_pairs
from planners.limits import time_limit
from planners.pddl import parse_problem, read_domain, read_problem
from planners.pddl.sexpr import Source

DOMAINS = Path(__file__).parents[1] / "domains"
sys.path.insert(0, str(DOMAINS))
from generate import problem_text, scenario  # noqa: E402 - beside the domains
from gridmap import open_grid, ring  # noqa: E402 - beside the domains

PAPER_EXACT = {"GW1": " (3)"}
METHODS = ("greedy", "alpha", "separating", "minimal")
HEADER = (
    "row",
    "paper",
    "greedy",
    "alpha",
    "s",
    "separating",
    "s",
    "minimal",
    "s",
    "rounds",
    "counter",
    "clauses",
    "sym",
)
WIDTHS = (12, 7, 7, 9, 6, 10, 7, 8, 7, 7, 10, 8, 6)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("rows", nargs="*")
    parser.add_argument("--time-limit", type=float, help="seconds for each method and row")
    parser.add_argument("--methods", default=",".join(METHODS))
    arguments = parser.parse_args()
    wanted = arguments.methods.split(",")
    show(HEADER)
    begin = perf_counter()
    unproved = 0
    for name, paper, candidates in inputs(arguments.rows):
        cells: list[object] = [name, paper]
        for method in METHODS:
            if method not in wanted:
                cells += ["-"] * (1 if method == "greedy" else 2)
                continue
            start = perf_counter()
            with time_limit(arguments.time_limit):
                built = build_language(
                    candidates,
                    "separating" if method == "alpha" else method,
                    alpha_only=method == "alpha",
                )
            size, bound = built.language.guarantee.size, bound_of(built, method)
            unproved += method != "greedy" and bound < size
            cells.append(f"{bound}..{size}" if method != "greedy" and bound < size else size)
            if method != "greedy":
                cells.append(f"{perf_counter() - start:.1f}")
            if method == "minimal":
                cells += [
                    int(built.figures.get(k, 0))
                    for k in ("rounds", "counterexamples", "clauses", "symmetries")
                ]
        show(cells)
    print(f"together {perf_counter() - begin:.1f} s; numbers without proof: {unproved}")
    return 0


def inputs(wanted: list[str]) -> Iterator[tuple[str, str, Candidates]]:
    for folder in ("three-cells", "t-map"):
        if not wanted or folder in wanted:
            domain = read_domain(DOMAINS / folder / "domain.pddl")
            yield (
                folder,
                "3",
                all_pairs(domain, [read_problem(DOMAINS / folder / "problem.pddl", domain)]),
            )
    for row in ROWS:
        if not wanted or row.name in wanted:
            yield row.name, f"{row.words}{PAPER_EXACT.get(row.name, '')}", candidates_of(row)
    for name in wanted:
        if match := re.fullmatch(r"(open|ring)-(\d+)x(\d+)", name):
            make = {"open": open_grid, "ring": ring}[match[1]]
            domain = read_domain(DOMAINS / "grid" / "domain.pddl")
            text = problem_text(scenario(name, make(int(match[2]), int(match[3]))), "grid")
            yield name, "-", all_pairs(domain, [parse_problem(Source(name, text), domain)])


def bound_of(built: Built, method: str) -> int:
    if method in ("alpha", "separating"):
        return int(built.figures["separating_lower_bound"])
    return built.language.guarantee.lower_bound


def show(cells: list[object] | tuple[object, ...]) -> None:
    print(
        "  ".join(
            f"{c:>{w},}" if isinstance(c, int) else f"{c!s:>{w}}"
            for c, w in zip(cells, WIDTHS, strict=False)
        )
    )
    sys.stdout.flush()


if __name__ == "__main__":
    sys.exit(main())
