# SPDX-License-Identifier: GPL-3.0-or-later
"""``coordlang domains`` and ``tasks``: shipped domains, maps as problems of theirs, task files."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from coordlang.commands.command import check_outputs
from coordlang.commands.inputs import Arguments, public
from coordlang.commands.options import OutputFile
from coordlang.commands.records import DomainsOptions, TasksOptions
from coordlang.commands.terminal import echo, write
from coordlang.language.listed import ListedTask, tasks_text
from coordlang.language.patterns import varied_tasks
from coordlang.sites.movingai import planning_files
from coordlang.sites.shipped import about, domain_names, shipped_domains
from planners.system.errors import UsageError
from planners.system.messages import echoed, visible
from planners.system.notebook import counted
from planners.system.writing import copy_folders, write_texts

ALL = "all"


@public(DomainsOptions)
def domains(_: Arguments, options: DomainsOptions) -> list[str]:
    """The names of the domains that are listed or were copied, or of the files of a map."""
    copy, shipped = options.copy, shipped_domains()
    map_file, scen, agents, output = options.map, options.scen, options.agents, options.output
    parts = map_file, scen, agents, output
    if parts != (None,) * 4:
        if copy or map_file is None or scen is None or agents is None or output is None:
            raise UsageError(
                "a map needs --map FILE.map, --scen FILE.scen, --agents K and -o DIR, "
                "and no --copy",
                remedy="Give all four of them.",
            )
        return _write_map(map_file, scen, agents, output)
    names = domain_names(shipped)
    if copy is not None:
        names = _chosen(copy[0], names)
        _copy(shipped, names, copy[1])
    return names


def show_domains(names: list[str], options: DomainsOptions) -> None:
    """Print the names, or what was written."""
    shipped = shipped_domains()
    if options.output is not None and options.agents is not None:
        if options.as_json:
            echo(json.dumps({"folder": options.output, "files": names}))
        else:
            robots, place = counted(options.agents, "robot"), visible(options.output)
            echo(f"{robots}, written to {place}: {', '.join(names)}")
    elif options.as_json:
        echo(json.dumps({"domains": [_data(shipped / name) for name in names]}))
    elif options.copy is not None:
        number = counted(len(names), "domain")
        echo(f"{number} copied to {options.copy[1]}: {', '.join(names)}")
    else:
        width = max(map(len, names))
        for name in names:
            echo(f"{name:<{width}}  {about(shipped / name)}")


def _write_map(map_file: str, scen: str, agents: int, output: str) -> list[str]:
    """Write a map's files, over none that says something else; their names are returned."""
    texts = planning_files(Path(map_file), Path(scen), agents)
    paths = {name: os.path.join(output, name) for name in texts}
    check_outputs([OutputFile("-o", path, True) for path in paths.values()], (map_file, scen))
    for name, path in paths.items():
        if os.path.lexists(path) and _bytes(path) != texts[name].encode():
            raise UsageError(
                f"-o: {path} is there already, and says something else",
                remedy="Remove it, or name another folder.",
            )
    write_texts(output, texts)
    return sorted(texts)


def _bytes(path: str) -> bytes | None:
    try:
        return Path(path).read_bytes()
    except OSError:
        return None


def _data(folder: Path) -> dict[str, object]:
    problems = sorted(path.name for path in folder.glob("*.pddl") if path.name != "domain.pddl")
    return {"name": folder.name, "about": about(folder), "problems": problems}


def _chosen(name: str, names: list[str]) -> list[str]:
    if name != ALL and name not in names:
        raise UsageError(
            f"there is no domain {echoed(name)}", remedy=f"There are {', '.join(names)}, or all."
        )
    return names if name == ALL else [name]


def _copy(shipped: Path, names: list[str], target: str) -> None:
    """Copy folders, none of which is there already: nobody's changes are written over."""
    for name in names:
        path = os.path.join(target, name)
        if target and os.path.lexists(path):
            raise UsageError(
                f"{path} is there already", remedy="Remove it, or name another folder."
            )
        check_outputs([OutputFile("--copy", path if target else "", makes_folder=True)], [])
    copy_folders([shipped / name for name in names], target)


@public(TasksOptions)
def tasks(files: Arguments, options: TasksOptions) -> Sequence[ListedTask]:
    """The task of a problem with other starts and other goals."""
    # Tasks start with no action to remember.
    model = replace(options.source.model, remember_actions=False)
    files = replace(files, source=replace(options.source, model=model))
    return varied_tasks(files.instance(), options.start, options.goal)


def show_tasks(found: Sequence[ListedTask], options: TasksOptions) -> None:
    """Write the file, and say how many tasks there are."""
    write(tasks_text(found), options.output)
    starts, goals = ({getattr(task, part) for task in found} for part in ("init", "goal"))
    if options.as_json and options.output != "-":
        figures = {"tasks": len(found), "starts": len(starts), "goals": len(goals)}
        echo(json.dumps(figures))
        return
    line = f"{counted(len(starts), 'start')}, {counted(len(goals), 'goal')}"
    echo(f"{counted(len(found), 'task')}: {line}", err=options.output == "-")
