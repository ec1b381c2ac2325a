# SPDX-License-Identifier: GPL-3.0-or-later
"""Who does jobs: this process, processes of this machine, or a Dask cluster.

A worker process ends when its parent does and when it is asked to (SIGTERM, and SIGINT and SIGHUP
unless they are ignored: ``nohup``); what is half written is removed then.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Future, ProcessPoolExecutor, wait
from contextlib import AbstractContextManager, ExitStack, closing, contextmanager
from dataclasses import dataclass
from multiprocessing import resource_tracker
from os import PathLike
from types import FrameType, ModuleType
from typing import Any

from planners.parallel.batch import Batch, Outcome, Packed, Store, Table
from planners.system import limits
from planners.system.errors import OutOfMemory, UsageError
from planners.system.signals import ENDING, postponed_signals
from planners.system.writing import made_folder

#: Estimated work, in nodes times robots, from which processes pay: each costs about half a second
#: to start, in which one of them does some 100,000.
WORTH_PROCESSES = 500_000.0
#: Bytes without which a worker process is of no use.
_LEAST_MEMORY = 256 << 20
#: How often workers are lost, and no job ends in between, before that is an error.
_TRIES = 2
#: Seconds in which a worker that is asked to end cleans up.
_STOPPING = 1.0
#: The exit code of a worker that was asked to end.
_ASKED_TO_END = 75
#: With as many workers as cores each has one thread, where BLAS would take all cores.
_THREADS = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"), "1")

#: Has some jobs of a batch done elsewhere: gives a future for each, and ends what is under way
#: with its block.
Begin = Callable[[Batch, Sequence[Any]], AbstractContextManager[list[Future[Outcome]]]]


@dataclass(frozen=True, slots=True)
class Workers:
    """Who does jobs: a cluster, or this process; with efforts above ``worth`` worker processes.

    Memory that is left is divided among these.  Results that are ``kept`` are not worked out again.
    """

    processes: int = 1
    cluster: Begin | None = None
    kept: Store | None = None
    worth: float = WORTH_PROCESSES

    def tables(self, batch: Batch) -> Generator[Table]:
        """The tables of jobs in their order, each as soon as its turn has come.

        Errors of jobs are raised in the same order, so they do not depend on the number of
        workers.  What is under way is ended when this is closed.

        Raises `OutOfMemory` for a job whose workers are lost, `UsageError` if none can be started.
        """
        ready: dict[int, Outcome] = {}
        every = range(len(batch.jobs))
        outcomes = self._kept(batch, self.kept) if self.kept else self._done(batch, every)
        with closing(outcomes):
            for number in every:
                while number not in ready:
                    ended, outcome = next(outcomes)
                    ready[ended] = outcome
                outcome = ready.pop(number)
                if isinstance(outcome, BaseException):
                    raise outcome
                yield outcome

    def _kept(self, batch: Batch, kept: Store) -> Generator[tuple[int, Outcome]]:
        """The outcomes that are kept, then those of the other jobs, which are kept from then on."""
        keys, left = batch.keys(), []
        for number, key in enumerate(keys):
            table = kept.read(key)
            if table is None:
                left.append(number)
            else:
                yield number, table
        with closing(self._done(batch, left)) as done:
            for number, outcome in done:
                if isinstance(outcome, dict):
                    kept.write(keys[number], outcome)
                yield number, outcome

    def _done(self, batch: Batch, left: Sequence[int]) -> Generator[tuple[int, Outcome]]:
        """Do the jobs that are left, here or elsewhere; each number comes with its outcome."""
        effort = sum(batch.efforts[number] for number in left)
        is_small = min(self.processes, len(left)) < 2 or effort < self.worth
        # Workers of `multiprocessing.Pool`, and Dask's, may start no processes.
        if self.cluster or not (is_small or multiprocessing.current_process().daemon):
            yield from self._done_elsewhere(batch, [*left])
            return
        for number in left:
            yield number, batch.function(batch.shared, batch.jobs[number])

    def _done_elsewhere(self, batch: Batch, left: list[int]) -> Generator[tuple[int, Outcome]]:
        """Have workers do the jobs that are left, and those again whose worker was lost.

        All processes are lost with one of them.  Mostly there was no memory for all, so there are
        half as many from then on.
        """
        count, lost = min(self.processes, len(left)), 0
        while left:
            try:
                with self._begin(batch, [batch.jobs[n] for n in left], count) as futures:
                    running = dict(zip(futures, left, strict=True))
                    futures.clear()  # each keeps its table
                    while running:
                        for future in wait(running, return_when=FIRST_COMPLETED).done:
                            outcome, number = future.result(), running.pop(future)
                            left.remove(number)
                            lost = 0
                            yield number, outcome
            except BrokenExecutor:
                count, lost = max(1, count // 2), lost + 1
                if lost == _TRIES:
                    raise OutOfMemory(
                        f"{batch.name}: a job lost its worker {_TRIES} times: probably there is no "
                        "memory for it",
                        remedy="Use --jobs 1, or smaller or fewer tasks.",
                    ) from None

    def _begin(
        self, batch: Batch, jobs: Sequence[Any], count: int
    ) -> AbstractContextManager[list[Future[Outcome]]]:
        if self.cluster is not None:
            return self.cluster(batch, jobs)
        left = limits.memory_left()
        count = min(count, max(1, left // _LEAST_MEMORY))
        memory = left // count if limits.has_memory_limit() else None
        return _in_processes(batch, jobs, count, memory)


def cores() -> int:
    """The processors that this process may use, or, where the system does not say, all of them."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


