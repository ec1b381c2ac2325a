"""``coordlang tasks``: a task file with varied starts and goals, for ``build --tasks FILE``."""

from __future__ import annotations

import json
from dataclasses import replace

import click

from coordlang.cli.app import (
    GivenOptions,
    check_outputs,
    counted,
    domain_argument,
    limits,
    model_options,
    problem_argument,
    read_files,
)


@click.command(name="tasks")
@domain_argument
@problem_argument
@click.option(
    "--start",
    "starts",
    multiple=True,
    metavar="PATTERN",
    help="Atoms in which the start may differ from the problem's, as in '(at r1 ?)'.",
)
@click.option(
    "--goal",
    "goals",
    multiple=True,
    metavar="PATTERN",
    help="Each goal has one atom of this pattern (default: the problem's goal).",
)
@click.option("-o", "--output", required=True, metavar="FILE", help="The task file, - for stdout.")
@click.option("--json", "as_json", is_flag=True, help="Print the figures as one JSON object.")
@model_options
@limits
def command(
    domain: str,
    problem: str,
    starts: tuple[str, ...],
    goals: tuple[str, ...],
    output: str,
    as_json: bool,
    given: GivenOptions,
) -> None:
    """Write a task file: the tasks of PROBLEM with other starts and other goals.

    In a PATTERN ? stands for any one name.
    """
    from coordlang.tasks.patterns import varied_tasks
    from coordlang.tasks.task_file import tasks_text
    from planners.files import write_atomically
    from planners.loading import build

    check_outputs([("-o", output)], [domain, problem])
    lifted, read = read_files(domain, (problem,))
    options = replace(
        given.options(), remember_actions=False
    )  # tasks start with nothing to remember
    tasks = varied_tasks(build(lifted, read, options), starts, goals)
    text = tasks_text(tasks)
    if output == "-":
        click.echo(text, nl=False)
    else:
        write_atomically(output, text.encode())
    figures = {
        "tasks": len(tasks),
        "starts": len({t.init for t in tasks}),
        "goals": len({t.goal for t in tasks}),
    }
    if as_json and output != "-":
        click.echo(json.dumps(figures))
    else:
        click.echo(
            f"{counted(figures['tasks'], 'task')}: {counted(figures['starts'], 'start')}, "
            f"{counted(figures['goals'], 'goal')}",
            err=output == "-",
        )
