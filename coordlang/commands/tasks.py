# SPDX-License-Identifier: GPL-3.0-or-later
"""``coordlang tasks``: a task file with varied starts and goals, for ``build --tasks FILE``."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace

from coordlang.commands.command import command_of
from coordlang.commands.files import write
from coordlang.commands.inputs import read_instance
from coordlang.commands.keywords import with_options
from coordlang.commands.options import (
    NO_SLACK,
    DomainSource,
    ProblemSource,
    Source,
    json_option,
    output_option,
)
from coordlang.commands.terminal import echo
from coordlang.language.listed import ListedTask
from coordlang.language.patterns import varied_tasks
from coordlang.language.task_file import tasks_text
from planners.system.notebook import counted
from planners.system.options import group, option


@dataclass(frozen=True, slots=True)
class TasksOptions:
    """What `tasks` can be asked for."""

    start: tuple[str, ...] = option(
        (), "Atoms in which the start may differ from the problem's, as in '(at r1 ?)'.", "PATTERN"
    )
    goal: tuple[str, ...] = option(
        (), "Each goal has one atom of this pattern (default: the problem's goal).", "PATTERN"
    )
    output: str = output_option("The task file, - for stdout.", required=True)
    as_json: bool = json_option("Print the figures as one JSON object.")
    source: Source = group(Source, without=NO_SLACK)


@with_options(TasksOptions)
def tasks(
    domain: DomainSource | None = None,
    problem: ProblemSource | None = None,
    *,
    options: TasksOptions,
) -> Sequence[ListedTask]:
    """The task of a problem with other starts and other goals."""
    # Tasks start with no action to remember.
    model = replace(options.source.model, remember_actions=False)
    source = replace(options.source, model=model)
    return varied_tasks(read_instance(domain, problem, source), options.start, options.goal)


@command_of(tasks, "DOMAIN PROBLEM", doing="reading and grounding", keeps_plans=False)
def command(found: Sequence[ListedTask], options: TasksOptions) -> None:
    """Write a task file: the tasks of PROBLEM with other starts and other goals.

    In a PATTERN ? stands for any one name.
    """
    write(tasks_text(found), options.output)
    figures = {
        "tasks": len(found),
        "starts": len({task.init for task in found}),
        "goals": len({task.goal for task in found}),
    }
    if options.as_json and options.output != "-":
        echo(json.dumps(figures))
        return
    line = ", ".join((counted(figures["starts"], "start"), counted(figures["goals"], "goal")))
    echo(f"{counted(figures['tasks'], 'task')}: {line}", err=options.output == "-")
