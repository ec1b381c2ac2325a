# SPDX-License-Identifier: GPL-3.0-or-later
"""Who does jobs: this process, processes of this machine, or a Dask cluster."""

from __future__ import annotations

import os
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Future, wait
from contextlib import AbstractContextManager, ExitStack, closing, contextmanager
from dataclasses import dataclass
from multiprocessing import current_process
from os import PathLike
from typing import Any

from planners.parallel.batch import Batch, Outcome, Store, Table
from planners.system.errors import OutOfMemory, UsageError
from planners.system.limits import has_memory_limit, memory_left
from planners.system.writing import made_folder

#: Estimated work, in nodes times robots, from which processes pay: each costs about half a second
#: to start, in which one of them does some 100,000.
WORTH_PROCESSES = 500_000.0
#: Bytes without which a worker process is of no use.
_LEAST_MEMORY = 256 << 20
#: How often workers are lost, and no job ends in between, before that is an error.
_TRIES = 2

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
        if self.cluster or not (is_small or current_process().daemon):
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
        from planners.parallel.processes import in_processes

        left = memory_left()
        count = min(count, max(1, left // _LEAST_MEMORY))
        return in_processes(batch, jobs, count, left // count if has_memory_limit() else None)


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
