# SPDX-License-Identifier: GPL-3.0-or-later
"""Table 1 of the paper with the greedy method: one table, one process.

    python benchmarks/table1.py [ROW ..]

Columns: candidate tasks and reachable states (must equal the paper's), divergences, words beside
the paper's, nodes and edges of the plan spaces, nodes of the verification, and seconds (from
PDDL text to verified language) beside the paper's.  Exit code 1 if tasks or states differ.
"""

from __future__ import annotations

import sys
from time import perf_counter

from printed_table import PrintedTable

from coordlang.building import build_language
from coordlang.evaluation.material.paper import TABLE_1
from coordlang.evaluation.material.suite import ROWS, World, find_domains


def main(wanted: list[str]) -> int:
    """Print the table; 1 if a row differs from the paper's in tasks or states."""
    table = PrintedTable(
        ("row", 5),
        ("tasks", 6),
        ("states", 6),
        ("diverg.", 8),
        ("words", 5),
        ("paper", 5),
        ("plan nodes", 10),
        ("walk edges", 10),
        ("verify", 8),
        ("s", 6),
        ("paper s", 8),
    )
    begin = perf_counter()
    wrong = sum(not print_row(row, table) for row in ROWS if not wanted or row.name in wanted)
    seconds = perf_counter() - begin
    print(f"{seconds:.2f} s in total; rows that differ from the paper in tasks or states: {wrong}")
    return 1 if wrong else 0


def print_row(row: World, table: PrintedTable) -> bool:
    """Build the language of a row; whether tasks and states are the paper's, and it is verified."""
    paper = TABLE_1[row.name]
    start = perf_counter()
    candidates = row.candidates(find_domains(None))
    built = build_language(candidates, "greedy")
    seconds = perf_counter() - start
    table.print(
        row.name,
        candidates.count,
        candidates.states,
        len(built.first_differences.divergences),
        built.language.guarantee.size,
        paper.words,
        built.first_differences.nodes,
        built.first_differences.edges,
        built.verdict.nodes,
        f"{seconds:.2f}",
        paper.seconds,
    )
    same = (candidates.count, candidates.states) == (paper.tasks, paper.states)
    return same and built.verdict.holds


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
