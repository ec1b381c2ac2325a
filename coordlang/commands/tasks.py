# SPDX-License-Identifier: GPL-3.0-or-later
"""``coordlang tasks``: a task file with varied starts and goals, for ``build --tasks FILE``."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace

from coordlang.commands.files import write
from coordlang.commands.inputs import Arguments, public
from coordlang.commands.records import TasksOptions
from coordlang.commands.terminal import echo
from coordlang.language.listed import ListedTask
from coordlang.language.patterns import varied_tasks
from coordlang.language.task_file import tasks_text
from planners.system.notebook import counted


@public(TasksOptions)
def tasks(files: Arguments, options: TasksOptions) -> Sequence[ListedTask]:
    """The task of a problem with other starts and other goals."""
    # Tasks start with no action to remember.
    model = replace(options.source.model, remember_actions=False)
    files = replace(files, source=replace(options.source, model=model))
    return varied_tasks(files.instance(), options.start, options.goal)


def show(found: Sequence[ListedTask], options: TasksOptions) -> None:
    """Write the file, and say how many tasks there are."""
    write(tasks_text(found), options.output)
    starts, goals = ({getattr(task, part) for task in found} for part in ("init", "goal"))
    if options.as_json and options.output != "-":
        figures = {"tasks": len(found), "starts": len(starts), "goals": len(goals)}
        echo(json.dumps(figures))
        return
    line = f"{counted(len(starts), 'start')}, {counted(len(goals), 'goal')}"
    echo(f"{counted(len(found), 'task')}: {line}", err=options.output == "-")
