# SPDX-License-Identifier: GPL-3.0-or-later
"""Pieces on one machine: in this process, or in worker processes where that pays."""

from __future__ import annotations

import os
from collections.abc import Generator
from multiprocessing.connection import wait

from planners.limits import has_memory_limit, memory_left
from planners.pieces.work import Done, Report, Work, silent
from planners.pieces.worker_process import (
    WorkerLost,
    WorkerProcess,
    end_all,
    lost_for_good,
    packed_piece,
    packed_work,
)

#: Estimated work, in nodes times robots, from which processes pay: each costs about half a second
#: to start, in which one of them does some 100,000.
WORTH_PROCESSES = 500_000.0
#: Bytes without which a process of its own is of no use.
_LEAST_MEMORY = 256 << 20
#: How often a piece is begun at most, whose processes die.
_TRIES = 2
#: Seconds after its limit at which an isolated piece that does not stop by itself is killed.
GRACE = 30.0
#: Seconds between two looks at the limits.
_TICK = 1.0


def cores() -> int:
    """The processors that this process may use, or, where the system does not say, all of them."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


class Processes:
    """Does pieces here: one after another in this process, or several processes at a time.

    Processes are started for `Work.isolated` pieces, and else where there are several pieces, more
    than one job, and the pieces' efforts sum to `WORTH_PROCESSES`.  Memory that is left is divided
    among them.

    Parameters
    ----------
    jobs
        The greatest number of processes.
    worth
        The sum of efforts from which processes are started.
    """

    def __init__(self, jobs: int, worth: float = WORTH_PROCESSES) -> None:
        self._jobs, self._worth = jobs, worth

    def run(self, work: Work, report: Report = silent) -> Generator[Done]:
        """See `planners.pieces.work.Runner.run`."""
        pays = min(self._jobs, len(work.pieces)) > 1 and sum(work.efforts) >= self._worth
        if not (work.isolated or pays):
            yield from in_process(work, report)
            return
        jobs = min(self._jobs, len(work.pieces))
        left = memory_left()
        jobs = min(jobs, max(1, left // _LEAST_MEMORY))
        memory = left // max(1, jobs) if has_memory_limit() else None
        yield from _Pool(work, jobs, memory, report).run()


def in_process(work: Work, report: Report = silent) -> Generator[Done]:
    """Do all pieces here, in their order."""
    for number, piece in enumerate(work.pieces):
        report([number])
        yield Done(number, work.function(work.shared, piece))


class _Pool:
    """Worker processes, of which those that died are replaced."""

    def __init__(self, work: Work, jobs: int, memory: int | None, report: Report) -> None:
        self._work, self._jobs, self._memory, self._report = work, jobs, memory, report
        self._packed = packed_work(work)
        self._workers: list[WorkerProcess] = []
        self._waiting = list(range(len(work.pieces)))[::-1]
        self._tries = [0] * len(work.pieces)

    def run(self) -> Generator[Done]:
        """Yield the pieces as they end."""
        try:
            for _ in range(self._jobs):
                self._workers.append(WorkerProcess(self._memory))
                self._next(self._workers[-1])
            while busy := [worker for worker in self._workers if worker.number is not None]:
                self._report([worker.number for worker in busy if worker.number is not None])
                ready = wait([worker.connection for worker in busy], timeout=_TICK)
                for worker in busy:
                    done = self._ended(worker, worker.connection in ready)
                    if done is not None:
                        yield done
                for worker in self._workers:
                    if worker.number is None:
                        self._next(worker)
        finally:
            end_all(self._workers)

    def _next(self, worker: WorkerProcess) -> None:
        """Give a worker the next piece."""
        if self._waiting:
            number = self._waiting.pop()
            self._tries[number] += 1
            worker.begin(number, self._packed, packed_piece(self._work, number))

    def _ended(self, worker: WorkerProcess, ready: bool) -> Done | None:
        """The piece of a worker, None while it is under way or has to be done again."""
        number, seconds = worker.number, worker.busy_for
        assert number is not None
        limit = self._work.limit
        if ready:
            try:
                return worker.answer()
            except WorkerLost as lost:
                self._replace(worker)
                return self._lost(number, seconds, lost.asked)
        if limit is not None and seconds > limit + GRACE:
            worker.kill()
            self._replace(worker)
            return Done(number, None, None, "late", seconds)
        return None

    def _lost(self, number: int, seconds: float, asked: bool) -> Done | None:
        """What becomes of a piece whose process is gone: it is done again, once."""
        if asked:
            self._tries[number] -= 1
        elif self._work.isolated:
            return Done(number, None, None, "died", seconds)
        elif self._tries[number] >= _TRIES:
            raise lost_for_good(self._work)
        self._waiting.append(number)
        return None

    def _replace(self, worker: WorkerProcess) -> None:
        """Put a fresh process in the place of one that is gone."""
        self._workers[self._workers.index(worker)] = WorkerProcess(self._memory)