@contextmanager
def workers(
    jobs: int | None = None,
    scheduler: str | None = None,
    resume: str | PathLike[str] | None = None,
) -> Iterator[Workers]:
    """Who does jobs, for the block: ``jobs`` processes at most (None: one for each core).

    In place of these the cluster of a Dask ``scheduler``, given by address or file, whose code must
    be as here.  Finished jobs are kept, and found again, in the folder ``resume``.

    Raises `UsageError` where there is no such cluster, or no such folder can be made.
    """
    with ExitStack() as stack:
        kept = None if resume is None else Store(made_folder(resume))
        cluster = None
        if scheduler is not None:
            try:
                from planners.parallel.dask_cluster import connected
            except ImportError:
                raise UsageError(
                    "--scheduler needs the package distributed, 2025.4 or later: it is missing",
                    remedy="Install it: pip install 'coordlang[cluster]'.",
                ) from None
            cluster = stack.enter_context(connected(scheduler))
        yield Workers(jobs or cores(), cluster, kept)


@contextmanager
def _in_processes(
    batch: Batch, jobs: Sequence[Any], count: int, memory: int | None
) -> Iterator[list[Future[Outcome]]]:
    """Have some jobs of a batch done by ``count`` processes, which end with the block.

    ``memory`` are the bytes that each may take beyond what its libraries need; None: no limit.
    Raises `BrokenExecutor` if a process is lost, `UsageError` or `OutOfMemory` if none can be
    started.
    """
    spawn = multiprocessing.get_context("spawn")
    executor = ProcessPoolExecutor(count, spawn, _prepare, (Packed(batch), memory))
    # Nothing public ends them before Python 3.14, and after `shutdown` the executor knows none.
    started = executor._processes
    try:
        with _spawning():
            futures = [executor.submit(_do, job) for job in jobs]
            # An executor watches the processes that were there when it was last asked something.
            executor.submit(int)
        yield futures
    except OSError as error:
        if any(process.exitcode is not None for process in started.values()):
            raise BrokenExecutor(f"a worker ended as it was started: {error}") from None
        kind = OutOfMemory if limits.lacks_memory(error) else UsageError
        raise kind(
            f"worker processes cannot be started: {error.strerror or error}",
            remedy="Use --jobs 1, which needs none, or raise the limits on processes and memory.",
        ) from None
    finally:
        with postponed_signals():
            _end([*started.values()])
            executor.shutdown(cancel_futures=True)


def _end(started: Sequence[multiprocessing.process.BaseProcess]) -> None:
    """End processes, by force where they do not end by themselves."""
    for process in started:
        process.terminate()
    end = time.monotonic() + _STOPPING
    for process in started:
        process.join(max(0.0, end - time.monotonic()))
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


def _prepare(work: Packed, memory: int | None) -> None:
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
        limits.load_libraries()
        limits.limit_memory(limits.address_space() + memory)


def _do(job: Any) -> Outcome:
    try:
        return _attempt(job)
    except SystemExit as ended:
        if ended.code != _ASKED_TO_END:
            raise
        os._exit(_ASKED_TO_END)  # all has been cleaned up; the executor would send it as a result


def _asked_to_end(_signal: int, _frame: FrameType | None) -> None:
    for number in ENDING:  # the executor asks again once another worker has ended
        signal.signal(number, signal.SIG_IGN)
    sys.exit(_ASKED_TO_END)


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    assert parent is not None
    parent.join()
    os._exit(1)
