# SPDX-License-Identifier: GPL-3.0-or-later
"""Worker processes of this machine: an executor that can be ended at any moment.

A worker ends when its parent does and when it is asked to (SIGTERM, and SIGINT and SIGHUP unless
they are ignored: ``nohup``); what is half written is removed then.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing import get_context, parent_process, resource_tracker
from multiprocessing.connection import wait
from multiprocessing.process import BaseProcess
from types import FrameType, ModuleType
from typing import Any

from planners.parallel.batch import Batch, Outcome, Packed
from planners.system.errors import OutOfMemory, UsageError
from planners.system.limits import address_space, lacks_memory, limit_memory, load_libraries
from planners.system.signals import ENDING, postponed_signals

#: Seconds in which a worker that is asked to end cleans up.
_STOPPING = 1.0
#: The exit code of a worker that was asked to end.
_ASKED_TO_END = 75
#: With as many workers as cores each has one thread, where BLAS would take all cores.
_THREADS = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"), "1")


@contextmanager
def in_processes(
    batch: Batch, jobs: Sequence[Any], count: int, memory: int | None
) -> Iterator[list[Future[Outcome]]]:
    """Have some jobs of a batch done by ``count`` processes, which end with the block.

    ``memory`` are the bytes that each may take beyond what its libraries need; None: no limit.
    Raises `BrokenExecutor` if a process is lost, `UsageError` or `OutOfMemory` if none can be
    started.
    """
    executor = ProcessPoolExecutor(count, get_context("spawn"), _begin, (Packed(batch), memory))
    started = executor._processes  # before Python 3.14 nothing public knows or ends them
    try:
        with _spawning():
            futures = [executor.submit(_do, job) for job in jobs]
            # An executor watches the processes that were there when it was last asked something.
            executor.submit(int)
        yield futures
    except OSError as error:
        if any(process.exitcode is not None for process in started.values()):
            raise BrokenProcessPool(f"a worker ended as it was started: {error}") from None
        kind = OutOfMemory if lacks_memory(error) else UsageError
        raise kind(
            f"worker processes cannot be started: {error.strerror or error}",
            remedy="Use --jobs 1, which needs none, or raise the limits on processes and memory.",
        ) from None
    finally:
        with postponed_signals():
            _end([*started.values()])
            executor.shutdown(cancel_futures=True)


def _end(started: Sequence[BaseProcess]) -> None:
    """End processes, by force where they do not end by themselves."""
    for process in started:
        process.terminate()
    left, end = {process.sentinel for process in started}, time.monotonic() + _STOPPING
    while left and (seconds := end - time.monotonic()) > 0:
        left.difference_update(wait(left, seconds))
    for process in started:
        process.kill()


@contextmanager
def _spawning() -> Iterator[None]:
    """Start processes in the block that nothing of this one disturbs.

    They are not told of the script that runs here, which may have no main guard, and hear signals
    when they are ready.
    """
    with postponed_signals():
        resource_tracker.ensure_running()  # it would unblock the signals
        mask = signal.pthread_sigmask(signal.SIG_BLOCK, ENDING)
        main, environment = sys.modules["__main__"], dict(os.environ)
        try:
            sys.modules["__main__"] = ModuleType("__main__")
            os.environ.update(_THREADS)
            yield
        finally:
            sys.modules["__main__"] = main
            for name in _THREADS.keys() - environment.keys():
                del os.environ[name]
            os.environ.update(environment)
            signal.pthread_sigmask(signal.SIG_SETMASK, mask)


# ---- in a worker

#: Does a job of the batch that this process works on.
_attempt: Callable[[Any], Outcome]


def _begin(work: Packed, memory: int | None) -> None:
    """Prepare this process: output, signals, and so many bytes more than its libraries take."""
    global _attempt
    _attempt = work.attempt
    nowhere = os.open(os.devnull, os.O_RDWR)
    for standard in range(3):
        os.dup2(nowhere, standard)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    for number in ENDING:
        # SIGTERM is how the parent asks.
        if number == signal.SIGTERM or signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, _asked_to_end)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, ENDING)
    if memory is not None:
        load_libraries()
        limit_memory(address_space() + memory)


def _do(job: Any) -> Outcome:
    try:
        return _attempt(job)
    except SystemExit:  # all has been cleaned up; the executor would send it as a result
        os._exit(_ASKED_TO_END)


def _asked_to_end(_signal: int, _frame: FrameType | None) -> None:
    for number in ENDING:  # the executor asks again once another worker has ended
        signal.signal(number, signal.SIG_IGN)
    sys.exit(_ASKED_TO_END)


def _end_with_parent() -> None:
    parent = parent_process()
    assert parent is not None
    parent.join()
    os._exit(1)
