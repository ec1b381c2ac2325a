# SPDX-License-Identifier: GPL-3.0-or-later
"""An error as it leaves the command line: text on stderr, with ``--json`` an object on stdout."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from io import StringIO
from itertools import pairwise
from typing import Any

import click

from planners.system.errors import CoordlangError, Position
from planners.system.messages import sentence


def why_stopped(stopped: BaseException) -> str:
    """What ended work whose best result is kept, in one line."""
    if isinstance(stopped, KeyboardInterrupt):
        return "interrupted"
    return str(stopped).splitlines()[0] if str(stopped) else "out of memory"


@dataclass(frozen=True, slots=True)
class Failure:
    """What ended a command.

    Attributes
    ----------
    text
        What stderr shows.
    message, remedy
        What is wrong, and what to do.
    position
        Where, in a file.
    exit_code
        What the process ends with.
    reached
        How far the work got that a limit ended.
    """

    text: str
    message: str
    remedy: str | None
    position: Position | None
    exit_code: int
    reached: str | None = None

    @classmethod
    def of(cls, message: str, exit_code: int, remedy: str) -> Failure:
        """A failure that no error of coordlang stands for."""
        text = f"coordlang: {message}\n"
        if exit_code < _SIGNALS:
            text += f"  {remedy}\n"
        return cls(text, message, remedy, None, exit_code)

    @classmethod
    def of_error(cls, error: CoordlangError) -> Failure:
        """A failure by an error of coordlang."""
        text = f"coordlang: {error}\n"
        code = error.exit_code
        return cls(text, error.what, error.remedy, error.position, code, error.reached)

    def json(self) -> str:
        """Return the object that ``--json`` gives in place of an answer (docs/formats.md)."""
        error: dict[str, Any] = {
            "message": sentence(self.message),
            "position": None if self.position is None else _place(self.position),
            "remedy": None if self.remedy is None else sentence(self.remedy, keep="\n"),
            "exit_code": self.exit_code,
        }
        if self.reached is not None:
            error["reached"] = sentence(self.reached)
        return json.dumps({"error": error})


#: The longer spelling of ``--json``.
_FORM = "--format", "json"
#: From here on exit codes are of signals, which need no remedy on the terminal.
_SIGNALS = 128


def _place(position: Position) -> dict[str, Any]:
    line, column = (position.line, position.column) if position.line else (None, None)
    return {"file": sentence(position.file), "line": line, "column": column}


def usage_failure(error: click.ClickException) -> Failure:
    """What click says of the arguments."""
    shown = StringIO()
    error.show(file=shown)
    text = sentence(shown.getvalue(), keep="\n")
    context = getattr(error, "ctx", None)
    path = context.command_path if context is not None else "coordlang"
    return Failure(text, error.format_message(), f"See `{path} --help`.", None, 2)


def wants_json(arguments: Sequence[str]) -> bool:
    """Whether these arguments ask for JSON, ``--json`` or ``--format json``."""
    before = list(arguments[: arguments.index("--")] if "--" in arguments else arguments)
    return bool({"--json", "--format=json"} & {*before}) or _FORM in pairwise(before)
