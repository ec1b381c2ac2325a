# SPDX-License-Identifier: GPL-3.0-or-later
"""``coordlang inspect``: what was understood of a domain and problem."""

from __future__ import annotations

import json

import click

import coordlang
from coordlang.cli.echo import echo
from coordlang.cli.files import PlanningFiles, planning_files
from coordlang.cli.shared_options import ModelKeywords, limits, model_options
from coordlang.cli.terminal import note_single_robot, working


@click.command(name="inspect")
@click.option(
    "--states",
    "count_states",
    is_flag=True,
    help="Also count the reachable joint states and steps.",
)
@click.option("--json", "as_json", is_flag=True, help="One JSON object.")
@model_options
@planning_files("DOMAIN PROBLEM", most=1)
@limits
def command(count_states: bool, as_json: bool, pddl: PlanningFiles, model: ModelKeywords) -> None:
    """Show what was understood of DOMAIN and PROBLEM: a domain that was misread shows it here."""
    with working("reading and grounding"):
        found = coordlang.inspect(*pddl.files, factored=pddl.factored, states=count_states, **model)
    note_single_robot(found.robots)
    echo(json.dumps(found.data()) if as_json else str(found))
