# SPDX-License-Identifier: GPL-3.0-or-later
"""Worker processes of this machine: an executor that can be ended at any moment."""

from __future__ import annotations

import os
import pickle
import signal
import sys
import time
from collections.abc import Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing import resource_tracker
from multiprocessing.connection import wait
from multiprocessing.context import SpawnContext, SpawnProcess
from types import ModuleType
from typing import Any

from planners.parallel.batch import Batch
from planners.parallel.worker import begin, do
from planners.system.errors import OutOfMemory, UsageError
from planners.system.limits import lacks_memory
from planners.system.signals import ENDING, postponed_signals

#: Seconds in which a worker that is asked to end cleans up.
_STOPPING = 1.0
#: Of a worker: as many threads as there are workers is one each, where BLAS would take all cores;
#: and the working directory is in the path only where it is in ours.
_ENVIRONMENT = {
    "OPENBLAS_NUM_THREADS": "1",
    "OMP_NUM_THREADS": "1",
    "MKL_NUM_THREADS": "1",
    "PYTHONSAFEPATH": "1",
}


class ProcessPool:
    """Worker processes for the jobs of one batch.

    Parameters
    ----------
    batch
        The jobs.
    capacity
        The greatest number of processes.
    memory
        Bytes that each may take beyond what its libraries need; None: no limit of its own.
    """

    def __init__(self, batch: Batch, capacity: int, memory: int | None = None) -> None:
        self.capacity, self._batch = capacity, batch
        self._context = _Context()
        self._ready, said = self._context.Pipe(duplex=False)
        self._said = said  # kept open: without a worker nothing is heard
        packed = pickle.dumps((batch.function, batch.shared), pickle.HIGHEST_PROTOCOL)
        self._executor = ProcessPoolExecutor(capacity, self._context, begin, (packed, memory, said))

    def submit(self, number: int) -> Future[bytes]:
        """Begin a job.

        Raises
        ------
        BrokenProcessPool
            If a process was lost before.
        UsageError, OutOfMemory
            If no process can be started.
        """
        job = pickle.dumps(self._batch.jobs[number], pickle.HIGHEST_PROTOCOL)
        try:
            with _spawning():
                return self._executor.submit(do, job)
        except OSError as error:
            raise _cannot_start(error) from None

    def lost(self, error: BaseException) -> bool:
        """Whether an error means that a worker is gone, and its jobs can be done again.

        Raises
        ------
        UsageError
            If none has ever been there.
        """
        if isinstance(error, BrokenProcessPool) and not self._ready.poll():
            raise _cannot_start(None)
        return isinstance(error, BrokenProcessPool)

    @property
    def is_broken(self) -> bool:
        """Whether a process has ended.

        The executor does not watch one that it has just started before something else happens.
        """
        started = [process for process in self._context.started if process.pid is not None]
        return not all(process.is_alive() for process in started)

    def close(self) -> None:
        """End all processes, by force where they do not end by themselves."""
        with postponed_signals():
            started = [process for process in self._context.started if process.pid is not None]
            for process in started:
                process.terminate()
            left, end = {process.sentinel for process in started}, time.monotonic() + _STOPPING
            while left and (seconds := end - time.monotonic()) > 0:
                left.difference_update(wait(left, seconds))
            for process in started:
                process.kill()
            self._executor.shutdown(cancel_futures=True)
            self._ready.close()
            self._said.close()


class _Context(SpawnContext):
    """Starts processes, and knows them."""

    def __init__(self) -> None:
        super().__init__()
        self.started: list[SpawnProcess] = []

    def Process(self, *args: Any, **keywords: Any) -> SpawnProcess:  # type: ignore[override]  # noqa: N802
        process = SpawnProcess(*args, **keywords)
        self.started.append(process)
        return process


@contextmanager
def _spawning() -> Iterator[None]:
    """Start processes in the block that nothing of this one disturbs.

    They are not told of the script that runs here, which may have no main guard, and hear signals
    when they are ready (`planners.parallel.worker.begin`).
    """
    with postponed_signals():
        resource_tracker.ensure_running()  # it would unblock the signals
        main, environment = sys.modules["__main__"], dict(os.environ)
        mask = signal.pthread_sigmask(signal.SIG_BLOCK, ENDING)
        try:
            sys.modules["__main__"] = ModuleType("__main__")
            os.environ.update(_ENVIRONMENT)
            yield
        finally:
            for name in _ENVIRONMENT:
                if name in environment:
                    os.environ[name] = environment[name]
                else:
                    os.environ.pop(name, None)
            sys.modules["__main__"] = main
            signal.pthread_sigmask(signal.SIG_SETMASK, mask)


def _cannot_start(error: OSError | None) -> UsageError | OutOfMemory:
    # A pool whose workers ended while a job was handed over says "handle is closed", without errno.
    why = error.strerror if error is not None and error.strerror else "they end at once"
    kind = OutOfMemory if error is not None and lacks_memory(error) else UsageError
    return kind(
        f"worker processes cannot be started: {why}",
        remedy="Use --jobs 1, which needs none, or raise the limits on processes and memory.",
    )
