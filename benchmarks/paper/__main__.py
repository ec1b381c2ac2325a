# SPDX-License-Identifier: GPL-3.0-or-later
"""The paper's tables and figures, run again, with the paper's own values beside them.

    python -m benchmarks.paper NAME.. [--results DIR] [--page FILE] [--jobs N] [--limit SECONDS]
                               [--seed N] [--samples N] [--quick]

NAME is an experiment (``-h`` lists them) or ``all``.  Results that DIR has are not computed again,
so that a run that was stopped goes on, and the page of a finished one is rendered anew; remove a
file of DIR to measure again.  The page shows all experiments that have results in DIR.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from benchmarks.paper import (
    communication,
    delays,
    flexibility,
    game,
    navigation,
    planning_cost,
    scenario,
    silence,
    simulation,
    table1,
)
from benchmarks.paper.page import write_page
from benchmarks.paper.recipe import Settings
from benchmarks.paper.runner import run

#: All experiments, in the order of the page.
RECIPES = [
    module.RECIPE
    for module in (
        table1,
        communication,
        flexibility,
        planning_cost,
        navigation,
        game,
        delays,
        scenario,
        silence,
        simulation,
    )
]


def main(arguments: list[str] | None = None) -> None:
    """Run what the arguments say, and write the page."""
    names = [recipe.name for recipe in RECIPES]
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("names", nargs="+", choices=[*names, "all"], metavar="NAME",
                        help=f"of {', '.join(names)}, all")  # fmt: skip
    parser.add_argument("--results", type=Path, metavar="DIR", help="(evaluation)")
    parser.add_argument("--page", type=Path, metavar="FILE", help="(evaluation.md in DIR)")
    parser.add_argument("--jobs", type=int, default=1, help="processes (1)")
    parser.add_argument("--limit", type=float, default=180, help="seconds of a unit (180)")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--samples", type=int, help="random runs (100; with --quick 10)")
    parser.add_argument("--quick", action="store_true", help="the smallest rows and sizes only")
    given = parser.parse_args(arguments)
    samples = given.samples or (10 if given.quick else 100)
    settings = Settings(given.seed, samples, given.quick, given.limit)
    folder = given.results or Path("evaluation/quick" if given.quick else "evaluation")
    folder.mkdir(parents=True, exist_ok=True)
    for recipe in RECIPES:
        if {recipe.name, "all"} & {*given.names}:
            run(recipe, settings, folder, given.jobs)
    page = given.page or folder / "evaluation.md"
    page.parent.mkdir(parents=True, exist_ok=True)
    write_page(RECIPES, settings, folder, page)
    print(f"written: {page}")


if __name__ == "__main__":
    main()
