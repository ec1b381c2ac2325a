# SPDX-License-Identifier: GPL-3.0-or-later
"""Who does jobs: this process, processes of this machine, or a Dask cluster."""

from __future__ import annotations

import os
import pickle
from collections import Counter, deque
from collections.abc import Callable, Generator, Iterator
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, wait
from contextlib import ExitStack, closing, contextmanager
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path
from typing import Protocol

import numpy as np

from planners.parallel.batch import Batch, Done, Table
from planners.parallel.store import Store
from planners.parallel.versions import code_hash
from planners.system.errors import OutOfMemory, UsageError
from planners.system.limits import has_memory_limit, memory_left

#: Estimated work, in nodes times robots, from which processes pay: each costs about half a second
#: to start, in which one of them does some 100,000.
WORTH_PROCESSES = 500_000.0
#: Bytes without which a worker process is of no use.
_LEAST_MEMORY = 256 << 20
#: Seconds between two looks at whether the workers are there.
_TICK = 1.0
#: How often a job is begun at most that loses its worker each time, when it is the only one.
_TRIES = 2


class Pool(Protocol):
    """An executor (`concurrent.futures.Executor`) with the jobs of a batch."""

    @property
    def capacity(self) -> int:
        """How many jobs are given to it at a time."""
        ...

    def submit(self, number: int) -> Future[bytes]:
        """Begin a job: its result is that of `planners.parallel.worker.attempt`."""
        ...

    def lost(self, error: BaseException) -> bool:
        """Whether an error says that a worker is gone; raises what is the end of all jobs."""
        ...

    @property
    def is_broken(self) -> bool:
        """Whether a worker is gone, should the executor not have noticed it."""
        ...

    def close(self) -> None:
        """End what is under way."""
        ...


