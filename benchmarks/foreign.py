# SPDX-License-Identifier: GPL-3.0-or-later
"""PDDL that others wrote (../shared/data): reference numbers, and a language for each domain.

    python benchmarks/foreign.py [--time-limit S] [ROW ..]
    python benchmarks/foreign.py --numbers [--oracles] [ROW ..]
    python benchmarks/foreign.py --refused

The first prints languages over varied tasks, and what their sentences determine. With
``--numbers``: states, makespan and plans beside the reference; with ``--oracles`` K* counts the
plans, too (it has to be installed: the extra ``oracles``). With ``--refused``: which files are
refused, and with which message. Every number is the work of a process of its own, whose seconds
(whole process) and peak memory are shown.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from dataclasses import replace

from foreign_numbers import k_star, print_numbers
from foreign_rows import BY_NAME, LANGUAGE_BY_NAME, LANGUAGES, ROWS, SHARED, Language, load
from plan_features import agreement
from printed_table import PrintedTable
from processes import coordlang, run_python

COLUMNS = (
    ("language", -13),
    ("tasks", -6),
    ("requiring", -9),
    ("states", -7),
    ("greedy", -6),
    ("minimal", -12),
    ("cost", -8),
    ("told", -8),
    ("left", -8),
    ("process", -14),
    ("words say", -20),
)


def print_languages(chosen: Sequence[Language], seconds: float) -> int:
    """Print a line for each language; how many failed, or do not determine what they should."""
    wrong: list[str] = []
    table = PrintedTable(*COLUMNS)
    for language in chosen:
        done = run_python((__file__, "--one", language.name, "--time-limit", str(seconds)))
        figures = done.data
        if done.code != 0:
            wrong.append(f"{language.name}: {done.errors.strip()[-300:]}")
            continue
        told, different = figures["told"], figures["different"]
        if told < language.agree * different or not different:
            wrong.append(f"{language.name}: determined in {told} of {different} tasks")
        bound = "proved" if figures["proved"] else f"at least {figures['bound']}"
        options = language.cost.removeprefix("makespan").lstrip("+") or "-"
        table.print(
            language.name,
            figures["tasks"],
            figures["requiring"],
            figures["states"],
            figures["greedy"],
            f"{figures['words']} {bound}",
            options + (", remembered" if language.remember_actions else ""),
            f"{told}/{different}",
            f"{figures['left']}/{figures['open']}",
            done.cost,
            language.means,
        )
    print(f"\n{len(wrong)} wrong", *wrong, sep="\n  ")
    return len(wrong)


def build(language: Language, seconds: float) -> dict[str, object]:
    """Build and verify the two languages of a row, and see what the smaller one determines."""
    from coordlang.building import build_language
    from coordlang.tasks.candidates import from_listed
    from coordlang.tasks.patterns import varied_tasks
    from planners.limits import time_limit

    row = BY_NAME[language.row]
    loaded = load(row, language.cost)
    tasks = varied_tasks(loaded, language.starts, language.goals)
    options = replace(loaded.options, remember_actions=language.remember_actions)
    candidates = from_listed(loaded.domain, loaded.problems, tasks, options)
    first = build_language(candidates)
    with time_limit(seconds):
        built = build_language(candidates, "minimal")
    guarantee = built.language.guarantee
    return {
        "tasks": candidates.count,
        "requiring": built.first_differences.requiring,
        "states": candidates.states,
        "greedy": first.language.guarantee.size,
        "words": guarantee.size,
        "bound": guarantee.lower_bound,
        "proved": guarantee.proved_minimal,
        "verified": built.verdict.holds,
        **agreement(built.language, candidates, language.told, language.left),
    }


def print_refused() -> int:
    """Run everything in ``refuse/``; how many runs ended otherwise than expected.

    ``numeric`` holds no numeric feature (`tests/foreign` goes through its words), so it is read,
    told who the robots are.
    """
    place = SHARED / "refuse"
    wrong = 0
    for folder in sorted(path for path in place.iterdir() if path.is_dir()):
        domain = next(iter(sorted(folder.glob("domain*.pddl"))))
        problem = next(iter(sorted(set(folder.glob("*.pddl")) - {domain})), domain)
        robots = ("--robots", "driver,truck") if folder.name == "numeric" else ()
        done = coordlang("plans", str(domain), str(problem), "--count", "--json", *robots)
        message = (
            done.errors.strip().splitlines()[0].replace(str(place) + "/", "")
            if done.errors.strip()
            else done.data
        )
        print(f"{folder.name:<16} exit {done.code}  {message}")
        wrong += done.code != (0 if robots else 34)
    return wrong


def main() -> int:
    """Print what the arguments say; 1 if something is wrong."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("rows", nargs="*", metavar="ROW", help=f"of {', '.join(BY_NAME)}")
    parser.add_argument("--numbers", action="store_true", help="the reference table again")
    parser.add_argument(
        "--oracles", action="store_true", help="with --numbers: K* counts the plans, too"
    )
    parser.add_argument("--refused", action="store_true", help="what is refused")
    parser.add_argument("--k-star", metavar="ROW", help=argparse.SUPPRESS)
    parser.add_argument("--one", metavar="LANGUAGE", help=argparse.SUPPRESS)
    parser.add_argument(
        "--time-limit", type=float, default=120, help="seconds for each minimal language (120)"
    )
    parser.add_argument("--cost", default="makespan", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if unknown := set(given.rows) - {*BY_NAME, *LANGUAGE_BY_NAME}:
        parser.error(f"no such row: {', '.join(sorted(unknown))}")
    if not SHARED.is_dir():
        parser.error(f"the inputs that others wrote are not here: {SHARED}")
    if given.k_star:
        print(json.dumps(k_star(BY_NAME[given.k_star], given.cost)))
        return 0
    if given.one:
        print(json.dumps(build(LANGUAGE_BY_NAME[given.one], given.time_limit)))
        return 0
    return int(print_chosen(given) > 0)


def print_chosen(given: argparse.Namespace) -> int:
    """Print the table that is wanted; the number of lines that are wrong."""
    names = set(given.rows)
    if given.numbers:
        rows = [row for row in ROWS if not names or row.name in names]
        return print_numbers(rows, oracles=given.oracles)
    if given.refused:
        return print_refused()
    chosen = [one for one in LANGUAGES if not names or {one.name, one.row} & names]
    return print_languages(chosen, given.time_limit)


if __name__ == "__main__":
    sys.exit(main())
