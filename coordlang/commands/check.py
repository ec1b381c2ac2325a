# SPDX-License-Identifier: GPL-3.0-or-later
"""``coordlang check``: our optimal cost against Fast Downward's."""

from __future__ import annotations

import json

import click

import coordlang
from coordlang.commands.failure import IMPOSSIBLE, REFUTED
from coordlang.commands.files import PlanningFiles, planning_files
from coordlang.commands.shared_options import ModelKeywords, limits, model_options
from coordlang.commands.terminal import echo, working


@click.command(name="check")
@click.option("--json", "as_json", is_flag=True, help="One JSON object.")
@model_options
@planning_files("DOMAIN PROBLEM", most=1)
@limits
def command(as_json: bool, pddl: PlanningFiles, model: ModelKeywords) -> int:
    """Compare our optimal cost with Fast Downward's.

    Exit 0: equal.  1: they differ.  11: both prove that there is no plan.
    """
    with working("solving the task twice"):
        found = coordlang.check(*pddl.files, factored=pddl.factored, **model)
    if as_json:
        echo(json.dumps(found.data()))
    else:
        kind = model.get("cost") or "makespan"
        plain = f"({found.form} form, {found.actions} plain actions)"
        echo(f"coordlang      {_cost(found.cost, kind)}")
        echo(f"Fast Downward  {_cost(found.fast_downward, kind)}   {plain}")
    if not found.agree:
        echo("coordlang: the optimal costs differ", err=True)
        return REFUTED
    return IMPOSSIBLE if found.cost is None else 0


def _cost(cost: tuple[int, int] | None, kind: str) -> str:
    if cost is None:
        return "no plan exists"
    second = kind.partition("+")[2]
    return f"makespan {cost[0]}" + (f", {second} {cost[1]}" if second else "")
