"""Three robots: one language for all of them, beside one two-robot language for each pair.

    python benchmarks/pairs.py [FOLDER/PROBLEM ..]

"FOLDER/PROBLEM all": every pair of states as tasks, otherwise the problem's own.  Columns: tasks,
words of a smallest language for all robots and of one for each pair, nodes of the composition walks
and seconds of both, and whether robots that say a sentence for each pair are safe: checked for the
words of all pairs together.
"""

from __future__ import annotations

import sys
from pathlib import Path
from time import perf_counter

import numpy as np

from coordlang.building import build_language
from coordlang.language.partition import Partition
from coordlang.tasks.candidates import Candidates, all_pairs, from_problems
from coordlang.verification.by_definition import verify
from coordlang.vocabulary.pairwise import joint_partition, pair_languages
from planners.limits import time_limit
from planners.loading import ModelOptions
from planners.pddl import read_domain, read_problem
from planners.tables import unique_rows

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
    """Checked by definition, for all robots."""
    rows, place = unique_rows(candidates.rows)
    ordered = np.zeros(len(rows), np.int64)
    ordered[place[list(words)]] = list(words.values())
    table = Partition(tuple(map(str, range(max(words.values()) + 1))), rows, ordered, 0)
    return verify(table, candidates.spaces).holds


def main(wanted: list[str]) -> int:
    header = (
        "problem",
        "tasks",
        "words",
        "pairs",
        "walk nodes",
        "of pairs",
        "s",
        "s pairs",
        "pairs are safe",
    )
    widths = (24, 6, 5, 10, 11, 10, 6, 7, 14)
    print("  ".join(f"{h:>{w}}" for h, w in zip(header, widths, strict=True)))
    for name in wanted or PROBLEMS:
        candidates = candidates_of(name)
        start = perf_counter()
        with time_limit(120):
            joint = build_language(candidates, "minimal")
        middle = perf_counter()
        languages = pair_languages(candidates.spaces)
        guarantee = joint.language.guarantee
        cells = (
            name,
            candidates.count,
            guarantee.size
            if guarantee.proved_minimal
            else f"{guarantee.lower_bound}..{guarantee.size}",
            " ".join(str(language.size) for language in languages),
            joint.first_differences.nodes,
            sum(language.nodes for language in languages),
            f"{middle - start:.1f}",
            f"{perf_counter() - middle:.1f}",
            "yes" if is_language(candidates, joint_partition(languages)) else "no",
        )
        print(
            "  ".join(
                f"{c:>{w},}" if isinstance(c, int) else f"{c:>{w}}"
                for c, w in zip(cells, widths, strict=True)
            )
        )
        sys.stdout.flush()
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
