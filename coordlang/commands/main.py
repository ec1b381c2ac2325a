# SPDX-License-Identifier: GPL-3.0-or-later
"""The command line: the group of commands, and how one is run.

Data goes to stdout, logs and progress to stderr.  Exit codes are an interface (docs/cli.md).
"""

from __future__ import annotations

import errno
import os
import signal
import sys
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from io import StringIO
from itertools import pairwise
from typing import Any

import click

import coordlang
from coordlang.commands.terminal import BROKEN_PIPE, SIGNALS, echo
from planners.system.errors import CoordlangError, Note, OutOfMemory, UsageError
from planners.system.limits import lacks_memory
from planners.system.messages import sentence, visible
from planners.system.signals import Interruptions

#: The output cannot be written: what stdout is connected to is full, or of limited size.
_UNWRITABLE = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EROFS, errno.EIO, errno.EBADF)


#: Commands by what they are for, each with one line, so that ``--help`` need not import them all.
#: The options of a command are the record of its name in `coordlang.commands.records`.
GROUPS = {
    "Start here": {
        "domains": "List or copy the domains that come with coordlang.",
        "inspect": "Show what was understood of a domain: robots, subactions, constraints.",
        "plans": "Count, list or sample all optimal plans of a task.",
        "coordination": "Decide which tasks require coordination, with a miscoordination shown.",
        "build": "Build a coordination language and verify it.",
        "explain": "Show a language: words as formulas, sentences of a task.",
    },
    "Use a language": {
        "understand": "Count, list, sample or draw the plans that a sentence leaves open.",
        "say": "Print the sentence of an optimal plan.",
        "plan": "Find one optimal plan under a sentence, or under the best sentence.",
        "choices": "Show what each robot may do under a sentence, whatever the others choose.",
        "robot": "Execute one robot's part, beside the processes of the other robots.",
        "simulate": "Let robots with wheels do a task in a simulator.",
        "export": "Write a task under a sentence as PDDL, LTLf or behaviour trees.",
        "report": "Write a page that shows a language: words, sentences, plans played.",
    },
    "Beyond one map": {
        "import": "Write a map or a building as domain, problem and coordinates.",
        "tasks": "Write a task file: a problem with other starts and goals.",
        "lift": "Learn words as functions of features, for all problems of a domain.",
        "ground": "Write the language file of one problem from a lifted language.",
    },
    "Files and checks": {
        "verify": "Check by definition that a file holds a coordination language.",
        "check": "Compare our optimal cost with Fast Downward's.",
        "schema": "Print the JSON Schema of a file format.",
    },
}
COMMANDS = [name for group in GROUPS.values() for name in group]


class _LazyGroup(click.Group):
    """Makes a command from its record; its module is imported when it is called."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return COMMANDS

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in COMMANDS:
            return None
        if cmd_name == "schema":
            from coordlang.commands.schema import command

            return command
        from coordlang.commands.command import Command
        from coordlang.commands.records import record_of

        return Command(record_of(cmd_name))

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        for title, group in GROUPS.items():
            with formatter.section(title):
                formatter.write_dl(list(group.items()))


@click.group(
    cls=_LazyGroup,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110},
)
@click.version_option(coordlang.__version__)
def cli() -> None:
    """Coordination languages for robots that plan on their own and act together.

    DOMAIN and PROBLEM are PDDL files, in that order.
    """


def run(arguments: list[str], interruptions: Interruptions | None = None) -> int:
    """Run one command; the exit code.  No traceback reaches a user without ``--debug``.

    ``interruptions`` look after the signals that end the process, if anything does.
    """
    output: dict[str, bool] = {}
    try:
        return _run(arguments, output)
    except (Exception, KeyboardInterrupt) as error:
        text, known = _failure(error, None if interruptions is None else interruptions.first)
        with suppress(OSError):  # the terminal may be gone
            if "--debug" in arguments and not isinstance(error, click.ClickException):
                import traceback

                _show("".join(traceback.format_exception(error)))
            _show(text)
            if wants_json(arguments) and not output:
                from coordlang.commands.schema import error_json

                echo(error_json(known))
        return known.exit_code


def _run(arguments: list[str], output: dict[str, bool]) -> int:
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
    except BrokenPipeError:  # the reader has gone (`| head`)
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

        def show(message: Warning | str, category: type[Warning], *more: Any, **named: Any) -> None:
            if not issubclass(category, Note):
                python_shows(message, category, *more, **named)
            elif str(message) not in written:
                written.add(str(message))
                _show(f"coordlang: note: {message}\n")

        warnings.showwarning = show
        yield


def _show(text: str) -> None:
    if sys.stderr is not None:  # None: it is closed; stdout is for data
        print(visible(text, keep="\n"), end="", file=sys.stderr)


def _failure(error: BaseException, number: int | None) -> tuple[str, CoordlangError]:
    """What stderr shows of an error, and the error that it is in the one error tree.

    A bug is reported as one, and never hidden.  ``number`` is the signal that has arrived, None if
    none has.  Where one has, it is what ended the work, whatever error a library made of it.  So is
    memory that is used up.
    """
    if isinstance(error, KeyboardInterrupt | click.Abort):
        number = number or signal.SIGINT
    if number is not None:
        by = "" if number == signal.SIGINT else f" by {signal.Signals(number).name}"
        made = CoordlangError(f"interrupted{by}", remedy="Start it again.")
        made.exit_code = SIGNALS + number
        return f"coordlang: {made.what}\n", made
    if isinstance(error, click.ClickException):  # what click says of the arguments
        shown = StringIO()
        error.show(file=shown)
        path = getattr(getattr(error, "ctx", None), "command_path", "coordlang")
        made = UsageError(error.format_message(), remedy=f"See `{path} --help`.")
        return sentence(shown.getvalue(), keep="\n"), made
    made = CoordlangError(
        f"internal error: {type(error).__name__}: {sentence(str(error))}",
        remedy="This is a bug; --debug shows where.",
    )
    if isinstance(error, OSError) and error.errno in _UNWRITABLE:
        what = f"the output cannot be written: {error.strerror}"
        made = UsageError(what, remedy="Make room, or name another file.")
    elif isinstance(error, CoordlangError):
        made = error
    elif lacks_memory(error):
        remedy = "Use a smaller task, or a larger --memory-limit."
        made = OutOfMemory("out of memory", remedy=remedy)
    return f"coordlang: {made}\n", made


def wants_json(arguments: Sequence[str]) -> bool:
    """Whether these arguments ask for JSON, ``--json`` or ``--format json``."""
    before = list(arguments[: arguments.index("--")] if "--" in arguments else arguments)
    is_short = not {"--json", "--format=json"}.isdisjoint(before)
    return is_short or ("--format", "json") in pairwise(before)
