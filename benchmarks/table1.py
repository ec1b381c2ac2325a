"""Table 1 of the paper with the greedy method: one table, one process.

    python benchmarks/table1.py [ROW ..]

Columns: candidate tasks and reachable states (must equal the paper's), divergences, words beside
the paper's, nodes and edges of the composition walks, nodes of the verification, and seconds (from
PDDL text to verified language).
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter

from coordlang.building import build_language
from coordlang.tasks.candidates import Candidates, all_pairs, from_listed
from coordlang.tasks.task_file import read_task_file
from planners.pddl import read_domain, read_problem

GRID = Path(__file__).parent.parent / "domains" / "grid"


@dataclass(frozen=True, slots=True)
class Row:
    """A row of Table 1: the paper's tasks, states, words (greedy) and seconds."""

    name: str
    stem: str
    tasks: int
    states: int
    words: int
    seconds: float


ROWS = (
    Row("GW1", "gw1-2x2", 132, 12, 7, 0.1),
    Row("GW2", "gw2-2x3", 870, 30, 13, 0.9),
    Row("GW3", "gw3-2x4", 3080, 56, 18, 19.5),
    Row("GW4", "gw4-3x3", 5112, 72, 22, 86.2),
    Row("GWB1", "gwb1-2x4", 3080, 56, 10, 100.6),
    Row("GWB2", "gwb2-3x3", 3080, 56, 11, 92.9),
    Row("GWB3", "gwb3-3x4", 8010, 90, 12, 18890.9),
    Row("GWB4", "gwb4-2x5", 8010, 90, 13, 19557.3),
    Row("GWB5", "gwb5-3x3", 380, 56, 4, 1.4),
    Row("GWB6", "gwb6-3x4", 636, 90, 4, 11.5),
    Row("GWB7", "gwb7-3x5", 956, 132, 4, 132.5),
    Row("GWB8", "gwb8-4x4", 956, 132, 4, 140.3),
)


def candidates_of(row: Row) -> Candidates:
    """The candidate tasks of a row, from its files."""
    domain = read_domain(GRID / "domain.pddl")
    problem = read_problem(GRID / f"{row.stem}.pddl", domain)
    tasks = GRID / f"{row.stem}.tasks.json"
    if tasks.exists():
        return from_listed(domain, [problem], read_task_file(tasks))
    return all_pairs(domain, [problem])


def main(wanted: list[str]) -> int:
    header = (
        "row",
        "tasks",
        "states",
        "diverg.",
        "words",
        "paper",
        "walk nodes",
        "walk edges",
        "verify",
        "s",
        "paper s",
    )
    widths = (5, 6, 6, 8, 5, 5, 10, 10, 8, 6, 8)
    print("  ".join(f"{h:>{w}}" for h, w in zip(header, widths, strict=True)))
    wrong = 0
    begin = perf_counter()
    for row in ROWS:
        if wanted and row.name not in wanted:
            continue
        start = perf_counter()
        candidates = candidates_of(row)
        built = build_language(candidates, "greedy")
        seconds = perf_counter() - start
        if (candidates.count, candidates.states, built.verdict.holds) != (
            row.tasks,
            row.states,
            True,
        ):
            wrong += 1
        cells = (
            row.name,
            candidates.count,
            candidates.states,
            len(built.first_differences.divergences),
            built.language.guarantee.size,
            row.words,
            built.first_differences.nodes,
            built.first_differences.edges,
            built.verdict.nodes,
            f"{seconds:.2f}",
            row.seconds,
        )
        print(
            "  ".join(
                f"{c:>{w},}" if isinstance(c, int) else f"{c:>{w}}"
                for c, w in zip(cells, widths, strict=True)
            )
        )
    print(
        f"together {perf_counter() - begin:.2f} s; rows that differ from the paper in tasks or "
        f"states: {wrong}"
    )
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
