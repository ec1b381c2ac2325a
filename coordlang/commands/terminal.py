# SPDX-License-Identifier: GPL-3.0-or-later
"""What commands write to stdout and stderr, and the progress that a terminal shows meanwhile."""

from __future__ import annotations

import io
import json
import os
import re
import sys
import textwrap
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from functools import partial
from itertools import zip_longest
from time import monotonic
from typing import TYPE_CHECKING, Any, TextIO

import click

from planners.system.errors import note
from planners.system.limits import underway
from planners.system.messages import visible
from planners.system.signals import Interrupted

if TYPE_CHECKING:
    from coordlang.language.provenance import Tolerance

# Exit codes that are of no error of the one error tree (docs/cli.md, exit codes).

#: The answer is no: refuted, or nothing is guaranteed.
REFUTED = 1
#: An answer without the proof that was asked for.
UNPROVED = 3
#: From here on exit codes are of signals.
SIGNALS = 128
#: Interrupted from the keyboard.
INTERRUPTED = 130
#: As a shell reports a process whose reader has gone: the answer did not arrive.
BROKEN_PIPE = 141

#: Where the context of a command has what shows its progress.
SAYING = "coordlang.saying"
#: Where what `coordlang.commands.main.run` hands to a command says that stdout has been written to.
WRITTEN = "written"
#: Seconds of work before progress is shown: short commands neither flicker nor load rich.
_DELAY = 0.4
#: Seconds between two looks at how far the work got.
_INTERVAL = 0.5
#: Narrower terminals break lines themselves.
_LEAST_WIDTH = 60
#: The file number of stderr.
_STDERR = 2


def echo(text: object, *, err: bool = False, nl: bool = True, fit: bool = False) -> None:
    """Write text like `click.echo`, with control characters escaped, in lines that ``fit``.

    Names of files and arguments may hold any character, and escapes of a terminal among them.
    """
    context = click.get_current_context(silent=True)
    if not err and context is not None and context.obj is not None:
        context.obj[WRITTEN] = True
    text = fitted(str(text), line_width(err=err)) if fit else str(text)
    click.echo(visible(text, keep="\n\t"), err=err, nl=nl)


def write(data: str | bytes, output: str | None, said: str | None = None) -> None:
    """Write to a file (gzip for ``.gz``), or to stdout without one or for ``-``.

    What is ``said`` of it goes to the other stream: to stderr where the data go to stdout.
    """
    if output is None or output == "-":
        echo(data if isinstance(data, str) else data.decode(), nl=False)
    else:
        from planners.system.writing import write_compressed

        write_compressed(output, data.encode() if isinstance(data, str) else data, level=6)
    if said is not None:
        echo(said, err=output in (None, "-"))


def show_answer(found: Any, *, as_json: bool) -> None:
    """Write the ``data`` of a result as one JSON object, or its ``text`` as wide as the page."""
    echo(json.dumps(found.data()) if as_json else found.text(), fit=not as_json)


def tell(text: str) -> None:
    """Write a line about the work to stderr."""
    echo(f"coordlang: {text}", err=True)


def note_single_robot(robots: tuple[str, ...]) -> None:
    """Write a note where there is one robot: it is no error, but there is nothing to coordinate."""
    if len(robots) == 1:
        note(f"{robots[0]} is the only robot: there is nothing to coordinate")


def warn_of_failures(tolerance: Tolerance | None) -> None:
    """Write a warning where words are in use under which robots may miscoordinate."""
    if tolerance is not None and tolerance.warning is not None:
        tell(f"warning: {tolerance.warning}")


def covered_code(found: Any) -> int:
    """Return the exit code of an answer: 1, with a warning, for a task that is not covered.

    What the language tolerates is a warning, too.
    """
    warn_of_failures(found.tolerance)
    if found.covered:
        return 0
    tell("warning: the language does not cover this task: it guarantees nothing here")
    return REFUTED


def ended_early(stopped: BaseException | None, what: str, kept: str = "") -> int:
    """The exit code of work whose best result is kept; says what ended it, and ``what`` there is.

    0 if nothing did.  ``kept`` is what the time that was over left.
    """
    if stopped is None:
        return 0
    if isinstance(stopped, KeyboardInterrupt):
        tell(f"interrupted; {what}")
        return SIGNALS + stopped.number if isinstance(stopped, Interrupted) else INTERRUPTED
    reason = "out of memory" if isinstance(stopped, MemoryError) else str(stopped).splitlines()[0]
    tell(f"{reason}{kept}; {what}")
    return UNPROVED


def line_width(*, err: bool = False) -> int:
    """The width of the terminal that stdout or stderr is, `WIDTH` where it is none."""
    stream = sys.stderr if err else sys.stdout
    if stream is None or not stream.isatty():
        return WIDTH
    import shutil

    return max(_LEAST_WIDTH, shutil.get_terminal_size((WIDTH, 24)).columns)


def say(text: str) -> None:
    """Tell whoever waits for a command what is being done; outside of one nobody waits."""
    context = click.get_current_context(silent=True)
    if context is not None and SAYING in context.meta:
        context.meta[SAYING](text)


