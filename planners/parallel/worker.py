# SPDX-License-Identifier: GPL-3.0-or-later
"""What runs in a worker process of this machine, and how any worker does a job.

A worker ends when its parent does and when it is asked to (SIGINT, SIGTERM, SIGHUP); what is half
written is removed then.  Nothing large is imported here: the limits come first.
"""

from __future__ import annotations

import os
import pickle
import signal
import threading
import traceback
from multiprocessing import parent_process
from multiprocessing.connection import Connection
from types import FrameType
from typing import Any

from planners.system.errors import CoordlangError
from planners.system.signals import ENDING

#: The exit code of a worker that was asked to end.
_ASKED_TO_END = 75


class Ended(SystemExit):
    """A signal ends the worker, wherever it is."""


class JobFailed(CoordlangError):
    """A job ended with an error that cannot be sent: a bug."""


class _Worker:
    """The batch that this process works on: packed, and unpacked with the first job."""

    packed = b""
    work: tuple[Any, Any] | None = None


def begin(packed: bytes, memory: int | None, ready: Connection) -> None:
    """Prepare this process: signals, output, and so many bytes more than its libraries take."""
    nowhere = os.open(os.devnull, os.O_RDWR)
    for standard in range(3):
        os.dup2(nowhere, standard)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    for number in ENDING:
        signal.signal(number, _end)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, ENDING)
    if memory is not None:
        _limit(memory)
    _Worker.packed = packed
    ready.send_bytes(b"ready")


def do(job: bytes) -> bytes:
    """One job of the batch of this process; see `attempt`."""
    try:
        if _Worker.work is None:
            _Worker.work = pickle.loads(_Worker.packed)
        return attempt(_Worker.work, job)
    except Ended:  # all has been cleaned up; the executor would send it as a result
        os._exit(_ASKED_TO_END)


def attempt(work: tuple[Any, Any], job: bytes) -> bytes:
    """Do a job: its table and None, or None and the error that it has raised, packed."""
    function, shared = work
    try:
        return pickle.dumps((function(shared, pickle.loads(job)), None), pickle.HIGHEST_PROTOCOL)
    except Exception as error:
        error.add_note(f"in a worker:\n{traceback.format_exc()}")
        return _packed(error)


def _packed(error: Exception) -> bytes:
    try:
        packed = pickle.dumps((None, error.with_traceback(None)))
        pickle.loads(packed)
    except Exception:  # whatever the class of the error does when it is copied
        text = f"{type(error).__name__}: {error}"
        bug = JobFailed(text, remedy="This is a bug; --jobs 1 --debug shows where.")
        return pickle.dumps((None, bug))
    return packed


def _limit(memory: int) -> None:
    import numpy as np

    from planners.system.limits import address_space, limit_memory

    np.zeros((8, 8)) @ np.zeros((8, 8))
    limit_memory(address_space() + memory)


def _end(_signal: int, _frame: FrameType | None) -> None:
    raise Ended(_ASKED_TO_END)


def _end_with_parent() -> None:
    """End this process soon after its parent was killed."""
    parent = parent_process()
    assert parent is not None
    parent.join()
    os._exit(1)
