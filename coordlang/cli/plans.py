"""``coordlang plans``: all optimal plans of a task."""

from __future__ import annotations

import json
from collections.abc import Callable
from itertools import islice
from typing import TYPE_CHECKING

import click

from coordlang.cli.app import (
    check_listing,
    form_of,
    limits,
    model_options,
    note_single_robot,
    task_files,
)

if TYPE_CHECKING:
    from planners.loading import PlanningInstance

_DEFAULT_MAX = 10


@click.command(name="plans")
@click.option(
    "--count", "only_count", is_flag=True, help="Print the exact number of optimal plans only."
)
@click.option(
    "--max",
    "most",
    type=click.IntRange(min=0),
    help=f"List at most this many plans (default: {_DEFAULT_MAX}).",
)
@click.option(
    "--sample",
    type=click.IntRange(min=1),
    metavar="N",
    help="Draw N plans uniformly instead of the first ones.",
)
@click.option("--seed", type=int, default=0, show_default=True, help="Seed of --sample.")
@click.option(
    "--format", "form", type=click.Choice(["ipc", "json"]), default="ipc", show_default=True
)
@click.option("--json", "as_json", is_flag=True, help="Short for --format json.")
@model_options
@task_files
@limits
def command(
    only_count: bool,
    most: int | None,
    sample: int | None,
    seed: int,
    form: str,
    as_json: bool,
    load: Callable[[], PlanningInstance],
) -> None:
    """Count, list or sample all optimal plans of a task.

    A plan is a sequence of joint actions; plans are listed in a stable order.
    """
    from planners.search.optimal_plans import search
    from planners.search.plan_file import to_ipc, to_json
    from planners.search.plans import Plans

    check_listing(only_count, most, sample)
    form = form_of(form, as_json)
    loaded = load()
    note_single_robot(loaded.model.robots)
    plans = Plans.of(search(loaded.model, loaded.tasks[0]))
    if only_count and form != "json":
        click.echo(plans.count)
        return
    limit = 0 if only_count else most if most is not None else _DEFAULT_MAX
    listed = list(plans.sample(sample, seed) if sample else islice(plans, limit))
    if form == "json":
        data = to_json(plans, listed)
        if sample:
            data["complete"] = False
        click.echo(json.dumps(data))
        return
    for number, plan in enumerate(listed, 1):
        click.echo(
            f"; plan {number} of {plans.count}" if not sample else f"; sampled plan {number}"
        )
        click.echo(to_ipc(plans, plan))
    if not sample and len(listed) < plans.count:
        click.echo(
            f"{len(listed)} of {plans.count} optimal plans listed; --max N lists more", err=True
        )
