# SPDX-License-Identifier: GPL-3.0-or-later
"""What ends a command without its answer: an exit code, text, and with ``--json`` an object."""

from __future__ import annotations

import errno
import json
import signal
from collections.abc import Sequence
from io import StringIO
from itertools import pairwise
from typing import Any

import click

from planners.system.errors import CoordlangError, OutOfMemory, UsageError
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


def failure_of(error: BaseException, number: int | None) -> tuple[str, CoordlangError]:
    """What stderr shows of an error, and the error that it is in the one error tree.

    A bug is reported as one, and never hidden.  ``number`` is the signal that has arrived, None if
    none has.  Where one has, it is what ended the work, whatever error a library made of it.  So is
    memory that is used up.
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
            return _other(what, UsageError.exit_code, "Make room, or name another file.")
        case CoordlangError():
            return f"coordlang: {error}\n", error
    if lacks_memory(error):
        remedy = "Use a smaller task, or a larger --memory-limit."
        return _other("out of memory", OutOfMemory.exit_code, remedy)
    what = f"internal error: {type(error).__name__}: {sentence(str(error))}"
    return _other(what, CoordlangError.exit_code, "This is a bug; --debug shows where.")


def error_json(error: CoordlangError) -> str:
    """The object that ``--json`` gives in place of an answer (docs/formats.md)."""
    place = error.position
    position = None
    if place is not None:
        line, column = (place.line, place.column) if place.line else (None, None)
        position = {"file": sentence(place.file), "line": line, "column": column}
    entry: dict[str, Any] = {
        "message": sentence(error.what),
        "position": position,
        "remedy": None if error.remedy is None else sentence(error.remedy, keep="\n"),
        "exit_code": error.exit_code,
    }
    if error.reached is not None:
        entry["reached"] = sentence(error.reached)
    return json.dumps({"error": entry})


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


def _interrupted(number: int | None) -> tuple[str, CoordlangError]:
    by = "" if number in (None, signal.SIGINT) else f" by {signal.Signals(number).name}"
    code = INTERRUPTED if number is None else _SIGNALS + number
    return _other(f"interrupted{by}", code, "Start it again.")


def _usage(error: click.ClickException) -> tuple[str, CoordlangError]:
    """What click says of the arguments."""
    shown = StringIO()
    error.show(file=shown)
    context = getattr(error, "ctx", None)
    path = context.command_path if context is not None else "coordlang"
    usage = UsageError(error.format_message(), remedy=f"See `{path} --help`.")
    return sentence(shown.getvalue(), keep="\n"), usage


def _other(message: str, exit_code: int, remedy: str) -> tuple[str, CoordlangError]:
    """A failure that no error of coordlang stands for."""
    made = CoordlangError(message, remedy=remedy)
    made.exit_code = exit_code
    text = f"coordlang: {message}\n"
    return text + f"  {remedy}\n" * (exit_code < _SIGNALS), made
