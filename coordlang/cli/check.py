"""``coordlang check``: our optimal cost against Fast Downward's."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import TYPE_CHECKING

import click

from coordlang.cli.app import limits, model_options, task_files

if TYPE_CHECKING:
    from planners.loading import PlanningInstance


@click.command(name="check")
@click.option("--json", "as_json", is_flag=True, help="One JSON object.")
@model_options
@task_files
@limits
def command(as_json: bool, load: Callable[[], PlanningInstance]) -> int:
    """Compare our optimal cost with Fast Downward's (through unified-planning).

    Exit 0: equal.  1: they differ.  11: both prove that there is no plan.
    """
    from planners.classical.fast_downward import optimal_cost
    from planners.errors import ProvedImpossible
    from planners.search.optimal_plans import search

    loaded = load()
    model, task = loaded.model, loaded.tasks[0]
    try:
        ours: tuple[int, int] | None = search(model, task).cost_of(0)
    except ProvedImpossible:
        ours = None
    answer = optimal_cost(model, task)
    theirs = answer.cost
    if as_json:
        click.echo(
            json.dumps(
                {
                    "coordlang": ours,
                    "fast_downward": theirs,
                    "agree": ours == theirs,
                    "form": answer.form,
                    "actions": answer.actions,
                }
            )
        )
    else:
        click.echo(f"coordlang      {_cost(ours, model.cost)}")
        click.echo(
            f"Fast Downward  {_cost(theirs, model.cost)}   ({answer.form} form, {answer.actions} "
            "plain actions)"
        )
    if ours != theirs:
        click.echo("coordlang: the optimal costs differ", err=True)
        return 1
    return 11 if ours is None else 0


def _cost(cost: tuple[int, int] | None, kind: str) -> str:
    if cost is None:
        return "no plan exists"
    second = kind.partition("+")[2]
    return f"makespan {cost[0]}" + (f", {second} {cost[1]}" if second else "")