@dataclass(frozen=True, slots=True)
class Workers:
    """Who does jobs.

    Without a cluster jobs are done one after another in this process, or by worker processes where
    there are several jobs whose efforts sum to ``worth``.  Memory that is left is divided among
    them.

    Attributes
    ----------
    processes
        The greatest number of worker processes.
    cluster
        Gives a pool of other machines in place of them.
    kept
        Results that are known, and where others are kept.
    worth
        The sum of efforts from which processes are started.
    """

    processes: int = 1
    cluster: Callable[[Batch], Pool] | None = None
    kept: Store | None = None
    worth: float = WORTH_PROCESSES

    def run(self, batch: Batch) -> Generator[Done]:
        """Yield jobs as they end; what is under way is ended when this is closed.

        Raises
        ------
        OutOfMemory
            For a job whose workers are lost.
        UsageError
            If no worker can be started.
        """
        if self.kept is None:
            yield from self._run(batch)
            return
        keys = _keys(batch)
        left = []
        for number, key in enumerate(keys):
            table = self.kept.read(key)
            if table is None:
                left.append(number)
            else:
                yield Done(number, table)
        rest = replace(
            batch,
            jobs=[batch.jobs[number] for number in left],
            efforts=[batch.efforts[number] for number in left],
        )
        with closing(self._run(rest)) as following:
            for done in following:
                number = left[done.number]
                if done.table is not None:
                    self.kept.write(keys[number], done.table)
                yield replace(done, number=number)

    def tables(self, batch: Batch) -> Generator[Table]:
        """The tables of jobs in the order of their numbers, each as soon as its turn has come.

        Errors are raised in the same order, so they do not depend on the number of workers.
        """
        waiting: dict[int, Done] = {}
        following = 0
        with closing(self.run(batch)) as ended:
            for done in ended:
                waiting[done.number] = done
                while (first := waiting.pop(following, None)) is not None:
                    if first.table is None:
                        assert first.error is not None
                        raise first.error
                    yield first.table
                    following += 1

    def _run(self, batch: Batch) -> Generator[Done]:
        if self.cluster is not None:
            if batch.jobs:
                cluster = self.cluster
                yield from _in_pool(batch, lambda: cluster(batch))
            return
        count, left = min(self.processes, len(batch.jobs)), memory_left()
        if count < 2 or sum(batch.efforts) < self.worth:
            for number, job in enumerate(batch.jobs):
                yield Done(number, batch.function(batch.shared, job))
            return
        from planners.parallel.processes import ProcessPool

        count = min(count, max(1, left // _LEAST_MEMORY))
        memory = left // count if has_memory_limit() else None
        yield from _in_pool(batch, lambda: ProcessPool(batch, count, memory))


def _in_pool(batch: Batch, begin: Callable[[], Pool]) -> Generator[Done]:
    """Map jobs to the workers of a pool, and do those again whose worker was lost.

    A pool of processes is lost as a whole with one of them.  So the jobs that were under way are
    then done one at a time in a new one, which tells whose fault it was.
    """
    waiting, alone = deque(range(len(batch.jobs))), deque[int]()
    tries: Counter[int] = Counter()
    running: dict[Future[bytes], int] = {}
    pool = begin()
    try:
        while waiting or alone or running:
            lost: list[int] = []
            while (
                not lost and (waiting or alone) and len(running) < (1 if alone else pool.capacity)
            ):
                number = (alone or waiting).popleft()
                try:
                    running[pool.submit(number)] = number
                except RuntimeError as error:  # BrokenExecutor is one
                    if not pool.lost(error):
                        raise
                    lost.append(number)
            done = set() if lost else wait(running, _TICK, FIRST_COMPLETED).done
            if not done and pool.is_broken:
                lost.extend(n for n in running.values() if n not in lost)
                running.clear()
            for future in done:
                number = running.pop(future)
                failed = CancelledError() if future.cancelled() else future.exception()
                if failed is None:
                    yield Done(number, *pickle.loads(future.result()))
                elif pool.lost(failed):
                    lost.append(number)
                else:
                    raise failed
            if lost:
                lost += running.values()
                running.clear()
                pool.close()
                _require_more_tries(batch, lost, tries)
                alone.extend(sorted(lost))
                pool = begin()
    finally:
        pool.close()


def _require_more_tries(batch: Batch, lost: list[int], tries: Counter[int]) -> None:
    """Raise `OutOfMemory` for a job that lost its workers: the system ends those that take most."""
    if len(lost) > 1:
        return
    tries.update(lost)
    if tries[lost[0]] >= _TRIES:
        raise OutOfMemory(
            f"{batch.name}: a job lost its worker {_TRIES} times: probably there is no memory for "
            "it",
            remedy="Use fewer --jobs, or smaller or fewer tasks.",
        )


def _keys(batch: Batch) -> list[str]:
    """The key of each job: of the function, what it works on, and the code."""
    package = batch.function.__module__.partition(".")[0]
    code = code_hash(package), code_hash("planners"), f"numpy {np.version.version}"
    return [batch.key(number, " ".join(code)) for number in range(len(batch.jobs))]


def _made(folder: Path) -> Path:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UsageError(
            f"{folder} cannot be made: {error.strerror}",
            remedy="Say --resume DIR, with a folder that you may write to.",
        ) from None
    return folder


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
    packages: tuple[str, ...] = ("planners",),
    note: Callable[[str], None] = lambda _: None,
) -> Iterator[Workers]:
    """Who does jobs, for the block.

    Parameters
    ----------
    jobs
        The greatest number of processes on this machine; None: one for each core.
    scheduler
        The scheduler of a running Dask cluster, by address or file, in place of processes here.
    resume
        A folder in which finished jobs are kept, and found again.
    packages
        The packages whose code does the jobs.
    note
        Called with a line of text for a person: a damaged file, a cluster without workers.

    Raises
    ------
    UsageError
        Where there is no such cluster, or no such folder can be made.
    """
    with ExitStack() as stack:
        kept = None if resume is None else Store(_made(Path(resume)), say=note)
        cluster = None
        if scheduler is not None:
            from planners.parallel.dask_cluster import connected

            cluster = stack.enter_context(connected(scheduler, packages, note))
        yield Workers(jobs or cores(), cluster, kept)
