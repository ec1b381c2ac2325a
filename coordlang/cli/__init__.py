# SPDX-License-Identifier: GPL-3.0-or-later
"""The command line: arguments and rendering only.

Data goes to stdout, logs and progress to stderr.  Exit codes are an interface (docs/cli.md).
"""

from __future__ import annotations

import errno
import os
import sys
import traceback
from io import StringIO
from typing import NoReturn

import click

from coordlang.cli.exit_codes import BROKEN_PIPE, INTERRUPTED
from coordlang.cli.group import cli
from planners.errors import CoordlangError, OutOfMemory
from planners.messages import sentence, visible


def main() -> NoReturn:
    """Run the command line and end the process with its exit code."""
    sys.exit(run(sys.argv[1:]))


def run(arguments: list[str]) -> int:
    """Run one command; the exit code.  No traceback reaches a user without ``--debug``."""
    debug = "--debug" in arguments
    try:
        return _run(arguments)
    except (KeyboardInterrupt, click.Abort):
        return _fail("interrupted", INTERRUPTED)
    except OSError as error:
        if error.errno not in (errno.ENOSPC, errno.EIO, errno.EBADF):
            return _internal(error, debug)
        sys.stdout = open(os.devnull, "w")  # noqa: SIM115 - open to the end
        return _fail(f"the output cannot be written: {error.strerror}", 2)
    except MemoryError:
        return _fail(
            "out of memory\n  Use a smaller task, or a larger --memory-limit.",
            OutOfMemory.exit_code,
        )
    except CoordlangError as error:
        if debug:
            _show(traceback.format_exc())
        return _fail(str(error), error.exit_code)
    except Exception as error:
        return _internal(error, debug)


def _run(arguments: list[str]) -> int:
    """Run one command through click; the exit code."""
    try:
        result = cli.main(args=arguments, prog_name="coordlang", standalone_mode=False)
        if sys.stdout is not None:
            sys.stdout.flush()
        return result if isinstance(result, int) else 0
    except click.exceptions.Exit as done:
        return int(done.exit_code)
    except click.ClickException as error:
        shown = StringIO()
        error.show(file=shown)
        _show(sentence(shown.getvalue(), keep="\n"))
        return 2
    except BrokenPipeError:
        # The reader has gone (`| head`): no more output, and no complaint at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return BROKEN_PIPE
    except SystemExit:
        return BROKEN_PIPE  # so ends click a command whose reader has gone


def _internal(error: Exception, debug: bool) -> int:
    """A bug: reported as one, with an exit code of its own, and never hidden."""
    if debug:
        _show("".join(traceback.format_exception(error)))
    what = f"internal error: {type(error).__name__}: {sentence(str(error))}"
    return _fail(f"{what}\n  This is a bug; --debug shows where.", CoordlangError.exit_code)


def _fail(message: str, code: int) -> int:
    _show(f"coordlang: {message}\n")
    return code


def _show(text: str) -> None:
    print(visible(text, keep="\n"), end="", file=sys.stderr)
