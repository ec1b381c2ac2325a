# SPDX-License-Identifier: GPL-3.0-or-later
"""The command line: arguments and rendering only.

Data goes to stdout, logs and progress to stderr.  Exit codes are an interface (docs/cli.md).
"""

from __future__ import annotations

import errno
import os
import signal
import sys
import traceback
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import TextIO

import click

from coordlang.commands.echo import Output, echo
from coordlang.commands.exit_codes import BROKEN_PIPE, INTERRUPTED, interrupted_by
from coordlang.commands.failure import Failure, usage_failure, wants_json
from coordlang.commands.group import cli
from coordlang.commands.standard_error import drop_stdout
from planners.system.errors import CoordlangError, Note, OutOfMemory, UsageError
from planners.system.limits import lacks_memory
from planners.system.messages import sentence, visible
from planners.system.signals import Interruptions

#: The output cannot be written: what stdout is connected to is full, or of limited size.
_UNWRITABLE = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EROFS, errno.EIO, errno.EBADF)


def run(arguments: list[str], interruptions: Interruptions | None = None) -> int:
    """Run one command; the exit code.  No traceback reaches a user without ``--debug``.

    Parameters
    ----------
    interruptions
        What looks after the signals that end the process, None if nothing does.
    """
    output = Output()
    try:
        return _run(arguments, output)
    except (KeyboardInterrupt, click.Abort):
        failure = _interrupted(interruptions)
    except Exception as error:
        if interruptions is not None and interruptions.first is not None:
            failure = _interrupted(interruptions)  # that is what a library made of the interrupt
        else:
            failure = _failed(error, "--debug" in arguments)
    with suppress(OSError):  # the terminal may be gone
        _show(failure.text)
        if wants_json(arguments) and not output.written:
            echo(failure.json())
            if sys.stdout is not None:
                sys.stdout.flush()
    return failure.exit_code


def _run(arguments: list[str], output: Output) -> int:
    """Run one command through click; the exit code."""
    if sys.stdout is None:
        raise UsageError(
            "stdout is closed, and an answer goes there", remedy="Redirect it, to /dev/null say."
        )
    try:
        with _notes_on_stderr():
            result = cli.main(
                args=arguments, prog_name="coordlang", standalone_mode=False, obj=output
            )
        sys.stdout.flush()
        return result if isinstance(result, int) else 0
    except click.exceptions.Exit as done:
        return int(done.exit_code)
    except BrokenPipeError:
        # The reader has gone (`| head`): no more output, and no complaint at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return BROKEN_PIPE
    except SystemExit as end:
        if "_COORDLANG_COMPLETE" in os.environ:  # so ends click what a shell asks it
            return 2 if end.code else 0
        return BROKEN_PIPE  # so ends click a command whose reader has gone


@contextmanager
def _notes_on_stderr() -> Iterator[None]:
    """Write each note once, as a line of the command; other warnings as Python does."""
    with warnings.catch_warnings():
        warnings.simplefilter("always", Note)
        python_shows, written = warnings.showwarning, set[str]()

        def show(
            message: Warning | str,
            category: type[Warning],
            filename: str,
            lineno: int,
            file: TextIO | None = None,
            line: str | None = None,
        ) -> None:
            if not issubclass(category, Note):
                python_shows(message, category, filename, lineno, file, line)
            elif str(message) not in written:
                written.add(str(message))
                _show(f"coordlang: note: {message}\n")

        warnings.showwarning = show
        yield


def _interrupted(interruptions: Interruptions | None) -> Failure:
    """Say what has ended the work."""
    number = None if interruptions is None else interruptions.first
    by = "" if number in (None, signal.SIGINT) else f" by {signal.Signals(number).name}"
    code = INTERRUPTED if number is None else interrupted_by(number)
    return Failure.of(f"interrupted{by}", code, "Start it again.")


def _failed(error: Exception, debug: bool) -> Failure:
    """Say what is wrong and what to do."""
    match error:
        case click.ClickException():
            return usage_failure(error)
        case OSError() if error.errno in _UNWRITABLE:
            drop_stdout()
            what = f"the output cannot be written: {error.strerror}"
            return Failure.of(what, 2, "Make room, or name another file.")
        case CoordlangError():
            if debug:
                _show("".join(traceback.format_exception(error)))
            return Failure.of_error(error)
    return _internal(error, debug)


def _internal(error: Exception, debug: bool) -> Failure:
    """A bug: reported as one, with an exit code of its own, and never hidden.

    Memory that is used up is none, whatever the error that a library makes of it.
    """
    if lacks_memory(error):
        return Failure.of(
            "out of memory",
            OutOfMemory.exit_code,
            "Use a smaller task, or a larger --memory-limit.",
        )
    if debug:
        _show("".join(traceback.format_exception(error)))
    what = f"internal error: {type(error).__name__}: {sentence(str(error))}"
    return Failure.of(what, CoordlangError.exit_code, "This is a bug; --debug shows where.")


def _show(text: str) -> None:
    if sys.stderr is not None:  # None: it is closed; stdout is for data
        print(visible(text, keep="\n"), end="", file=sys.stderr)
