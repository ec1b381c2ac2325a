# SPDX-License-Identifier: GPL-3.0-or-later
"""What goes to stderr besides errors: progress on a terminal, notes and warnings."""

from __future__ import annotations

import shutil
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from time import monotonic
from typing import TYPE_CHECKING

from coordlang.commands.echo import echo
from coordlang.commands.exit_codes import REFUTED
from planners.system.messages import visible

if TYPE_CHECKING:
    from coordlang.commands.languages import Progress
    from coordlang.language.tolerance import Tolerance
    from planners.system.limits import Underway

#: Seconds of work before progress is shown: short commands neither flicker nor load rich.
_DELAY = 0.4
#: Seconds between two looks at how far the work got.
_INTERVAL = 0.5
#: Narrower terminals break lines themselves.
_LEAST_WIDTH = 60


def line_width(*, err: bool = False) -> int:
    """The width of the terminal that stdout or stderr is, `WIDTH` where it is none."""
    from coordlang.commands.layout import WIDTH

    stream = sys.stderr if err else sys.stdout
    if stream is None or not stream.isatty():
        return WIDTH
    return max(_LEAST_WIDTH, shutil.get_terminal_size((WIDTH, 24)).columns)


@contextmanager
def working(message: str) -> Iterator[Progress]:
    """Show on a terminal what is being done, until the block ends.

    Yields a function that changes the message.
    """
    if sys.stderr is None or not sys.stderr.isatty():
        yield lambda _: None
        return
    spinner = _Spinner(message)
    try:
        yield spinner.say
    finally:
        spinner.stop()


class _Spinner:
    """A spinner with a message and how far the work got, which appears after a while."""

    def __init__(self, message: str) -> None:
        self._message = message
        self._begin = monotonic()
        self._rate = _Rate()
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def say(self, message: str) -> None:
        self._message = message

    def stop(self) -> None:
        self._ended.set()
        self._thread.join()

    def _run(self) -> None:
        if self._ended.wait(_DELAY):
            return
        from rich.console import Console
        from rich.text import Text

        with Console(stderr=True).status(Text(self._text())) as status:
            while not self._ended.wait(_INTERVAL):
                status.update(Text(self._text()))

    def _text(self) -> str:
        parts = [self._message, *self._so_far()]
        seconds = monotonic() - self._begin
        return f"{visible(': '.join(parts))} .. {seconds:.0f} s"

    def _so_far(self) -> list[str]:
        """How far the work got, and how fast it goes; nothing if it changed while it was read."""
        from planners.system.limits import underway

        part = underway()
        if part is None:
            return []
        with suppress(ValueError, IndexError, KeyError, RuntimeError, StopIteration):
            text = part.so_far()
            if text not in self._message:
                return [text + self._rate.of(part)]
        return []


class _Rate:
    """How fast the work of a block goes, from one look to the next."""

    def __init__(self) -> None:
        self._part: Underway | None = None
        self._seen = (0.0, 0)

    def of(self, part: Underway) -> str:
        """Its work in a second since the last look; empty at the first one."""
        if part.work is None:
            return ""
        before, self._seen = self._seen, (monotonic(), part.work())
        known, self._part = self._part is part, part
        if not known or self._seen[0] <= before[0]:
            return ""
        rate = (self._seen[1] - before[1]) / (self._seen[0] - before[0])
        return f", {rate:,.0f} {part.unit} a second"


@contextmanager
def bar() -> Iterator[Callable[[int, int, str], None]]:
    """Show a progress bar on a terminal, until the block ends.

    Yields a function that is told the number done, the number of all, and what is under way.
    """
    if sys.stderr is None or not sys.stderr.isatty():
        yield lambda done, number, text: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn

    columns = MofNCompleteColumn(), BarColumn(), TextColumn("{task.description}", markup=False)
    with Progress(*columns, console=Console(stderr=True), transient=True) as progress:
        task = progress.add_task("")
        yield lambda done, number, text: progress.update(
            task, completed=done, total=number, description=visible(text)
        )


def note_single_robot(robots: tuple[str, ...]) -> None:
    """Write a note where there is one robot: it is no error, but there is nothing to coordinate."""
    if len(robots) == 1:
        echo(
            f"coordlang: note: {robots[0]} is the only robot: there is nothing to coordinate",
            err=True,
        )


def warn_of_failures(tolerance: Tolerance | None) -> None:
    """Write a warning where words are in use under which robots may miscoordinate."""
    if tolerance is not None and tolerance.warning is not None:
        echo(f"coordlang: warning: {tolerance.warning}", err=True)


def covered_code(is_covered: bool, tolerance: Tolerance | None) -> int:
    """Return the exit code of an answer: 1, with a warning, for a task that is not covered.

    What the language tolerates is a warning, too.
    """
    warn_of_failures(tolerance)
    if is_covered:
        return 0
    echo(
        "coordlang: warning: the language does not cover this task: it guarantees nothing here",
        err=True,
    )
    return REFUTED
