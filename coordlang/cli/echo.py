# SPDX-License-Identifier: GPL-3.0-or-later
"""Text to stdout and stderr: every command writes through here, so that nothing is written raw."""

from __future__ import annotations

import click

from planners.messages import visible


def echo(text: object, *, err: bool = False, nl: bool = True) -> None:
    """Write text like `click.echo`, with control characters escaped.

    Names of files and arguments may hold any character, and escapes of a terminal among them.
    """
    click.echo(visible(str(text), keep="\n\t"), err=err, nl=nl)
