# SPDX-License-Identifier: GPL-3.0-or-later
"""``coordlang ground``: lifted language and problem -> language file."""

from __future__ import annotations

import click

import coordlang
from coordlang.commands.failure import UNPROVED
from coordlang.commands.files import FILE, PlanningFiles, beside, check_outputs, planning_files
from coordlang.commands.shared_options import ModelKeywords, kept_plans, limits, model_options
from coordlang.commands.terminal import echo, working
from planners.system.notebook import counted


@click.command(name="ground")
@click.argument("lifted", type=FILE)
@planning_files("DOMAIN PROBLEM", most=1)
@click.option(
    "--tasks",
    type=FILE,
    metavar="all|FILE|own",
    default="all",
    show_default=True,
    help="Candidate tasks: every pair of reachable states, a task file, or the problem's own task.",
)
@click.option("--unverified", is_flag=True, help="Do not verify it here; the file says so.")
@click.option(
    "--coordinates",
    type=FILE,
    metavar="FILE",
    help="Where places lie (default: coordinates.json beside PROBLEM, else what names say).",
)
@click.option("--jobs", type=int, metavar="N", help="Processes that verify (default: the cores).")
@click.option(
    "-o",
    "--output",
    required=True,
    type=FILE,
    metavar="LANGUAGE",
    help="The language file; .json or .json.gz, - for stdout.",
)
@model_options
@kept_plans
@limits
def command(
    lifted: str,
    pddl: PlanningFiles,
    tasks: str,
    unverified: bool,
    coordinates: str | None,
    jobs: int | None,
    output: str,
    model: ModelKeywords,
) -> int:
    """Write the language of one problem, an ordinary language file, from LIFTED.

    Exit 0: written, and verified by definition unless --unverified.  1: refuted for this problem;
    nothing is written.  3: written, but not verified, for the memory did not suffice.
    """
    from coordlang.language.file import to_bytes
    from planners.system.limits import stop_clock

    listed = tasks if tasks not in ("all", "own") else None
    places = [coordinates] if coordinates else map(beside, pddl.problems)
    check_outputs([("-o", output)], [lifted, *pddl.paths, listed, *places])
    with working("finding all optimal plans") as progress:
        language = coordlang.ground(
            lifted,
            *pddl.files,
            factored=pddl.factored,
            tasks=None if tasks == "own" else tasks,
            verified=not unverified,
            coordinates=coordinates,
            progress=progress,
            jobs=jobs,
            **model,
        )
    stop_clock()  # the work is done; from here on it is saved
    if output == "-":
        echo(to_bytes(language).decode(), nl=False)
    else:
        language.save(output)
    size = counted(len(language.words), "word")
    count = language.provenance.tasks["count"]
    tasks_text = f" for {counted(count, 'task')}" if count else ""
    echo(f"{size} ({language.guarantee.method}){tasks_text}", err=True)
    return 0 if count or unverified else UNPROVED
