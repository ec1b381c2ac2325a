# SPDX-License-Identifier: GPL-3.0-or-later
"""``coordlang domains``: the domains that come with coordlang, and maps as problems of theirs."""

from __future__ import annotations

import json
import os
from pathlib import Path

import click

from coordlang.commands.files import FILE, FOLDER, check_outputs
from coordlang.commands.shared_options import limits
from coordlang.commands.terminal import echo
from planners.system.messages import visible
from planners.system.notebook import counted

ALL = "all"


@click.command(name="domains")
@click.option(
    "--copy",
    nargs=2,
    metavar="NAME|all DIR",
    help="Copy this domain, or all of them, with problems and README into DIR/NAME.",
)
@click.option(
    "--map",
    "map_file",
    type=FILE,
    metavar="FILE.map",
    help="A map of movingai.com, to be written as a problem of the grid domain.",
)
@click.option(
    "--scen", type=FILE, metavar="FILE.scen", help="The scenario: where robots start and go."
)
@click.option("--agents", type=int, metavar="K", help="The first K robots of the scenario.")
@click.option(
    "-o", "output", type=FOLDER, metavar="DIR", help="The folder for a map's domain and problem."
)
@click.option("--json", "as_json", is_flag=True, help="One JSON object.")
@limits
def command(
    copy: tuple[str, str] | None,
    map_file: str | None,
    scen: str | None,
    agents: int | None,
    output: str | None,
    as_json: bool,
) -> None:
    """List the domains that come with coordlang, one a line, copy them, or write a map as PDDL."""
    if map_file is None and scen is None and agents is None and output is None:
        _list_or_copy(copy, as_json)
        return
    if copy is not None or map_file is None or scen is None or agents is None or output is None:
        raise click.UsageError(
            "a map needs --map FILE.map, --scen FILE.scen, --agents K and -o DIR, and no --copy"
        )
    names = _write_map(map_file, scen, agents, output)
    if as_json:
        echo(json.dumps({"folder": output, "files": names}))
    else:
        echo(f"{counted(agents, 'robot')}, written to {visible(output)}: {', '.join(names)}")


def _write_map(map_file: str, scen: str, agents: int, output: str) -> list[str]:
    """Write a map's files, over none that says something else; their names are returned."""
    from coordlang.sites.movingai import planning_files
    from planners.system.errors import UsageError
    from planners.system.writing import write_texts

    texts = planning_files(Path(map_file), Path(scen), agents)
    paths = {name: os.path.join(output, name) for name in texts}
    check_outputs([("-o", path) for path in paths.values()], [map_file, scen], makes_folder=True)
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


def _list_or_copy(copy: tuple[str, str] | None, as_json: bool) -> None:
    from coordlang.sites.shipped import about, domain_names, shipped_domains

    shipped = shipped_domains()
    names = domain_names(shipped)
    if copy is not None:
        names = _chosen(copy[0], names)
        _copy(shipped, names, copy[1])
    if as_json:
        echo(json.dumps({"domains": [_data(shipped / name) for name in names]}))
    elif copy is not None:
        echo(f"{counted(len(names), 'domain')} copied to {copy[1]}: {', '.join(names)}")
    else:
        width = max(map(len, names))
        for name in names:
            echo(f"{name:<{width}}  {about(shipped / name)}")


def _data(folder: Path) -> dict[str, object]:
    from coordlang.sites.shipped import about

    problems = sorted(path.name for path in folder.glob("*.pddl") if path.name != "domain.pddl")
    return {"name": folder.name, "about": about(folder), "problems": problems}


def _chosen(name: str, names: list[str]) -> list[str]:
    from planners.system.errors import UsageError
    from planners.system.messages import echoed

    if name != ALL and name not in names:
        raise UsageError(
            f"there is no domain {echoed(name)}", remedy=f"There are {', '.join(names)}, or all."
        )
    return names if name == ALL else [name]


def _copy(shipped: Path, names: list[str], target: str) -> None:
    """Copy folders, none of which is there already: nobody's changes are written over."""
    from planners.system.errors import UsageError
    from planners.system.writing import copy_folders

    for name in names:
        path = os.path.join(target, name)
        if target and os.path.lexists(path):
            raise UsageError(
                f"{path} is there already", remedy="Remove it, or name another folder."
            )
        check_outputs([("--copy", path if target else "")], [], makes_folder=True)
    copy_folders([shipped / name for name in names], target)
