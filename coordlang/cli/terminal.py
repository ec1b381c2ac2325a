# SPDX-License-Identifier: GPL-3.0-or-later
"""What goes to stderr besides errors: progress on a terminal, notes and warnings."""

from __future__ import annotations

import shutil
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from threading import Timer
from typing import TYPE_CHECKING

from coordlang.cli.echo import echo
from coordlang.cli.exit_codes import REFUTED
from planners.messages import visible

if TYPE_CHECKING:
    from coordlang.api.languages import Progress

#: Seconds of work before progress is shown: short commands neither flicker nor load rich.
_DELAY = 0.4
#: Narrower terminals break lines themselves.
_LEAST_WIDTH = 60


def line_width(*, err: bool = False) -> int:
    """The width of the terminal that stdout or stderr is, `WIDTH` where it is none."""
    from coordlang.api.layout import WIDTH

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
    spinner = _Spinner(visible(message))
    try:
        yield lambda text: spinner.say(visible(text))
    finally:
        spinner.stop()


class _Spinner:
    """A spinner with a message, which appears after a while."""

    def __init__(self, message: str) -> None:
        self._message = message
        self._lock = threading.Lock()
        self._ended = False
        self._update: Callable[[str], None] = lambda _: None
        self._stop: Callable[[], None] = lambda: None
        self._timer = Timer(_DELAY, self._start)
        self._timer.daemon = True
        self._timer.start()

    def say(self, message: str) -> None:
        with self._lock:
            self._message = message
            self._update(message)

    def stop(self) -> None:
        self._timer.cancel()
        with self._lock:
            self._ended = True
            self._stop()

    def _start(self) -> None:
        from rich.console import Console
        from rich.text import Text

        with self._lock:
            if self._ended:
                return
            status = Console(stderr=True).status(Text(f"{self._message} .."))
            self._update = lambda message: status.update(Text(f"{message} .."))
            self._stop = status.stop
            status.start()


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


def covered_code(is_covered: bool) -> int:
    """Return the exit code of an answer: 1, with a warning, for a task that is not covered."""
    if is_covered:
        return 0
    echo(
        "coordlang: warning: the language does not cover this task: it guarantees nothing here",
        err=True,
    )
    return REFUTED
