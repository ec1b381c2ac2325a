# SPDX-License-Identifier: GPL-3.0-or-later
"""``coordlang evaluate``: the paper's tables and figures, run again."""

from __future__ import annotations

import json
import os
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING

import click

from coordlang.cli.echo import echo
from coordlang.cli.exit_codes import UNPROVED
from coordlang.cli.files import FOLDER, check_outputs
from coordlang.cli.shared_options import limits, note, was_given
from coordlang.cli.terminal import bar
from planners.messages import echoed
from planners.notebook import counted

if TYPE_CHECKING:
    from coordlang.evaluation.lab.recipe import Recipe, Record, Section, Settings
    from coordlang.evaluation.lab.results import Results


@click.command(name="evaluate")
@click.argument("names", nargs=-1, required=True, metavar="NAME...")
@click.option(
    "--results",
    type=FOLDER,
    metavar="DIR",
    help="Where results are kept (default: evaluation; with --quick evaluation/quick).",
)
@click.option(
    "--page", metavar="FILE", help="The page that shows them (default: evaluation.md in DIR)."
)
@click.option("--seed", type=int, default=0, show_default=True)
@click.option(
    "--jobs",
    type=click.IntRange(min=1),
    metavar="N",
    help="Processes (default: one for each core).",
)
@click.option(
    "--scheduler",
    metavar="ADDRESS|FILE",
    help="Do the work on this running Dask cluster instead.",
)
@click.option(
    "--samples",
    type=click.IntRange(min=1),
    default=100,
    show_default=True,
    help="Random runs; a hundred times as many where intervals are wanted.",
)
@click.option("--quick", is_flag=True, help="The smallest rows and sizes only, 10 samples.")
@click.option(
    "--unit-time-limit",
    type=click.FloatRange(min=0, min_open=True),
    default=180.0,
    show_default=True,
    metavar="SECONDS",
    help="For each piece of work; then it is left out.",
)
@click.option(
    "--domains",
    type=FOLDER,
    metavar="DIR",
    help="The shipped domains (default: domains here, or those of the package).",
)
@click.option("--json", "as_json", is_flag=True, help="Print all results as one JSON object.")
@limits
def command(
    names: tuple[str, ...],
    results: str | None,
    page: str | None,
    seed: int,
    jobs: int | None,
    scheduler: str | None,
    samples: int,
    quick: bool,
    unit_time_limit: float,
    domains: str | None,
    as_json: bool,
) -> int:
    """Run experiments of the paper and set their results beside the paper's own.

    NAME is table1, communication, flexibility, planning_cost, navigation, game, delays, scenario,
    silence, simulation, or all.
    A run that was stopped or killed goes on where it was when it is started again.
    """
    from coordlang.evaluation.experiments.registry import RECIPES
    from coordlang.evaluation.lab.page import sections, write_page
    from coordlang.evaluation.lab.recipe import Settings
    from coordlang.evaluation.lab.results import Results
    from coordlang.evaluation.material.suite import find_domains

    chosen = _chosen(names)
    check_outputs([("--page", page)], [])
    if results is not None:
        check_outputs(
            [("--results", os.path.join(results, ".lock") if results else "")],
            [],
            makes_folder=True,
        )
    if quick and not was_given("samples"):
        samples = 10
    folder = Path(results or ("evaluation/quick" if quick else "evaluation"))
    cache = folder / "cache"
    settings = Settings(find_domains(domains), cache, seed, samples, quick, unit_time_limit)
    kept = Results(folder)
    begin = perf_counter()
    found = _run(chosen, settings, kept, jobs, scheduler)
    written = write_page(RECIPES, kept, Path(page) if page else folder / "evaluation.md")
    seconds = perf_counter() - begin
    if as_json:
        echo(json.dumps(_data(found, written, seconds)))
    else:
        for name, section in sections(RECIPES, found).items():
            echo(f"# {RECIPES[name].title}\n")
            echo(as_text(section))
    units = counted(sum(map(len, found.values())), "piece")
    echo(f"{units} of work in {seconds:.1f} s; results in {folder}, page {written[0]}", err=True)
    return _exit_code(found)


def _chosen(names: tuple[str, ...]) -> list[Recipe]:
    """Return the experiments of these names."""
    from coordlang.evaluation.experiments.registry import RECIPES

    for name in names:
        if name != "all" and name not in RECIPES:
            raise click.UsageError(
                f"there is no experiment {echoed(name)}; there are {', '.join(RECIPES)}, all"
            )
    return [recipe for name, recipe in RECIPES.items() if name in names or "all" in names]


def _exit_code(found: dict[str, list[Record]]) -> int:
    """Return the exit code, and name on stderr the units that met their limit."""
    unfinished = [
        f"{name}/{record.unit.key}"
        for name, records in found.items()
        for record in records
        if record.status != "done"
    ]
    if not unfinished:
        return 0
    echo(f"coordlang: met their limit: {', '.join(unfinished)}", err=True)
    return UNPROVED


def _run(
    recipes: list[Recipe],
    settings: Settings,
    kept: Results,
    jobs: int | None,
    scheduler: str | None,
) -> dict[str, list[Record]]:
    """Run experiments with progress shown; what is done is kept when they are stopped."""
    from coordlang.api.workers import opened_runner
    from coordlang.evaluation.lab.runner import Progress, run
    from planners.errors import OutOfTime

    try:
        with opened_runner(jobs, scheduler, note=note) as runner, bar() as show:

            def report(progress: Progress) -> None:
                running = ", ".join(f"{unit.experiment}/{unit.key}" for unit in progress.running)
                show(progress.done, progress.all, f"({progress.known} known) {running}")

            return run(recipes, settings, kept, runner, report)
    except (KeyboardInterrupt, OutOfTime):
        echo("coordlang: what is done is kept; the same command goes on from there", err=True)
        raise


def _data(
    found: dict[str, list[Record]], written: tuple[Path, ...], seconds: float
) -> dict[str, object]:
    return {
        "results": {name: list(map(as_data, records)) for name, records in found.items()},
        "files": [str(path) for path in written],
        "seconds": round(seconds, 3),
    }


def as_data(record: Record) -> dict[str, object]:
    """A record as JSON data."""
    return {
        "key": record.unit.key,
        "status": record.status,
        "seconds": round(record.seconds, 3),
        "cpu": round(record.cpu, 3),
        "result": record.result,
    }


def as_text(section: Section) -> str:
    """A section for the terminal: its text and tables, and the names of its figures."""
    parts = [
        block if isinstance(block, str) else f"[figure {block.name}.svg: {block.alt}]"
        for block in section.blocks
    ]
    return "\n\n".join([*parts, *(f"- {difference}" for difference in section.differences)]) + "\n"
