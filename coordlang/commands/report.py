# SPDX-License-Identifier: GPL-3.0-or-later
"""``coordlang report``: a language as a page that opens offline."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from coordlang.commands.command import command_of
from coordlang.commands.files import OutputFile
from coordlang.commands.inputs import language_for, read_coordinates_of, read_planning
from coordlang.commands.keywords import with_options
from coordlang.commands.options import (
    NO_SLACK,
    DomainSource,
    LanguageSource,
    ProblemSource,
    Source,
    coordinates_option,
    output_option,
)
from coordlang.commands.terminal import echo, warn_of_failures
from coordlang.language.recorded import check_source
from coordlang.language.tolerance import Tolerance
from coordlang.report.page import Report, make_report
from coordlang.report.planviz import planviz
from coordlang.report.simulated import require_of
from coordlang.simulation.record import SimulationRecord, read_simulation
from planners.pddl.lifted import Domain
from planners.system.errors import Position, UsageError
from planners.system.messages import visible
from planners.system.notebook import counted
from planners.system.options import group, option
from planners.system.writing import write_atomically


@dataclass(frozen=True, slots=True)
class Page:
    """A page, what the language tolerates, and the texts of what is written beside the page."""

    report: Report
    tolerance: Tolerance | None
    beside: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class ReportOptions:
    """What `report` can be asked for."""

    output: str = output_option("The HTML file; - for stdout.", "PAGE", required=True)
    tasks_shown: int = option(
        30,
        "Show at most this many tasks: those of PROBLEM.., then candidate tasks, drawn.",
        "N",
        least=1,
    )
    coordinates: str | None = coordinates_option()
    run: str | None = option(
        None, "Also play these runs of `coordlang simulate -o RUN.json`.", "RUN.json"
    )
    planviz: bool = option(
        False, "Also write a plan of the first task for PlanViz, and its map, beside PAGE."
    )
    seed: int = option(0, "Draws the tasks.")
    source: Source = group(Source, without=NO_SLACK)

    def __post_init__(self) -> None:
        if self.tasks_shown > 500:
            raise UsageError(
                f"--tasks-shown {self.tasks_shown}: a page shows at most 500 tasks",
                remedy="Make a page for each of several problems.",
            )
        if self.planviz and self.output == "-":
            raise UsageError("--planviz writes files beside PAGE", remedy="Give -o a file.")

    def outputs(self) -> list[OutputFile]:
        """Beside the page and under its name: a plan for PlanViz, and its map."""
        kinds = ("json", "map") if self.planviz else ()
        paths = (str(Path(self.output).with_suffix(f".planviz.{kind}")) for kind in kinds)
        return [OutputFile("--planviz", path) for path in paths]


@with_options(ReportOptions)
def report(
    language: LanguageSource,
    domain: DomainSource | None = None,
    *problems: ProblemSource,
    options: ReportOptions,
) -> Page:
    """Make the page of a language: its words, and sentences and plans of tasks."""
    files = read_planning(domain, problems, options.source)
    points = read_coordinates_of(options.coordinates, files.problems[0])
    read, position = language_for(language, files, coordinates=points)
    check_source(read, files.domain, files.problems, position)
    page = make_report(
        read,
        files.domain,
        files.problems,
        tasks_shown=options.tasks_shown,
        seed=options.seed,
        options=files.options_of(read),
        coordinates=points,
        position=position,
        simulated=_simulated(options.run, files.domain),
    )
    if not options.planviz:
        return Page(page, read.tolerance, ())
    shown = planviz(page.first, points)
    return Page(page, read.tolerance, (shown.plan, shown.map))


def _simulated(path: str | None, domain: Domain) -> SimulationRecord | None:
    """The runs that the page is to play."""
    if path is None:
        return None
    record = read_simulation(path)
    require_of(record, domain, Position(path))
    return record


@command_of(report, "LANGUAGE DOMAIN PROBLEMS...", doing="drawing the page")
def command(found: Page, options: ReportOptions) -> None:
    """Write a self-contained HTML page that shows LANGUAGE.

    It has the words, and the sentences and plans in the tasks of PROBLEM.. and in some of the
    candidate tasks.
    """
    page = found.report
    to_stdout = options.output == "-"
    if to_stdout:
        echo(page.html.decode(), nl=False)
    else:
        write_atomically(options.output, page.html)
    for file, text in zip(options.outputs(), found.beside, strict=True):
        write_atomically(file.path or "", text.encode())
    warn_of_failures(found.tolerance)
    shown = f"{counted(page.tasks, 'task')} of {page.candidates:,}"
    place = "stdout" if to_stdout else visible(options.output)
    echo(f"{shown}, {len(page.html):,} bytes, written to {place}", err=to_stdout)
