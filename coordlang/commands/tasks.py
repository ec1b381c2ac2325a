# SPDX-License-Identifier: GPL-3.0-or-later
"""``coordlang tasks``: a task file with varied starts and goals, for ``build --tasks FILE``."""

from __future__ import annotations

import json

import click

import coordlang
from coordlang.commands.files import FILE, PlanningFiles, check_outputs, planning_files, write
from coordlang.commands.shared_options import ModelKeywords, limits, model_options
from coordlang.commands.terminal import echo, working
from planners.system.notebook import counted


@click.command(name="tasks")
@planning_files("DOMAIN PROBLEM", most=1)
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
@click.option(
    "-o", "--output", required=True, type=FILE, metavar="FILE", help="The task file, - for stdout."
)
@click.option("--json", "as_json", is_flag=True, help="Print the figures as one JSON object.")
@model_options
@limits
def command(
    pddl: PlanningFiles,
    starts: tuple[str, ...],
    goals: tuple[str, ...],
    output: str,
    as_json: bool,
    model: ModelKeywords,
) -> None:
    """Write a task file: the tasks of PROBLEM with other starts and other goals.

    In a PATTERN ? stands for any one name.
    """
    from coordlang.language.patterns import varied_tasks
    from coordlang.language.task_file import tasks_text

    check_outputs([("-o", output)], pddl.paths)
    model["remember_actions"] = False  # tasks start with no action to remember
    with working("reading and grounding"):
        loaded = coordlang.load(*pddl.files, factored=pddl.factored, **model)
        tasks = varied_tasks(loaded, starts, goals)
    write(tasks_text(tasks), output)
    figures = {
        "tasks": len(tasks),
        "starts": len({task.init for task in tasks}),
        "goals": len({task.goal for task in tasks}),
    }
    if as_json and output != "-":
        echo(json.dumps(figures))
        return
    line = ", ".join((counted(figures["starts"], "start"), counted(figures["goals"], "goal")))
    echo(f"{counted(figures['tasks'], 'task')}: {line}", err=output == "-")
