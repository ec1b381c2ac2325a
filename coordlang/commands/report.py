# SPDX-License-Identifier: GPL-3.0-or-later
"""``coordlang report``: a language as a page that opens offline."""

from __future__ import annotations

from coordlang.commands.inputs import Arguments, coordinates_of, language_for, public
from coordlang.commands.records import ReportOptions
from coordlang.commands.terminal import warn_of_failures, write
from coordlang.report.page import Report, make_report
from planners.system.messages import counted, visible


@public(ReportOptions)
def report(arguments: Arguments, options: ReportOptions) -> Report:
    """Make the page of a language: its words, and sentences and plans of tasks."""
    files = arguments.read()
    points = coordinates_of(options.coordinates, files.problems[0])
    read = language_for(arguments.needed("LANGUAGE"), files, coordinates=points)
    return make_report(
        read,
        files.domain,
        files.problems,
        seed=options.seed,
        options=files.options_of(read),
        coordinates=points,
    )


def show_report(page: Report, options: ReportOptions) -> None:
    """Write the page."""
    output, others = options.output, page.selection.others
    candidates = int(page.language.provenance.tasks.get("count", 0))
    shown = f"{counted(len(page.selection.tasks) - others, 'task')} of {candidates:,}"
    if others:
        shown += f" and {counted(others, 'other')}"
    place = "stdout" if output == "-" else visible(output)
    write(page.html, output, f"{shown}, {len(page.html):,} bytes, written to {place}")
    warn_of_failures(page.language.tolerance)
