# SPDX-License-Identifier: GPL-3.0-or-later
"""A worker process as its parent sees it: started, given pieces, asked for answers, ended."""

from __future__ import annotations

import os
import pickle
import signal
import socket
import subprocess
import sys
from collections.abc import Sequence
from contextlib import suppress
from multiprocessing.connection import Connection, wait
from pathlib import Path
from time import perf_counter
from typing import Any

from planners.errors import CoordlangError, OutOfMemory
from planners.pieces.work import Done, Work
from planners.pieces.worker import ASKED_TO_END
from planners.signals import postponed_signals

#: Seconds in which a worker that is asked to end cleans up.
_STOPPING = 1.0
#: As many threads as there are processes is one each: BLAS would take all cores for each of them.
_ENVIRONMENT = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}


class WorkerLost(Exception):
    """The process of a worker is gone.

    Parameters
    ----------
    asked
        Whether it was asked to end, by a signal to it alone.
    """

    def __init__(self, asked: bool) -> None:
        super().__init__("a worker process is gone")
        self.asked = asked


#: What to do about a bug.
_BUG = "This is a bug; --jobs 1 --debug shows where."


class WorkFailed(CoordlangError):
    """A piece ended with an error that cannot be sent: a bug."""


class WorkerProcess:
    """A process that does one piece after another.

    Parameters
    ----------
    memory
        Bytes that it may take beyond what its libraries need; None: no limit of its own.
    """

    def __init__(self, memory: int | None = None) -> None:
        ours, theirs = socket.socketpair()
        home = str(Path(__file__).resolve().parents[2])
        path = [home, *(entry or os.getcwd() for entry in sys.path)]
        arguments = [str(theirs.fileno()), str(os.getpid())]
        with postponed_signals():
            self._process = subprocess.Popen(
                # -P: the working directory is in the path only where it is in ours.
                [sys.executable, "-P", "-m", "planners.pieces.worker", *arguments],
                env={**os.environ, **_ENVIRONMENT, "PYTHONPATH": os.pathsep.join(path)},
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
                pass_fds=[theirs.fileno()],
            )
        theirs.close()
        self.connection = Connection(ours.detach())
        #: The number of the piece under way, None without one.
        self.number: int | None = None
        self._since = 0.0
        self._work = b""
        with suppress(ConnectionError):  # it is gone already: the answer will say so
            self.connection.send((path, memory))

    @property
    def pid(self) -> int:
        """The number of the process."""
        return self._process.pid

    def begin(self, number: int, work: bytes, piece: bytes) -> None:
        """Send a piece, and the work that it belongs to where that is another one than before."""
        self.number, self._since = number, perf_counter()
        with suppress(ConnectionError):
            if work != self._work:
                self.connection.send(("work", work))
                self._work = work
            self.connection.send(("piece", piece))

    def ready(self, seconds: float) -> bool:
        """Whether there is an answer, or the process is gone; waits so long for it."""
        return bool(wait([self.connection], timeout=seconds))

    def answer(self) -> Done:
        """The piece that was under way, which must be `ready`.

        Raises
        ------
        WorkerLost
            If the process is gone.
        """
        assert self.number is not None
        number, self.number = self.number, None
        answer, seconds, cpu = self._received()
        match answer:
            case "done", table:
                return Done(number, table, None, None, seconds, cpu)
            case "error", packed, text, where:
                return Done(number, None, _as_raised(packed, text, where), None, seconds, cpu)
        raise AssertionError(answer)

    def _received(self) -> Any:
        try:
            return self.connection.recv()
        except (EOFError, ConnectionError, pickle.UnpicklingError):
            raise WorkerLost(self.kill() == ASKED_TO_END) from None

    @property
    def busy_for(self) -> float:
        """Seconds since the piece under way was begun."""
        return perf_counter() - self._since

    def ask_to_end(self) -> None:
        """Send the signal after which it removes what it is half through writing."""
        if self._process.poll() is None:
            with suppress(ProcessLookupError):
                self._process.send_signal(signal.SIGTERM)

    def kill(self) -> int:
        """End the process, by force where it does not end by itself; its exit code."""
        self.ask_to_end()
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(_STOPPING)
        self._process.kill()
        self.connection.close()
        return self._process.wait()


def end_all(workers: Sequence[WorkerProcess]) -> None:
    """End several workers together."""
    with postponed_signals():
        for worker in workers:
            worker.ask_to_end()
        for worker in workers:
            worker.kill()


def packed_work(work: Work) -> bytes:
    """What a worker must know of a work besides its pieces."""
    return pickle.dumps((work.function, work.shared), pickle.HIGHEST_PROTOCOL)


def packed_piece(work: Work, number: int) -> bytes:
    """One of its pieces."""
    return pickle.dumps(work.pieces[number], pickle.HIGHEST_PROTOCOL)


def lost_for_good(work: Work) -> OutOfMemory:
    """The error for a piece whose workers die: the system ends those first that take most."""
    return OutOfMemory(
        f"{work.name}: a piece of the work lost its process twice: there is no memory for it",
        remedy="Use fewer --jobs, or smaller or fewer tasks.",
    )


def _as_raised(packed: bytes | None, text: str, where: str) -> BaseException:
    """An error as the worker sent it, with a note of where it was raised there."""
    error: Any = WorkFailed(text, remedy=_BUG) if packed is None else pickle.loads(packed)
    assert isinstance(error, BaseException)
    error.add_note(f"in a worker process:\n{where}")
    return error
