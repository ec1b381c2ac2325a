"""``coordlang coordination``: which tasks require coordination, and one miscoordination shown."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import click

from coordlang.cli.app import (
    GivenOptions,
    counted,
    domain_argument,
    limits,
    model_options,
    note_single_robot,
    problems_argument,
    read_files,
)

if TYPE_CHECKING:
    from coordlang.witness import Miscoordination


@click.command(name="coordination")
@domain_argument
@problems_argument
@click.option("--json", "as_json", is_flag=True, help="One JSON object.")
@model_options
@limits
def command(domain: str, problems: tuple[str, ...], as_json: bool, given: GivenOptions) -> None:
    """Say which tasks require coordination, and show how robots that follow different optimal plans miscoordinate."""
    from coordlang.tasks import from_problems
    from coordlang.witness import miscoordination
    from planners.plans import counts

    lifted, read = read_files(domain, problems)
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
        answer = "is required" if witness else "is not required: any mixture of them is optimal"
        click.echo(f"{name}: {counted(plans, 'optimal plan')} of {makespan} steps; coordination {answer}")
        if witness:
            click.echo()
            click.echo(show(witness))


def _data(name: str, makespan: int, plans: int, witness: Miscoordination | None) -> dict[str, Any]:
    from planners.planfile import json_count

    return {
        "problem": name,
        "makespan": makespan,
        "plans": json_count(plans),
        "requires_coordination": witness is not None,
        "miscoordination": witness_data(witness) if witness else None,
    }


def witness_data(witness: Miscoordination) -> dict[str, Any]:
    """A miscoordination as JSON."""
    data: dict[str, Any] = {
        "task": witness.task,
        "robots": list(witness.robots),
        "plans": [[list(step) for step in plan] for plan in witness.plans],
        "states": [list(states) for states in witness.states],
        "mixture": [list(step) for step in witness.mixture],
        "mixed_states": list(witness.mixed_states),
        "step": witness.step,
        "reason": witness.reason,
    }
    if witness.sentence is not None:
        data["sentence"] = list(witness.sentence)
    return data


def show(witness: Miscoordination) -> str:
    """A miscoordination as a person wants to see it: who follows which plan, step by step, and where it breaks."""
    width = max(len(text or "idle") for plan in witness.plans for step in plan for text in step) + 2
    lines = [f"  task: {witness.task}"]
    for robot, plan, states in zip(witness.robots, witness.plans, witness.states, strict=True):
        lines.append(f"  {robot} follows this optimal plan:")
        lines += _table(witness.robots, plan, states, width)
    lines.append("  together they do:")
    for number, (step, state) in enumerate(zip(witness.mixture, witness.mixed_states, strict=True)):
        mark = "  <-- breaks here" if number == witness.step else ""
        lines.append(f"    {state}")
        lines.append(f"    {number + 1:>3}  " + "".join(f"{_does(r, t):<{width + 6}}" for r, t in zip(
            witness.robots, step, strict=True)).rstrip() + mark)  # fmt: skip
    lines.append(f"  step {witness.step + 1} breaks: {witness.reason}")
    return "\n".join(lines)


def _table(
    robots: tuple[str, ...], plan: tuple[tuple[str | None, ...], ...], states: tuple[str, ...], width: int
) -> list[str]:
    lines = []
    for number, step in enumerate(plan, 1):
        texts = "".join(f"{_does(r, t):<{width + 6}}" for r, t in zip(robots, step, strict=True)).rstrip()
        lines.append(f"    {number:>3}  {texts}")
    lines.append(f"         reaches {states[-1]}")
    return lines


def _does(robot: str, text: str | None) -> str:
    return f"{robot}: {text or 'idle'}"
