# SPDX-License-Identifier: GPL-3.0-or-later
"""``coordlang plans``: all optimal plans of a task."""

from __future__ import annotations

import json

import click

import coordlang
from coordlang.commands.echo import echo
from coordlang.commands.files import PlanningFiles, planning_files
from coordlang.commands.listing import Listing, form_of, listing_options
from coordlang.commands.shared_options import (
    ModelKeywords,
    kept_plans,
    limits,
    model_options,
    slack_option,
)
from coordlang.commands.terminal import note_single_robot, working
from planners.search.heuristics import CHOICES


@click.command(name="plans")
@listing_options
@click.option(
    "--format", "form", type=click.Choice(["ipc", "json"]), default="ipc", show_default=True
)
@click.option(
    "--heuristic",
    type=click.Choice(CHOICES),
    default="auto",
    show_default=True,
    help="What the search is bounded by; the plans are the same.",
)
@click.option("--json", "as_json", is_flag=True, help="Short for --format json.")
@model_options
@slack_option
@planning_files("DOMAIN PROBLEM", most=1)
@kept_plans
@limits
def command(
    only_count: bool,
    most: int | None,
    sample: int | None,
    seed: int,
    form: str,
    heuristic: str,
    as_json: bool,
    pddl: PlanningFiles,
    model: ModelKeywords,
) -> None:
    """Count, list or sample all optimal plans of a task.

    A plan is a sequence of joint actions; plans are listed in a stable order.  With --slack B those
    that take at most B steps more, too; a rest at the end of a plan is left out.
    """
    listing = Listing.of(only_count, most, sample, seed)
    form = form_of(form, as_json)
    with working("finding all optimal plans"):
        plans = coordlang.plans(*pddl.files, factored=pddl.factored, heuristic=heuristic, **model)
    note_single_robot(plans.robots)
    listed = listing.chosen(plans)
    if form == "json":
        data = plans.data(listed)
        if sample:
            data["complete"] = False
        echo(json.dumps(data))
    elif only_count:
        echo(plans.count)
    else:
        echo(listing.text(plans, listed), nl=False)
        listing.note_more(plans, listed, "plans" if plans.slack else "optimal plans")
