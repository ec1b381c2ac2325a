# SPDX-License-Identifier: GPL-3.0-or-later
"""What slack costs in words and gives in plans, on small rows.

    python benchmarks/slack.py [ROW ..] [--limit SECONDS]

For slack 0, 1 and 2 one line for words of states, and one for words that see what is left of the
slack (--words-see-slack).  Columns: tasks; how many of them have inseparable plans; plans of a task
on average; how often robots fail without a word (mean over the tasks, in percent); the fewest words
found by ``--method minimal`` within ``--limit`` seconds (default 60) with their proved lower bound;
plans that a sentence leaves open in expectation (mean over the tasks); seconds.
"""

from __future__ import annotations

import argparse
from time import perf_counter

import numpy as np
from printed_table import PrintedTable

from coordlang.building import build_language
from coordlang.language.flexibility import flexibility
from coordlang.language.partition import Partition
from coordlang.required.miscoordination import Inseparable
from coordlang.shipped import shipped_domains
from coordlang.tasks.candidates import Candidates, all_pairs, from_problems
from coordlang.tolerance.failure import failure_probability
from coordlang.verification.by_definition import verify
from planners.limits import time_limit
from planners.loading import ModelOptions
from planners.pddl import read_domain, read_problem
from planners.search.plans import counts

#: Folder, problem, and whether all pairs of its states are the tasks.
ROWS = {
    "three-cells": ("three-cells", "problem", True),
    "GW1": ("grid", "gw1-2x2", True),
    "GW2": ("grid", "gw2-2x3", True),
    "corners-3x3": ("grid", "corners-3x3", False),
    "corners-4x4": ("grid", "corners-4x4", False),
    "corridor": ("corridor", "problem", False),
    "handover": ("handover", "exchange", False),
}


def candidates_of(row: str, slack: int, sees: bool) -> Candidates:
    """The tasks of a row."""
    place, stem, every = ROWS[row]
    domain = read_domain(shipped_domains() / place / "domain.pddl")
    problem = read_problem(shipped_domains() / place / f"{stem}.pddl", domain)
    make = all_pairs if every else from_problems
    return make(domain, [problem], ModelOptions(slack=slack, sees_slack=sees))


def inseparable(found: Candidates) -> int:
    """How many tasks have plans that no words tell apart."""
    number = 0
    for space in found.spaces:
        states = np.unique(space.state).tolist()
        apart = Partition.of_states(found.rows, {state: n for n, state in enumerate(states)})
        for task in range(len(space.starts)):
            one = space.with_tasks(space.starts[[task]], space.second[[task]])
            number += not verify(apart, [one]).holds
    return number


def main() -> None:
    """Print what the arguments say."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("rows", nargs="*", metavar="ROW")
    parser.add_argument("--limit", type=float, default=60, metavar="SECONDS")
    given = parser.parse_args()
    table = PrintedTable(
        *(("row", -11), ("slack", 5), ("words", -6), ("tasks", 6), ("insep.", 6), ("plans", 10)),
        *(("fail %", 6), ("words", 5), ("bound", 5), ("open", 8), ("s", 6)),
    )
    for row in given.rows or ROWS:
        for slack, sees in [(0, False), (1, False), (1, True), (2, False), (2, True)]:
            found = candidates_of(row, slack, sees)
            plans = [counts(space)[n] for space in found.spaces for n in space.starts.tolist()]
            failing = failure_probability(found.spaces, [None for _ in found.spaces])
            head = [row, slack, "seeing" if sees else "states", found.count]
            head += [inseparable(found), f"{sum(plans) / len(plans):,.1f}"]
            head += [f"{100 * float(failing.mean):.2f}"]
            begin = perf_counter()
            try:
                with time_limit(given.limit):
                    built = build_language(found, "minimal")
            except Inseparable:
                table.print(*head, None, None, None, f"{perf_counter() - begin:.1f}")
                continue
            seconds = perf_counter() - begin
            partition = built.language.partition(found.model)
            words = [partition.word_of(space.rows)[space.state] for space in found.spaces]
            guarantee = built.language.guarantee
            left = flexibility(found.spaces, words).value
            table.print(
                *head, guarantee.size, guarantee.lower_bound, f"{left:.2f}", f"{seconds:.1f}"
            )


if __name__ == "__main__":
    main()
