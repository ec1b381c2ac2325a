# SPDX-License-Identifier: GPL-3.0-or-later
"""Work in a fork of this process, in which all libraries are loaded: 0.1 s in place of a second."""

from __future__ import annotations

import os
import signal
import sys
import time
import traceback
from collections.abc import Callable
from dataclasses import dataclass

from planners.system.signals import ENDING
from tests.support.command import Outcome


@dataclass(frozen=True)
class Fork:
    """A fork that works."""

    pid: int
    out: int
    err: int

    def send(self, number: int) -> None:
        os.kill(self.pid, number)

    def ended(self) -> bool:
        """Whether it has ended; it is not waited for."""
        return os.waitid(os.P_PID, self.pid, os.WEXITED | os.WNOHANG | os.WNOWAIT) is not None

    def join(self, timeout: float = 120.0) -> Outcome:
        """Wait for its end; a negative code is the signal that ended it."""
        end = time.monotonic() + timeout
        while (ended := os.waitpid(self.pid, os.WNOHANG))[0] == 0:
            if time.monotonic() > end:
                self.send(signal.SIGKILL)
            time.sleep(0.002)
        said = []
        for pipe in (self.out, self.err):
            with os.fdopen(pipe, "rb") as file:
                said.append(file.read().decode())
        return Outcome(os.waitstatus_to_exitcode(ended[1]), *said)


def fork(work: Callable[[], object]) -> Fork:
    """Work in a fork: exit code of `SystemExit`, 0, or 70 for an error; it may say up to 64 kB."""
    out, err = os.pipe(), os.pipe()
    pid = os.fork()
    if pid:
        os.close(out[1])
        os.close(err[1])
        return Fork(pid, out[0], err[0])
    code = 70
    try:
        os.dup2(out[1], 1)
        os.dup2(err[1], 2)
        os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
        sys.stdout = os.fdopen(1, "w", closefd=False)
        sys.stderr = os.fdopen(2, "w", closefd=False)
        for number in ENDING:
            signal.signal(number, signal.SIG_DFL)
        work()
        code = 0
    except SystemExit as error:
        code = error.code if isinstance(error.code, int) else int(error.code is not None)
    except BaseException:
        traceback.print_exc()
    finally:
        try:
            sys.stdout.flush()
            sys.stderr.flush()
        finally:
            os._exit(code)


def fork_command(*arguments: object, before: Callable[[], object] = lambda: None) -> Fork:
    """Run ``coordlang ..`` in a fork, after ``before``."""

    def work() -> None:
        from coordlang.__main__ import main

        before()
        sys.argv = ["coordlang", *map(str, arguments)]
        main()

    return fork(work)
