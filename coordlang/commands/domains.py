# SPDX-License-Identifier: GPL-3.0-or-later
"""``coordlang domains`` and ``tasks``: shipped domains, task files."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from coordlang.commands.command import check_outputs
from coordlang.commands.inputs import Arguments, public
from coordlang.commands.records import DomainsOptions, OutputFile, TasksOptions
from coordlang.commands.terminal import echo, write
from coordlang.language.listed import ListedTask, tasks_text, varied_tasks
from coordlang.sites.shipped import about, domain_names, shipped_domains
from planners.system.errors import UsageError
from planners.system.messages import echoed
from planners.system.notebook import counted
from planners.system.writing import copy_folders


@public(DomainsOptions)
def domains(_: Arguments, options: DomainsOptions) -> list[str]:
    """The names of the domains that are listed or were copied."""
    copy, shipped = options.copy, shipped_domains()
    names = domain_names(shipped)
    if copy is None:
        return names
    if copy[0] not in ("all", *names):
        raise UsageError(
            f"there is no domain {echoed(copy[0])}", remedy=f"There are {', '.join(names)}, or all."
        )
    names, target = names if copy[0] == "all" else [copy[0]], copy[1]
    for name in names:  # nobody's changes are written over
        path = os.path.join(target, name) if target else ""
        if os.path.lexists(path):
            remedy = "Remove it, or name another folder."
            raise UsageError(f"{path} is there already", remedy=remedy)
        check_outputs([OutputFile("--copy", path, makes_folder=True)], [])
    copy_folders([shipped / name for name in names], target)
    return names


def show_domains(names: list[str], options: DomainsOptions) -> None:
    """Print the names, or what was written."""
    shipped = shipped_domains()
    if options.as_json:
        echo(json.dumps({"domains": [_data(shipped / name) for name in names]}))
    elif options.copy is not None:
        number = counted(len(names), "domain")
        echo(f"{number} copied to {options.copy[1]}: {', '.join(names)}")
    else:
        width = max(map(len, names))
        for name in names:
            echo(f"{name:<{width}}  {about(shipped / name)}")


def _data(folder: Path) -> dict[str, object]:
    problems = sorted(path.name for path in folder.glob("*.pddl") if path.name != "domain.pddl")
    return {"name": folder.name, "about": about(folder), "problems": problems}


@public(TasksOptions)
def tasks(files: Arguments, options: TasksOptions) -> Sequence[ListedTask]:
    """The task of a problem with other starts and other goals."""
    # Tasks start with no action to remember.
    model = replace(options.source.model, remember_actions=False)
    files = replace(files, source=replace(options.source, model=model))
    return varied_tasks(files.instance(), options.start, options.goal)


def show_tasks(found: Sequence[ListedTask], options: TasksOptions) -> None:
    """Write the file, and say how many tasks there are."""
    starts, goals = (len({getattr(task, part) for task in found}) for part in ("init", "goal"))
    said = f"{counted(len(found), 'task')}: {counted(starts, 'start')}, {counted(goals, 'goal')}"
    if options.as_json and options.output != "-":
        said = json.dumps({"tasks": len(found), "starts": starts, "goals": goals})
    write(tasks_text(found), options.output, said)
