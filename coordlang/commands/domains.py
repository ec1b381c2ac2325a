# SPDX-License-Identifier: GPL-3.0-or-later
"""``coordlang domains``, ``tasks`` and ``import``: shipped domains, task files, maps of others."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from os import PathLike, fspath
from pathlib import Path

from coordlang.commands.command import check_outputs
from coordlang.commands.inputs import Arguments, public
from coordlang.commands.records import DomainsOptions, ImportOptions, OutputFile, TasksOptions
from coordlang.commands.terminal import echo, write
from coordlang.language.listed import ListedTask, tasks_text, varied_tasks
from coordlang.sites import about, shipped_domains
from planners.system.errors import UsageError, note
from planners.system.messages import Presented, counted, echoed, visible
from planners.system.writing import copy_folders, write_texts


@public(DomainsOptions)
def domains(_: Arguments, options: DomainsOptions) -> list[str]:
    """The names of the domains that are listed or were copied."""
    copy, shipped = options.copy, shipped_domains()
    names = sorted(path.parent.name for path in shipped.glob("*/domain.pddl"))
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


# ---- maps and buildings of others


@dataclass(frozen=True, slots=True, repr=False)
class ImportedSite(Presented):
    """A site as PDDL: ``texts`` by the names of their files, and the ``robots`` in it.

    ``unused`` counts what the file has besides.
    """

    texts: Mapping[str, str]
    robots: tuple[str, ...]
    unused: Mapping[str, int]
    shown = ("robots", "unused")

    def data(self) -> dict[str, object]:
        """What was imported as JSON data."""
        return {"files": sorted(self.texts), "robots": self.robots, "unused": dict(self.unused)}

    def save(self, folder: str | PathLike[str]) -> None:
        """Write the files into a folder, which is made if it is missing.

        Raises `UsageError` if one is there that says something else: nothing is written over.
        """
        paths = {name: os.path.join(folder, name) for name in self.texts}
        check_outputs([OutputFile("-o", path, True) for path in paths.values()], ())
        for name, path in paths.items():
            with suppress(OSError):
                if Path(path).read_bytes() == self.texts[name].encode():
                    continue
            if os.path.lexists(path):
                remedy = "Remove it, or name another folder."
                what = f"{path} is there already, and says something else"
                raise UsageError(what, remedy=remedy)
        write_texts(fspath(folder), self.texts)


@public(ImportOptions)
def import_site(files: Arguments, options: ImportOptions) -> ImportedSite:
    """Read a map of movingai.com with its scenario, or a building of Open-RMF, as PDDL.

    Raises `BadInput`, with the line, for a wrong file, and `UsageError` for robots, places and
    tasks that it does not have.
    """
    paths = [Path(fspath(path)) for path in files.values["FILES..."] if path is not None]
    kinds = sorted(path.suffix.lower() for path in paths)
    if kinds == [".map", ".scen"]:
        grid, scenario = sorted(paths, key=lambda path: path.suffix.lower())
        return _map(grid, scenario, options)
    if kinds in ([".yaml"], [".yml"]):
        return _building(paths[0], options)
    remedy = "Give FILE.map FILE.scen, or FILE.building.yaml."
    raise UsageError("expected a map with its scenario, or a building", remedy=remedy)


def show_import(found: ImportedSite, options: ImportOptions) -> None:
    """Write the files, and say where they are."""
    found.save(options.output)
    if options.as_json:
        echo(json.dumps({"folder": options.output, **found.data()}))
    else:
        robots, place = counted(len(found.robots), "robot"), visible(options.output)
        echo(f"{robots}, written to {place}: {', '.join(sorted(found.texts))}")


def _map(grid: Path, scenario: Path, options: ImportOptions) -> ImportedSite:
    from coordlang.sites.movingai import planning_files

    number = _robots(options.robots)
    if not isinstance(number, int):
        remedy = "Say --robots 2: the first two of the scenario."
        raise UsageError("--robots: a scenario has numbered robots", remedy=remedy)
    if options.task or options.clearance is not None:
        remedy = "Leave out --task and --clearance."
        raise UsageError("the scenario says who goes where on a map", remedy=remedy)
    texts = planning_files(grid, scenario, number)
    return ImportedSite(texts, tuple(f"r{k}" for k in range(1, number + 1)), {})


def _building(path: Path, options: ImportOptions) -> ImportedSite:
    from coordlang.sites.building import read_building
    from coordlang.sites.building_pddl import building_files, unused

    clearance = options.clearance or 0.0
    building = read_building(path)
    texts, robots = building_files(building, _robots(options.robots), options.task, clearance)
    if options.clearance is None:
        note("clearance 0 m: the file has none; --clearance keeps robots apart")
    if not options.task:
        note("no --task: the goal is where robots start (build --tasks all has every other one)")
    if building.unused:
        note(f"not used: {unused(building)}")
    return ImportedSite(texts, robots, building.unused)


def _robots(asked: int | str | Sequence[str] | None) -> int | list[str] | None:
    """How many robots are asked for, or which ones."""
    if isinstance(asked, str):
        asked = int(asked) if asked.isdecimal() and len(asked) < 99 else asked.split(",")
    if asked is not None and (asked < 1 if isinstance(asked, int) else not asked):
        raise UsageError(f"--robots {asked}: at least one is needed", remedy="Say --robots 2.")
    return asked if asked is None or isinstance(asked, int) else [name.strip() for name in asked]
