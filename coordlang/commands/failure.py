# SPDX-License-Identifier: GPL-3.0-or-later
"""What ends a command without its answer: an exit code, text, and with ``--json`` an object."""

from __future__ import annotations

import errno
import json
import signal
from collections.abc import Sequence
from dataclasses import dataclass
from io import StringIO
from itertools import pairwise
from typing import Any

import click

from planners.system.errors import CoordlangError, OutOfMemory, Position
from planners.system.limits import lacks_memory
from planners.system.messages import sentence
from planners.system.signals import Interrupted

# Exit codes that are of no error of the one error tree (docs/cli.md, exit codes).

#: The answer is no: refuted, or nothing is guaranteed.
REFUTED = 1
#: An answer without the proof that was asked for.
UNPROVED = 3
#: It is proved that there is no plan.
IMPOSSIBLE = 11
#: Interrupted from the keyboard.
INTERRUPTED = 130
#: As a shell reports a process whose reader has gone: the answer did not arrive.
BROKEN_PIPE = 141

#: From here on exit codes are of signals, which need no remedy on the terminal.
_SIGNALS = 128
#: The output cannot be written: what stdout is connected to is full, or of limited size.
_UNWRITABLE = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EROFS, errno.EIO, errno.EBADF)


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


def failure_of(error: BaseException, number: int | None) -> Failure:
    """Say what is wrong and what to do; a bug is reported as one, and never hidden.

    ``number`` is the signal that has arrived, None if none has.  Where one has, it is what ended
    the work, whatever error a library made of it.  So is memory that is used up.
    """
    match error:
        case KeyboardInterrupt() | click.Abort():
            return _interrupted(number)
        case Exception() if number is not None:
            return _interrupted(number)
        case click.ClickException():
            return _usage(error)
        case OSError() if error.errno in _UNWRITABLE:
            what = f"the output cannot be written: {error.strerror}"
            return _other(what, 2, "Make room, or name another file.")
        case CoordlangError():
            text, code = f"coordlang: {error}\n", error.exit_code
            return Failure(text, error.what, error.remedy, error.position, code, error.reached)
    if lacks_memory(error):
        remedy = "Use a smaller task, or a larger --memory-limit."
        return _other("out of memory", OutOfMemory.exit_code, remedy)
    what = f"internal error: {type(error).__name__}: {sentence(str(error))}"
    return _other(what, CoordlangError.exit_code, "This is a bug; --debug shows where.")


def why_stopped(stopped: BaseException) -> str:
    """What ended work whose best result is kept, in one line."""
    if isinstance(stopped, KeyboardInterrupt):
        return "interrupted"
    return str(stopped).splitlines()[0] if str(stopped) else "out of memory"


def code_of_interrupt(stopped: KeyboardInterrupt) -> int:
    """The exit code after an interrupt, by the keyboard or by a signal, as a shell reports it."""
    return _SIGNALS + stopped.number if isinstance(stopped, Interrupted) else INTERRUPTED


def wants_json(arguments: Sequence[str]) -> bool:
    """Whether these arguments ask for JSON, ``--json`` or ``--format json``."""
    before = list(arguments[: arguments.index("--")] if "--" in arguments else arguments)
    is_short = not {"--json", "--format=json"}.isdisjoint(before)
    return is_short or ("--format", "json") in pairwise(before)


def _interrupted(number: int | None) -> Failure:
    by = "" if number in (None, signal.SIGINT) else f" by {signal.Signals(number).name}"
    code = INTERRUPTED if number is None else _SIGNALS + number
    return _other(f"interrupted{by}", code, "Start it again.")


def _usage(error: click.ClickException) -> Failure:
    """What click says of the arguments."""
    shown = StringIO()
    error.show(file=shown)
    context = getattr(error, "ctx", None)
    path = context.command_path if context is not None else "coordlang"
    text = sentence(shown.getvalue(), keep="\n")
    return Failure(text, error.format_message(), f"See `{path} --help`.", None, 2)


def _other(message: str, exit_code: int, remedy: str) -> Failure:
    """A failure that no error of coordlang stands for."""
    text = f"coordlang: {message}\n"
    if exit_code < _SIGNALS:
        text += f"  {remedy}\n"
    return Failure(text, message, remedy, None, exit_code)


def _place(position: Position) -> dict[str, Any]:
    line, column = (position.line, position.column) if position.line else (None, None)
    return {"file": sentence(position.file), "line": line, "column": column}
