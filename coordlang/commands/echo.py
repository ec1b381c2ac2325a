# SPDX-License-Identifier: GPL-3.0-or-later
"""Text to stdout and stderr: every command writes through here, so that nothing is written raw."""

from __future__ import annotations

from dataclasses import dataclass

import click

from planners.system.messages import visible


@dataclass(slots=True)
class Output:
    """What a command has done to stdout: whether something is written there already."""

    written: bool = False


def echo(text: object, *, err: bool = False, nl: bool = True) -> None:
    """Write text like `click.echo`, with control characters escaped.

    Names of files and arguments may hold any character, and escapes of a terminal among them.
    """
    context = click.get_current_context(silent=True)
    if not err and context is not None and isinstance(context.obj, Output):
        context.obj.written = True
    click.echo(visible(str(text), keep="\n\t"), err=err, nl=nl)


def note(text: str) -> None:
    """Write what a person should read to stderr."""
    echo(f"coordlang: note: {text}", err=True)
