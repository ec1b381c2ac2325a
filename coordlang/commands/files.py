# SPDX-License-Identifier: GPL-3.0-or-later
"""Files that a command reads and writes: what may be written is checked before the work."""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

import click
from click.shell_completion import CompletionItem

from coordlang.commands.terminal import echo


class _Named(click.ParamType):  # type: ignore[type-arg]  # generic in newer versions only
    """Text that names a file or a folder: shells complete it, and nothing is checked yet.

    Parameters
    ----------
    kind
        What click calls it: ``file`` or ``dir``.
    """

    def __init__(self, kind: str) -> None:
        self.name = kind

    def shell_complete(
        self, ctx: click.Context, param: click.Parameter, incomplete: str
    ) -> list[CompletionItem]:
        return [CompletionItem(incomplete, type=self.name)]


FILE, FOLDER = _Named("file"), _Named("dir")


def beside(problem: str) -> str:
    """Where coordinates of a problem's places are read from, if there is such a file."""
    return str(Path(problem).parent / "coordinates.json")


class OutputFile(NamedTuple):
    """A file that is written: the option that names it, and its path.

    None is no file, ``-`` is stdout and not looked at.  ``makes_folder``: its folder is made where
    it is missing.
    """

    option: str
    path: str | None
    makes_folder: bool = False


def check_outputs(
    outputs: Iterable[OutputFile | tuple[str, str | None]], inputs: Iterable[str | None]
) -> None:
    """Refuse outputs that cannot be written, or overwrite an input file or one another.

    Before the work, not after it.  Of the ``inputs`` None and ``-`` are left out.  Raises
    `UsageError`.
    """
    from planners.system.errors import UsageError
    from planners.system.writing import is_device, why_unwritable

    read = [path for path in inputs if path is not None and path != "-" and os.path.isfile(path)]
    written: dict[str, str] = {}
    for option, path, makes_folder in (OutputFile(*each) for each in outputs):
        if path is None or path == "-":
            continue
        if reason := why_unwritable(path, makes_folder=makes_folder):
            what = f"{option} {path} cannot be written: {reason}"
            raise UsageError(what, remedy="Name a file in a folder that you may write to.")
        if is_device(path):
            continue  # a device or a pipe is written to, and never replaced
        if os.path.exists(path) and any(os.path.samefile(path, other) for other in read):
            raise UsageError(
                f"{option} {path} would overwrite an input file",
                remedy="Give the output another name.",
            )
        other = written.setdefault(os.path.realpath(path), option)
        if other != option:
            raise UsageError(
                f"{other} and {option} name the same file: {path}",
                remedy="Give each a file of its own.",
            )


def never_stdout(option: str, path: str | None) -> None:
    """Refuse ``-`` for a second output."""
    from planners.system.errors import UsageError

    if path == "-":
        raise UsageError(f"{option} -: this cannot go to stdout", remedy="Name a file.")


def write(text: str, output: str | None) -> None:
    """Write to a file, or to stdout without one (or for ``-``)."""
    from planners.system.writing import write_atomically

    if output is None or output == "-":
        echo(text, nl=False)
    else:
        write_atomically(output, text.encode())
