# SPDX-License-Identifier: GPL-3.0-or-later
"""``coordlang domains``: the domains that come with coordlang."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import click

from coordlang.cli.echo import echo
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
        _copy(shipped, names, Path(copy[1]))
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


def _copy(shipped: Path, names: list[str], target: Path) -> None:
    """Copy folders, none of which is there already: nobody's changes are written over."""
    from planners.errors import UsageError

    for name in names:
        if (target / name).exists():
            raise UsageError(
                f"{target / name} is there already", remedy="Remove it, or name another folder."
            )
    try:
        for name in names:
            shutil.copytree(shipped / name, target / name)
    except OSError as error:
        why = error.strerror or "not all files could be copied"
        raise UsageError(
            f"the domains cannot be copied to {target}: {why}",
            remedy="Name a folder that you may write to.",
        ) from None
