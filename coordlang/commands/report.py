# SPDX-License-Identifier: GPL-3.0-or-later
"""``coordlang report``: a language as a page that opens offline."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from coordlang.commands.files import (
    FILE,
    PlanningFiles,
    check_outputs,
    language_argument,
    planning_files,
)
from coordlang.commands.shared_options import ModelKeywords, kept_plans, limits, model_options
from coordlang.commands.terminal import echo, warn_of_failures, working
from planners.system.messages import visible
from planners.system.notebook import counted

if TYPE_CHECKING:
    from coordlang.simulation.record import SimulationRecord
    from coordlang.sites.coordinates import Point
    from planners.pddl.lifted import Domain


@click.command(name="report")
@language_argument
@planning_files("DOMAIN PROBLEMS...")
@click.option(
    "-o", "--output", required=True, type=FILE, metavar="PAGE", help="The HTML file; - for stdout."
)
@click.option(
    "--tasks-shown",
    type=click.IntRange(1, 500),
    default=30,
    show_default=True,
    metavar="N",
    help="Show at most this many tasks: those of PROBLEM.., then candidate tasks, drawn.",
)
@click.option(
    "--coordinates",
    type=FILE,
    metavar="FILE",
    help="Where the places are drawn (default: coordinates.json beside the "
    "first PROBLEM, else by their names, else laid out).",
)
@click.option(
    "--run",
    "run_file",
    type=FILE,
    metavar="RUN.json",
    help="Also play these runs of `coordlang simulate -o RUN.json`.",
)
@click.option(
    "--planviz",
    "with_planviz",
    is_flag=True,
    help="Also write a plan of the first task for PlanViz, and its map, beside PAGE.",
)
@click.option("--seed", type=int, default=0, show_default=True, help="Draws the tasks.")
@model_options
@kept_plans
@limits
def command(
    language: str,
    pddl: PlanningFiles,
    output: str,
    tasks_shown: int,
    coordinates: str | None,
    run_file: str | None,
    with_planviz: bool,
    seed: int,
    model: ModelKeywords,
) -> None:
    """Write a self-contained HTML page that shows LANGUAGE.

    It has the words, and the sentences and plans in the tasks of PROBLEM.. and in some of the
    candidate tasks.
    """
    from coordlang.commands.inputs import read_planning
    from coordlang.commands.language_inputs import language_for
    from coordlang.commands.options import Source
    from coordlang.language.recorded import check_source
    from coordlang.report.page import make_report
    from coordlang.report.planviz import planviz
    from planners.system.options import record_from
    from planners.system.writing import write_atomically

    places = coordinates if coordinates is not None else str(_beside(pddl))
    inputs = [language, *pddl.paths, places, *([run_file] if run_file else [])]
    beside = _planviz_paths(output) if with_planviz else []
    check_outputs([("-o", output), *(("--planviz", path) for path in beside)], inputs)
    files = read_planning(
        pddl.domain,
        pddl.problems,
        record_from(Source, {**model, "factored": pddl.factored}, "report"),
    )
    known = _coordinates(coordinates, pddl)
    read, position = language_for(language, files, coordinates=known)
    check_source(read, files.domain, files.problems, position)
    simulated = _simulated(run_file, files.domain)
    with working("drawing the page"):
        report = make_report(
            read,
            files.domain,
            files.problems,
            tasks_shown=tasks_shown,
            seed=seed,
            options=files.options_of(read),
            coordinates=known,
            position=position,
            simulated=simulated,
        )
        shown_plan = planviz(report.first, known) if with_planviz else None
    if output == "-":
        echo(report.html.decode(), nl=False)
    else:
        write_atomically(output, report.html)
    if shown_plan is not None:
        for path, text in zip(beside, (shown_plan.plan, shown_plan.map), strict=True):
            write_atomically(path, text.encode())
    shown = f"{counted(report.tasks, 'task')} of {report.candidates:,}"
    place = "stdout" if output == "-" else visible(output)
    warn_of_failures(read.tolerance)
    echo(f"{shown}, {len(report.html):,} bytes, written to {place}", err=output == "-")


def _simulated(path: str | None, domain: Domain) -> SimulationRecord | None:
    """The runs that the page is to play."""
    from coordlang.report.simulated import require_of
    from coordlang.simulation.record import read_simulation
    from planners.system.errors import Position

    if path is None:
        return None
    record = read_simulation(path)
    require_of(record, domain, Position(path))
    return record


def _planviz_paths(output: str) -> list[str]:
    """Where the plan and the map for PlanViz are written: beside the page, under its name."""
    if output == "-":
        raise click.UsageError("--planviz writes files beside PAGE: give -o a file")
    return [str(Path(output).with_suffix(f".planviz.{kind}")) for kind in ("json", "map")]


def _beside(pddl: PlanningFiles) -> Path:
    folder = Path(pddl.factored) if pddl.factored else Path(pddl.files[1]).parent
    return folder / "coordinates.json"


def _coordinates(given: str | None, pddl: PlanningFiles) -> dict[str, Point] | None:
    from coordlang.sites.coordinates import read_coordinates

    if given is not None:
        return read_coordinates(given)
    beside = _beside(pddl)
    return read_coordinates(beside) if beside.is_file() else None
