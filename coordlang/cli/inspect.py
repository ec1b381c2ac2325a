"""``coordlang inspect``: what was understood of a domain and problem."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import click

from coordlang.cli.app import counted, limits, model_options, note_single_robot, task_files

if TYPE_CHECKING:
    from planners.inspection import Inspection
    from planners.loading import PlanningInstance


@click.command(name="inspect")
@click.option(
    "--states",
    "count_states",
    is_flag=True,
    help="Also count the reachable joint states and steps.",
)
@click.option("--json", "as_json", is_flag=True, help="One JSON object.")
@model_options
@task_files
@limits
def command(count_states: bool, as_json: bool, load: Callable[[], PlanningInstance]) -> None:
    """Show what was understood of DOMAIN and PROBLEM: a domain that was misread shows it here."""
    from planners.inspection import inspect

    loaded = load()
    note_single_robot(loaded.model.robots)
    found = inspect(loaded)
    space = None
    if count_states:
        from planners.search.reachable import count

        states, steps = count(loaded.model, loaded.tasks[0].init[None, :])
        space = {"states": states, "joint_steps": steps}
    if as_json:
        data: dict[str, Any] = asdict(found)
        click.echo(json.dumps(data | (space or {})))
        return
    click.echo(_text(found))
    if space:
        number = counted(space["states"], "joint state")
        click.echo(f"reachable       {number}, {counted(space['joint_steps'], 'joint step')}")


def _text(found: Inspection) -> str:
    lines = [
        ("domain", f"{found.domain}, problem {found.problem}"),
        ("read as", found.style),
        ("objects", _counts(found.objects) or "none"),
        ("robots", f"{', '.join(found.robots)} (by {found.robots_by})"),
    ]
    for robot, schemas in found.subactions.items():
        listed = f": {_counts(schemas)}" if schemas else ""
        lines.append(
            (
                f"  {robot}",
                f"{counted(sum(schemas.values()), 'subaction')}{listed}; {found.idle[robot]}",
            )
        )
    lines += [
        ("shared", _counts(found.shared) or "none"),
        (
            "no robot named",
            {"error": "not allowed (--unowned)"}.get(found.unowned, f"--unowned {found.unowned}"),
        ),
        ("step formulas", _counts(found.step_formulas) or "none"),
        *(("", f"e.g. {example}") for example in found.formulas),
        ("never possible", ", ".join(found.impossible) or "none"),
        ("no effects", ", ".join(found.without_effects) or "none"),
        ("action costs", found.costs),
        ("interference", counted(found.interfering, "pair") + _example(found)),
        (
            "fluents",
            f"{counted(found.facts, 'fact')}: {_counts(found.fluents)}" if found.facts else "none",
        ),
        ("at the start", _counts(found.start) or "none is true"),
        ("statics", _counts(found.statics) or "none"),
        ("never true", ", ".join(found.never) or "none"),
        ("goal", found.goal),
    ]
    return "\n".join(f"{name:<14}  {text}" for name, text in lines)


def _example(found: Inspection) -> str:
    if found.example:
        return f", e.g. {found.example}"
    return ", none of them possible in one state near the start" if found.interfering else ""


def _counts(counts: dict[str, int]) -> str:
    return ", ".join(f"{name} {number:,}" for name, number in counts.items())
