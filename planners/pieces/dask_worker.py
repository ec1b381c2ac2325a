# SPDX-License-Identifier: GPL-3.0-or-later
"""What is run on a Dask worker: pieces, in worker processes that can be ended at any moment."""

from __future__ import annotations

import pickle
import threading
from typing import Any

from distributed import get_worker
from distributed.diagnostics.plugin import WorkerPlugin

from planners.errors import OutOfMemory, UsageError
from planners.pieces.cluster import Order
from planners.pieces.processes import GRACE
from planners.pieces.versions import differing
from planners.pieces.work import Done
from planners.pieces.worker_process import WorkerLost, WorkerProcess, end_all

#: Seconds between two looks at whether a task is still wanted.
_TICK = 0.2
#: Of what a Dask worker may have, what its processes take together: at 95 % Dask ends the worker.
_SHARE = 0.8
#: How often a piece is begun at most, whose processes die.
_TRIES = 2


class WorkerProcesses(WorkerPlugin):  # type: ignore[misc]
    """The processes of one Dask worker that do pieces: one for each of its threads, kept.

    Parameters
    ----------
    name
        Under which the worker knows this plugin.
    work
        What all pieces share, packed.
    """

    def __init__(self, name: str, work: bytes) -> None:
        self.name, self.work = name, work

    def setup(self, worker: Any) -> None:
        """Begin with no process."""
        self._lock = threading.Lock()
        self._idle: list[WorkerProcess] = []
        self._all: list[WorkerProcess] = []
        self._closed = False
        most = worker.memory_manager.memory_limit
        self._memory = None if not most else int(_SHARE * most / max(1, worker.state.nthreads))

    def teardown(self, worker: Any) -> None:
        """End all processes."""
        with self._lock:
            self._closed = True
            every, self._all, self._idle = self._all, [], []
        end_all(every)

    def take(self) -> WorkerProcess:
        """A process that has nothing to do, started where there is none."""
        with self._lock:
            if self._idle:
                return self._idle.pop()
        process = WorkerProcess(self._memory)
        with self._lock:
            self._all.append(process)
        return process

    def give_back(self, process: WorkerProcess) -> None:
        """Keep a process for the next piece."""
        with self._lock:
            if not self._closed:
                self._idle.append(process)

    def end(self, process: WorkerProcess) -> None:
        """End a process, whatever it does."""
        with self._lock:
            if process in self._all:
                self._all.remove(process)
        process.kill()


def do(piece: bytes, order: Order) -> bytes:
    """Do one piece in a process of this Dask worker, as long as somebody wants it.

    Returns
    -------
    bytes
        The fields of its `Done` after the number, packed.

    Raises
    ------
    CoordlangError
        The error that the piece ends with.
    """
    difference = differing(order.versions, order.packages)
    if difference is not None:
        raise UsageError(
            f"the worker {get_worker().address} does not do the same work: {difference}",
            remedy="Use one environment for client, scheduler and workers.",
        )
    processes: WorkerProcesses = get_worker().plugins[order.plugin]
    for _ in range(_TRIES):
        try:
            done = _attempt(processes, piece, order)
        except WorkerLost as lost:
            if order.isolated and not lost.asked:
                done = Done(0, None, None, "died")
            else:
                continue
        if done.error is not None:
            raise done.error
        return pickle.dumps((done.table, None, done.lost, done.seconds, done.cpu))
    raise OutOfMemory(
        f"{order.work}: a piece of the work lost its process on {get_worker().address} "
        f"{_TRIES} times: there is no memory for it",
        remedy="Give the workers more memory (dask worker --memory-limit), or use smaller or fewer "
        "tasks.",
    )


def _attempt(processes: WorkerProcesses, piece: bytes, order: Order) -> Done:
    """Do a piece once; a process that has not ended it is ended."""
    worker = get_worker()
    key = worker.get_current_task()
    process = processes.take()
    finished = False
    try:
        process.begin(0, processes.work, piece)
        while not process.ready(_TICK):
            task = worker.state.tasks.get(key)
            if task is None or task.state not in ("executing", "long-running"):
                return Done(0, None)  # cancelled: nobody reads this
            if order.limit is not None and process.busy_for > order.limit + GRACE:
                return Done(0, None, None, "late", process.busy_for)
        done = process.answer()
        finished = True
        return done
    finally:
        if finished:
            processes.give_back(process)
        else:
            processes.end(process)
