# SPDX-License-Identifier: GPL-3.0-or-later
"""Arguments that name input files, and checks of output files before the work."""

from __future__ import annotations

import functools
import os
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import click
from click.shell_completion import CompletionItem

from coordlang.commands.shared_options import CommandFunction
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

language_argument = click.argument("language", type=FILE)


@dataclass(frozen=True, slots=True)
class PlanningFiles:
    """DOMAIN PROBLEM.., or ``--factored DIR`` in their place."""

    files: tuple[str, ...]
    factored: str | None

    @property
    def domain(self) -> str | None:
        """The domain file; None under ``--factored``."""
        return self.files[0] if self.files else None

    @property
    def problem(self) -> str | None:
        """The only problem file; None under ``--factored``."""
        return self.files[1] if self.files else None

    @property
    def problems(self) -> tuple[str, ...]:
        """The problem files; none under ``--factored``."""
        return self.files[1:]

    @property
    def paths(self) -> list[str]:
        """All files that are read."""
        if self.factored:
            return [str(path) for path in Path(self.factored).glob("*.pddl")]
        return list(self.files)


def beside(problem: str) -> str:
    """Where coordinates of a problem's places are read from, if there is such a file."""
    return str(Path(problem).parent / "coordinates.json")


def planning_files(
    metavar: str, most: int | None = None, *, then: str | None = None, optional: bool = False
) -> Callable[[CommandFunction], CommandFunction]:
    """DOMAIN and at most so many problems, or ``--factored DIR``.

    The command gets them as ``pddl``, a `PlanningFiles`.

    Parameters
    ----------
    metavar
        All that is named here, as the usage line shows it.
    most
        The greatest number of problems; None: any number.
    then
        An argument that comes last, by the name under which the command gets it.
    optional
        Whether that argument may be left out: then the command gets None.
    """

    def decorate(function: CommandFunction) -> CommandFunction:
        @click.argument("files", nargs=-1, type=FILE, metavar=metavar)
        @click.option(
            "--factored",
            type=FOLDER,
            metavar="DIR",
            help="In place of DOMAIN and PROBLEM: the folder of each robot's own domain and "
            "problem file.",
        )
        @functools.wraps(function)
        def wrapped(
            files: tuple[str, ...], factored: str | None, **arguments: object
        ) -> int | None:
            least = 0 if factored else 2
            if then is not None:
                files, arguments[then] = _without_last(files, least, is_optional=optional)
            if _misses(files, least, most) or (then and not optional and arguments[then] is None):
                without = "DOMAIN PROBLEM" if then else "them"
                raise click.UsageError(f"expected {metavar}, or --factored DIR without {without}")
            return function(pddl=PlanningFiles(files, factored), **arguments)

        return wrapped

    return decorate


def _misses(files: tuple[str, ...], least: int, most: int | None) -> bool:
    """Whether these are too few files, or too many: none where none is needed."""
    too_many = most is not None and len(files) > 1 + most
    return len(files) < least or too_many or (bool(files) and not least)


def _without_last(
    files: tuple[str, ...], least: int, *, is_optional: bool
) -> tuple[tuple[str, ...], str | None]:
    """Split off the last argument; None where it is left out."""
    if is_optional and len(files) <= least:
        return files, None
    return files[:-1], files[-1] if files else None


def check_outputs(
    outputs: Sequence[tuple[str, str | None]],
    inputs: Iterable[str | None],
    *,
    makes_folder: bool = False,
) -> None:
    """Refuse outputs that cannot be written, or overwrite an input file or one another.

    Before the work, not after it.

    Parameters
    ----------
    outputs
        Pairs (option, path).  None is no file, ``-`` is stdout and not looked at.
    inputs
        The files that are read; None and ``-`` are left out.
    makes_folder
        Whether the command makes the folder itself where it is missing.

    Raises
    ------
    UsageError
        For an output that cannot be written, or that would overwrite something.
    """
    from planners.system.errors import UsageError
    from planners.system.writing import is_device, why_unwritable

    read = [path for path in inputs if path is not None and path != "-" and os.path.isfile(path)]
    named = [(option, path) for option, path in outputs if path is not None and path != "-"]
    written: dict[str, str] = {}
    for option, path in named:
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