@contextmanager
def working(message: str) -> Iterator[Callable[[str], None]]:
    """Show on a terminal what the block does; yields a function that changes the message."""
    if sys.stderr is None or not sys.stderr.isatty():
        yield lambda _: None
        return
    shown, ended = [message], threading.Event()
    spinner = threading.Thread(target=_spin, args=(shown, ended), daemon=True)
    spinner.start()
    try:
        yield partial(shown.__setitem__, 0)
    finally:
        ended.set()
        spinner.join()


def _spin(shown: list[str], ended: threading.Event) -> None:
    """Show a spinner with a message and how far the work got, after a while."""
    begin = monotonic()
    if ended.wait(_DELAY):
        return
    from rich.console import Console
    from rich.text import Text

    with Console(stderr=True).status("") as status:
        wait = 0.0
        while not ended.wait(wait):
            (text,), how_far = shown, underway()
            # The work goes on while it is asked: what cannot be read just now is left out.
            with suppress(ValueError, IndexError, KeyError, RuntimeError, StopIteration):
                if how_far is not None and (so_far := how_far()) not in text:
                    text = f"{text}: {so_far}"
            seconds, wait = monotonic() - begin, _INTERVAL
            status.update(Text(f"{visible(text)} .. {seconds:.0f} s"))


def whatever_stderr() -> TextIO:
    """Return a stream for stderr on which nothing fails, be it closed or on a full disk.

    Of the first three file numbers those that are closed are reserved: else the next file that is
    opened would get one, and messages of libraries with it.
    """
    for number in range(_STDERR + 1):
        try:
            os.fstat(number)
        except OSError:  # closed
            os.set_inheritable(os.open(os.devnull, os.O_RDWR), True)
    encoding = sys.stderr.encoding if sys.stderr is not None else "utf-8"
    buffer = io.BufferedWriter(_Lossy(_STDERR, "w", closefd=False))  # type: ignore[type-var]
    return io.TextIOWrapper(buffer, encoding, errors="backslashreplace", line_buffering=True)


class _Lossy(io.FileIO):
    """A file; what cannot be written to it is lost."""

    def write(self, data: bytes) -> int:  # type: ignore[override]
        with suppress(OSError):
            return super().write(data) or len(data)
        return len(data)


def flush_stdout() -> None:
    """Write what stdout still holds; the exit code says already if that failed before."""
    try:
        if sys.stdout is not None:
            sys.stdout.flush()
    except OSError:
        sys.stdout = open(os.devnull, "w")  # noqa: SIM115 - open to the end


# ---- lines of text no wider than a page: atoms are never broken


#: Characters of a line where the output is no terminal.
WIDTH = 120
#: A space at which no line is broken.
HELD = "\xa0"
#: Characters that the last column of a table has at least.
_LEAST_ROOM = 30
#: An atom or an action, and whose it is.
_ATOM = re.compile(r"(?:[^\s()]{1,80}: )?(?:\((?:not|last \S+) )?\([^()]*\)")


def wrapped(text: str, width: int, indent: str, further: str) -> list[str]:
    """Text in lines: the first one begins with ``indent``, the others with ``further``.

    Atoms and actions are not broken: one that is wider than a line has a line of its own.
    """
    held = _ATOM.sub(lambda found: found[0].replace(" ", HELD), text)
    lines = textwrap.wrap(
        held,
        width,
        initial_indent=indent,
        subsequent_indent=further,
        break_long_words=False,
        break_on_hyphens=False,
    )
    return [line.replace(HELD, " ") for line in lines] or [indent.rstrip()]


def fitted(text: str, width: int) -> str:
    """Text whose lines are no wider than a page: the rest of a wider one stands four columns in."""
    lines = []
    for line in text.split("\n"):
        indent = line[: len(line) - len(line.lstrip())]
        lines += wrapped(line.lstrip(), width, indent, f"{indent}    ")
    return "\n".join(lines)


def alike(items: Sequence[object]) -> Iterator[list[int]]:
    """Positions of equal items, grouped; groups in the order of their first positions."""
    left = list(range(len(items)))
    while left:
        yield [n for n in left if items[n] == items[left[0]]]
        left = [n for n in left if items[n] != items[left[0]]]


def columns(
    rows: Sequence[Sequence[str]], width: int, numbers: int = 0, indent: str = "  "
) -> Iterator[str]:
    """Rows of cells as lines, the first ``numbers`` columns to the right.

    A column is as wide as its widest line; the last one is wrapped where it does not fit.
    """
    *sizes, _ = (
        max(len(line) for cell in column for line in cell.split("\n"))
        for column in zip(*rows, strict=True)
    )
    room = max(_LEAST_ROOM, width - sum(sizes) - 2 * len(sizes) - len(indent))
    for row in rows:
        cells = [*(cell.split("\n") for cell in row[:-1]), wrapped(row[-1], room, "", "")]
        for *left, last in zip_longest(*cells, fillvalue=""):
            padded = [
                text.rjust(size) if column < numbers else text.ljust(size)
                for column, (text, size) in enumerate(zip(left, sizes, strict=True))
            ]
            yield f"{indent}{'  '.join([*padded, last])}".rstrip()
