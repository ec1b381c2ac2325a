# SPDX-License-Identifier: GPL-3.0-or-later
"""``coordlang inspect``: what was understood of a domain and problem."""

from __future__ import annotations

import json
import os

import click

import coordlang
from coordlang.commands.echo import echo
from coordlang.commands.files import FOLDER, PlanningFiles, check_outputs, planning_files
from coordlang.commands.shared_options import ModelKeywords, limits, model_options
from coordlang.commands.terminal import line_width, note_single_robot, working

#: The files that --write makes.
WRITTEN = "domain.pddl", "problem.pddl"


@click.command(name="inspect")
@click.option(
    "--states",
    "count_states",
    is_flag=True,
    help="Also count the reachable joint states and steps.",
)
@click.option(
    "--write",
    "folder",
    type=FOLDER,
    metavar="DIR",
    help="Also write what was read as domain.pddl and problem.pddl in this folder.",
)
@click.option("--json", "as_json", is_flag=True, help="One JSON object.")
@model_options
@planning_files("DOMAIN PROBLEM", most=1)
@limits
def command(
    count_states: bool,
    folder: str | None,
    as_json: bool,
    pddl: PlanningFiles,
    model: ModelKeywords,
) -> None:
    """Show what was understood of DOMAIN and PROBLEM: a domain that was misread shows it here.

    With --factored and --write: the files of all robots as one domain and one problem.
    """
    if folder is not None:
        written = [("--write", os.path.join(folder, name) if folder else "") for name in WRITTEN]
        check_outputs(written, pddl.paths, makes_folder=True)
    with working("reading and grounding"):
        found = coordlang.inspect(
            *pddl.files, factored=pddl.factored, states=count_states, write=folder, **model
        )
    if folder is not None:
        echo(f"coordlang: note: written to {folder}: {', '.join(WRITTEN)}", err=True)
    note_single_robot(found.robots)
    echo(json.dumps(found.data()) if as_json else found.text(line_width()))
