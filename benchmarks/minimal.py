"""The least number of words for the rows of Table 1, with proof.

    python benchmarks/minimal.py [ROW ..] [--time-limit SECONDS]

Columns: words and proved lower bound, words of the greedy method and of the paper's, rounds, counterexamples, clauses,
symmetries of the model, seconds.  Where the paper gives an exact value (GW1: 3) it is the one in brackets.
"""

from __future__ import annotations

import argparse
import sys
from time import perf_counter

from table1 import ROWS, candidates_of

from coordlang.build import build_language
from planners.limits import time_limit

PAPER_EXACT = {"GW1": " (3)"}


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("rows", nargs="*")
    parser.add_argument("--time-limit", type=float, help="seconds for each row")
    arguments = parser.parse_args()
    header = ("row", "words", "bound", "greedy", "paper", "rounds", "counterex.", "clauses", "symm.", "s")
    widths = (5, 6, 6, 7, 8, 7, 10, 8, 6, 7)
    print("  ".join(f"{h:>{w}}" for h, w in zip(header, widths, strict=True)))
    begin = perf_counter()
    unproved = 0
    for row in ROWS:
        if arguments.rows and row.name not in arguments.rows:
            continue
        start = perf_counter()
        candidates = candidates_of(row)
        greedy = build_language(candidates).language.guarantee.size
        with time_limit(arguments.time_limit):
            built = build_language(candidates, "minimal")
        guarantee = built.language.guarantee
        unproved += not guarantee.proved_minimal
        cells = (
            row.name,
            guarantee.size,
            guarantee.lower_bound,
            greedy,
            f"{row.words}{PAPER_EXACT.get(row.name, '')}",
            *(int(built.figures.get(k, 0)) for k in ("rounds", "counterexamples", "clauses", "symmetries")),
            f"{perf_counter() - start:.1f}",
        )
        print("  ".join(f"{c:>{w},}" if isinstance(c, int) else f"{c:>{w}}" for c, w in zip(cells, widths, strict=True)))
        sys.stdout.flush()
    print(f"together {perf_counter() - begin:.1f} s; rows without proof: {unproved}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
