# SPDX-License-Identifier: GPL-3.0-or-later
"""``coordlang domains``: the domains that come with coordlang."""

from __future__ import annotations

import json
import os
from pathlib import Path

import click

from coordlang.cli.echo import echo
from coordlang.cli.files import check_outputs
from planners.notebook import counted

ALL = "all"


@click.command(name="domains")
@click.option(
    "--copy",
    nargs=2,
    metavar="NAME|all DIR",
    help="Copy this domain, or all of them, with problems and README into DIR/NAME.",
)
@click.option("--json", "as_json", is_flag=True, help="One JSON object.")
def command(copy: tuple[str, str] | None, as_json: bool) -> None:
    """List the domains that come with coordlang, one a line, or copy them."""
    from coordlang.shipped import about, domain_names, shipped_domains

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
    from coordlang.shipped import about

    problems = sorted(path.name for path in folder.glob("*.pddl") if path.name != "domain.pddl")
    return {"name": folder.name, "about": about(folder), "problems": problems}


def _chosen(name: str, names: list[str]) -> list[str]:
    from planners.errors import UsageError
    from planners.messages import echoed

    if name != ALL and name not in names:
        raise UsageError(
            f"there is no domain {echoed(name)}", remedy=f"There are {', '.join(names)}, or all."
        )
    return names if name == ALL else [name]


def _copy(shipped: Path, names: list[str], target: str) -> None:
    """Copy folders, none of which is there already: nobody's changes are written over."""
    from planners.errors import UsageError
    from planners.writing import copy_folders

    for name in names:
        path = os.path.join(target, name)
        if target and os.path.lexists(path):
            raise UsageError(
                f"{path} is there already", remedy="Remove it, or name another folder."
            )
        check_outputs([("--copy", path if target else "")], [], makes_folder=True)
    copy_folders([shipped / name for name in names], target)
