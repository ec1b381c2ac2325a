# SPDX-License-Identifier: GPL-3.0-or-later
"""What runs in a worker process of this machine, and how any worker does a job.

A worker ends when its parent does and when it is asked to (SIGINT, SIGTERM, SIGHUP); what is half
written is removed then.  Nothing large is imported here: limits and threads are set first.
"""

from __future__ import annotations

import os
import pickle
import signal
import threading
import traceback
from multiprocessing import parent_process
from types import FrameType
from typing import Any

from planners.system.signals import ENDING

#: The exit code of a worker that was asked to end.
_ASKED_TO_END = 75
#: With as many workers as cores each has one thread, where BLAS would take all cores.
_THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")


class Ended(SystemExit):
    """A signal ends the worker, wherever it is."""


class _Worker:
    """The batch that this process works on: packed, and unpacked with the first job."""

    packed = b""
    work: tuple[Any, Any] | None = None


def begin(packed: bytes, memory: int | None) -> None:
    """Prepare this process: signals, output, and so many bytes more than its libraries take."""
    nowhere = os.open(os.devnull, os.O_RDWR)
    for standard in range(3):
        os.dup2(nowhere, standard)
    os.environ.update(dict.fromkeys(_THREADS, "1"))
    threading.Thread(target=_end_with_parent, daemon=True).start()
    for number in ENDING:
        signal.signal(number, _end)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, ENDING)
    if memory is not None:
        from planners.system.limits import address_space, limit_memory, load_libraries

        load_libraries()
        limit_memory(address_space() + memory)
    _Worker.packed = packed


def do(job: Any) -> Any:
    """One job of the batch of this process; see `attempt`."""
    try:
        if _Worker.work is None:
            _Worker.work = pickle.loads(_Worker.packed)
        return attempt(_Worker.work, job)
    except Ended:  # all has been cleaned up; the executor would send it as a result
        os._exit(_ASKED_TO_END)


def attempt(work: tuple[Any, Any], job: Any) -> Any:
    """Do a job with a function and what is shared: its table, or the error that it has raised."""
    function, shared = work
    try:
        return function(shared, job)
    except Exception as error:
        error.add_note(f"in a worker:\n{traceback.format_exc()}")
        return error.with_traceback(None)


def _end(_signal: int, _frame: FrameType | None) -> None:
    raise Ended(_ASKED_TO_END)


def _end_with_parent() -> None:
    """End this process soon after its parent was killed."""
    parent = parent_process()
    assert parent is not None
    parent.join()
    os._exit(1)
