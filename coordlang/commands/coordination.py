# SPDX-License-Identifier: GPL-3.0-or-later
"""``coordlang coordination``: which tasks require coordination, and one miscoordination shown."""

from __future__ import annotations

import json

import click

import coordlang
from coordlang.commands.files import PlanningFiles, planning_files
from coordlang.commands.shared_options import (
    JobsKeywords,
    ModelKeywords,
    jobs_options,
    kept_plans,
    limits,
    model_options,
    slack_option,
)
from coordlang.commands.terminal import echo, line_width, note_single_robot, working


@click.command(name="coordination")
@planning_files("DOMAIN PROBLEMS...")
@click.option("--json", "as_json", is_flag=True, help="One JSON object.")
@jobs_options
@model_options
@slack_option
@kept_plans
@limits
def command(
    pddl: PlanningFiles, as_json: bool, on_workers: JobsKeywords, model: ModelKeywords
) -> None:
    """Decide which tasks require coordination.

    Show how robots that follow different optimal plans miscoordinate; with --slack B plans that
    take at most B steps more.
    """
    with working("finding all optimal plans"):
        found = coordlang.coordination(*pddl.files, factored=pddl.factored, **on_workers, **model)
    note_single_robot(found.robots)
    echo(json.dumps(found.data()) if as_json else found.text(line_width()))
