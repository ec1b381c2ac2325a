# SPDX-License-Identifier: GPL-3.0-or-later
"""``coordlang report``: a language as a page that opens offline."""

from __future__ import annotations

from dataclasses import dataclass

from coordlang.commands.inputs import (
    Arguments,
    language_for,
    public,
    read_coordinates_of,
)
from coordlang.commands.records import ReportOptions
from coordlang.commands.terminal import echo, warn_of_failures
from coordlang.language.recorded import check_source
from coordlang.language.tolerance import Tolerance
from coordlang.report.page import Report, make_report
from coordlang.report.planviz import planviz
from coordlang.report.simulated import require_of
from coordlang.simulation.record import SimulationRecord, read_simulation
from planners.pddl.lifted import Domain
from planners.system.errors import Position
from planners.system.messages import visible
from planners.system.notebook import counted
from planners.system.writing import write_atomically


@dataclass(frozen=True, slots=True)
class Page:
    """A page, what the language tolerates, and the texts of what is written beside the page."""

    report: Report
    tolerance: Tolerance | None
    beside: tuple[str, ...]


@public(ReportOptions)
def report(arguments: Arguments, options: ReportOptions) -> Page:
    """Make the page of a language: its words, and sentences and plans of tasks."""
    files = arguments.read()
    points = read_coordinates_of(options.coordinates, files.problems[0])
    read, position = language_for(arguments.needed("LANGUAGE"), files, coordinates=points)
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


def show_report(found: Page, options: ReportOptions) -> None:
    """Write the page."""
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
