"""``coordlang coordination``: which tasks require coordination, and one miscoordination shown."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import click

from coordlang.cli.app import (
    GivenOptions,
    PlanningFiles,
    counted,
    limits,
    model_options,
    note_single_robot,
    planning_files,
)

if TYPE_CHECKING:
    from coordlang.required.miscoordination import Miscoordination


@click.command(name="coordination")
@planning_files("DOMAIN PROBLEMS...")
@click.option("--json", "as_json", is_flag=True, help="One JSON object.")
@model_options
@limits
def command(pddl: PlanningFiles, as_json: bool, given: GivenOptions) -> None:
    """Say which tasks require coordination.

    Show how robots that follow different optimal plans miscoordinate.
    """
    from coordlang.cli.miscoordination import show
    from coordlang.required.miscoordination import miscoordination
    from coordlang.tasks.candidates import from_problems
    from planners.search.plans import counts

    lifted, read = pddl.read()
    candidates = from_problems(lifted, read, given.options())
    note_single_robot(candidates.model.robots)
    space = candidates.spaces[0]
    numbers = counts(space)
    entries = []
    for task, problem in enumerate(read):
        witness = miscoordination(space, task)
        plans = numbers[int(space.starts[task])]
        entries.append((problem.source.name, space.cost_of(task)[0], plans, witness))
    if as_json:
        click.echo(json.dumps({"tasks": [_data(*entry) for entry in entries]}))
        return
    for name, makespan, plans, witness in entries:
        answer = "is required" if witness else "is not required"
        if not witness and plans > 1:
            answer += ": any mixture of them is optimal"
        click.echo(
            f"{name}: {counted(plans, 'optimal plan')} of {counted(makespan, 'step')}; "
            f"coordination {answer}"
        )
        if witness:
            click.echo()
            click.echo(show(witness))


def _data(name: str, makespan: int, plans: int, witness: Miscoordination | None) -> dict[str, Any]:
    from coordlang.cli.miscoordination import witness_data
    from planners.search.plan_file import json_count

    return {
        "problem": name,
        "makespan": makespan,
        "plans": json_count(plans),
        "requires_coordination": witness is not None,
        "miscoordination": witness_data(witness) if witness else None,
    }
