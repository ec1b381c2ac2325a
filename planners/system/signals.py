# SPDX-License-Identifier: GPL-3.0-or-later
"""Signals: those that end the process clean up first, and some work is not disturbed by any."""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from types import FrameType

#: What ends a process, as a person, a scheduler of jobs and a terminal (not on Windows) send it.
ENDING = tuple(getattr(signal, n) for n in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, n))
#: Seconds until an interrupt that Python lost is sent again.
_SOON = 0.01


class Interrupted(KeyboardInterrupt):
    """A signal ends the work, wherever it is: the ``number`` of one of `ENDING`."""

    def __init__(self, number: int) -> None:
        super().__init__(signal.Signals(number).name)
        self.number = number


class Interruptions:
    """Raises `Interrupted` for the signals `ENDING` from now on (main thread only).

    A signal that the process was started to ignore stays ignored (``nohup``, jobs in the
    background of a shell).  ``first`` is the first one that has arrived, or None: the exception may
    be lost, for libraries in C turn it into errors of their own.
    """

    def __init__(self) -> None:
        self.first: int | None = None
        self._over = False
        self._lost_before = sys.unraisablehook
        sys.unraisablehook = self._lost
        for number in ENDING:
            if signal.getsignal(number) is not signal.SIG_IGN:
                signal.signal(number, self._arrive)

    def end(self) -> None:
        """From here on a signal ends the process at once: nothing is left to clean up."""
        self._over = True

    def _arrive(self, number: int, _frame: FrameType | None) -> None:
        if self.first is None:
            self.first = number
        if not self._over:
            raise Interrupted(number)
        signal.signal(number, signal.SIG_DFL)
        signal.raise_signal(number)

    def _lost(self, unraisable: sys.UnraisableHookArgs) -> None:
        """Send the signal again: no exception can leave a finalizer or a callback."""
        if not isinstance(unraisable.exc_value, Interrupted):
            self._lost_before(unraisable)
            return
        again = threading.Timer(_SOON, os.kill, (os.getpid(), unraisable.exc_value.number))
        again.daemon = True
        again.start()


class Postponed:
    """Signals that wait until work is done that must not be left half done."""

    def __init__(self) -> None:
        self._handlers: dict[int, Callable[[int, FrameType | None], object]] = {}
        #: The signals that wait.
        self.arrived: list[int] = []
        self._heard = False

    @contextmanager
    def heard(self) -> Iterator[None]:
        """Hear signals in the block, those that have arrived at its beginning.

        After it they wait again, so that none disturbs what cleans up.
        """
        self._heard = True
        try:
            self._send_again()
            yield
        finally:
            self._heard = False

    def begin(self) -> None:
        """Let the signals wait that have a handler in Python."""
        for number in range(1, signal.NSIG):
            handler = signal.getsignal(number)
            if callable(handler):
                self._handlers[number] = handler
                signal.signal(number, self._arrive)

    def end(self) -> None:
        """Give the signals their handlers back, and hear those that have arrived."""
        self._heard = True  # a handler that is left, should one signal disturb this, passes it on
        try:
            for number, handler in self._handlers.items():
                signal.signal(number, handler)
        finally:
            self._send_again()

    def _send_again(self) -> None:
        with ExitStack() as all_of_them:  # whatever their handlers raise
            while self.arrived:
                all_of_them.callback(signal.raise_signal, self.arrived.pop())

    def _arrive(self, number: int, frame: FrameType | None) -> None:
        if self._heard:
            self._handlers[number](number, frame)
        else:
            self.arrived.append(number)


@contextmanager
def postponed_signals() -> Iterator[Postponed]:
    """Let signals with a handler in Python wait until the block ends, or `Postponed.heard`.

    For short work that must not be left half done.  In other threads than the main one handlers
    never run, and nothing is to be done.
    """
    postponed = Postponed()
    try:
        if threading.current_thread() is threading.main_thread():
            postponed.begin()
        yield postponed
    finally:
        postponed.end()
