# SPDX-License-Identifier: GPL-3.0-or-later
"""Three robots: one language for all of them, beside one two-robot language for each pair.

    python benchmarks/pairs.py [FOLDER/PROBLEM ..]

"FOLDER/PROBLEM all": every pair of states as tasks, otherwise the problem's own.  Columns: tasks,
words of a smallest language for all robots and of one for each pair, nodes of plan spaces
and seconds of both, and whether robots that say a sentence for each pair are safe: checked for the
words of all pairs together.
"""

from __future__ import annotations

import sys
from pathlib import Path
from time import perf_counter

from printed_table import PrintedTable

from coordlang.building import build_language
from coordlang.language.partition import Partition
from coordlang.tasks.candidates import Candidates, all_pairs, from_problems
from coordlang.verification.by_definition import verify
from coordlang.vocabulary.pairwise import joint_partition, pair_languages
from planners.limits import time_limit
from planners.loading import ModelOptions
from planners.pddl import read_domain, read_problem

DOMAINS = Path(__file__).parent.parent / "domains"
PROBLEMS = (
    "flags/parade",
    "flags/parade all",
    "tray/three-robots",
    "push-box/three-robots",
    "charger/three-robots",
    "grid/three-robots-3x3",
)


def candidates_of(name: str) -> Candidates:
    """The candidate tasks of ``FOLDER/PROBLEM`` or ``FOLDER/PROBLEM all``."""
    path, _, every = name.partition(" ")
    folder, _, stem = path.partition("/")
    domain = read_domain(DOMAINS / folder / "domain.pddl")
    problem = read_problem(DOMAINS / folder / f"{stem}.pddl", domain)
    return (all_pairs if every else from_problems)(domain, [problem], ModelOptions())


def is_language(candidates: Candidates, words: dict[int, int]) -> bool:
    """Verify a partition of state numbers by definition, for all robots."""
    return verify(Partition.of_states(candidates.rows, words), candidates.spaces).holds


def print_problem(name: str, table: PrintedTable) -> None:
    """Build the language for all robots and one for each pair."""
    candidates = candidates_of(name)
    start = perf_counter()
    with time_limit(120):
        joint = build_language(candidates, "minimal")
    middle = perf_counter()
    languages = pair_languages(candidates.spaces)
    end = perf_counter()
    guarantee = joint.language.guarantee
    size: object = guarantee.size
    if not guarantee.proved_minimal:
        size = f"{guarantee.lower_bound}..{guarantee.size}"
    table.print(
        name,
        candidates.count,
        size,
        " ".join(str(language.size) for language in languages),
        joint.first_differences.nodes,
        sum(language.nodes for language in languages),
        f"{middle - start:.1f}",
        f"{end - middle:.1f}",
        "yes" if is_language(candidates, joint_partition(languages)) else "no",
    )


def main(wanted: list[str]) -> None:
    """Print the table."""
    table = PrintedTable(
        ("problem", 24),
        ("tasks", 6),
        ("words", 5),
        ("pairs", 10),
        ("plan nodes", 11),
        ("of pairs", 10),
        ("s", 6),
        ("s pairs", 7),
        ("pairs are safe", 14),
    )
    for name in wanted or PROBLEMS:
        print_problem(name, table)


if __name__ == "__main__":
    main(sys.argv[1:])
