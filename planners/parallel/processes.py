# SPDX-License-Identifier: GPL-3.0-or-later
"""Worker processes of this machine: an executor that can be ended at any moment."""

from __future__ import annotations

import pickle
import signal
import sys
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing import resource_tracker
from multiprocessing.connection import wait
from multiprocessing.context import SpawnContext, SpawnProcess
from types import ModuleType
from typing import Any

from planners.parallel.batch import Batch, Outcome
from planners.parallel.worker import begin, do
from planners.system.errors import OutOfMemory, UsageError
from planners.system.limits import lacks_memory
from planners.system.signals import ENDING, postponed_signals

#: Seconds in which a worker that is asked to end cleans up.
_STOPPING = 1.0


@contextmanager
def in_processes(
    batch: Batch, jobs: Sequence[Any], count: int, memory: int | None
) -> Iterator[list[Future[Outcome]]]:
    """Have some jobs of a batch done by ``count`` processes, which end with the block.

    ``memory`` are the bytes that each may take beyond what its libraries need; None: no limit.

    Raises
    ------
    concurrent.futures.BrokenExecutor
        If a process is lost.
    UsageError, OutOfMemory
        If no process can be started.
    """
    context = _Context()
    packed = pickle.dumps((batch.function, batch.shared), pickle.HIGHEST_PROTOCOL)
    executor = ProcessPoolExecutor(count, context, begin, (packed, memory))
    try:
        with _spawning():
            futures = [executor.submit(do, job) for job in jobs]
            # An executor watches the processes that were there when it was last asked something.
            executor.submit(int)
        yield futures
    except OSError as error:
        if any(process.exitcode is not None for process in context.started if process.pid):
            raise BrokenProcessPool(f"a worker ended as it was started: {error}") from None
        kind = OutOfMemory if lacks_memory(error) else UsageError
        raise kind(
            f"worker processes cannot be started: {error.strerror or error}",
            remedy="Use --jobs 1, which needs none, or raise the limits on processes and memory.",
        ) from None
    finally:
        with postponed_signals():
            _end(context.started)
            executor.shutdown(cancel_futures=True)


class _Context(SpawnContext):
    """Starts processes, and knows them."""

    def __init__(self) -> None:
        super().__init__()
        self.started: list[SpawnProcess] = []

    def Process(self, *args: Any, **keywords: Any) -> SpawnProcess:  # type: ignore[override]  # noqa: N802
        process = SpawnProcess(*args, **keywords)
        self.started.append(process)
        return process


def _end(started: Sequence[SpawnProcess]) -> None:
    """End processes, by force where they do not end by themselves."""
    started = [process for process in started if process.pid is not None]
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
    when they are ready (`planners.parallel.worker.begin`).
    """
    with postponed_signals():
        resource_tracker.ensure_running()  # it would unblock the signals
        main = sys.modules["__main__"]
        mask = signal.pthread_sigmask(signal.SIG_BLOCK, ENDING)
        try:
            sys.modules["__main__"] = ModuleType("__main__")
            yield
        finally:
            sys.modules["__main__"] = main
            signal.pthread_sigmask(signal.SIG_SETMASK, mask)
