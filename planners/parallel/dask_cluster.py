# SPDX-License-Identifier: GPL-3.0-or-later
"""Jobs on a running Dask cluster (the extra ``cluster``), by its executor.

A job is a Dask task in a thread of a Dask worker.  One whose worker is lost is done again
elsewhere: Dask sees to that.
"""

from __future__ import annotations

import asyncio
import logging
import pickle
import re
import warnings
from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError, Future, ThreadPoolExecutor
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import Any
from uuid import uuid4

import msgspec

from planners.parallel.batch import Batch
from planners.parallel.versions import differing, versions_here
from planners.system.errors import CoordlangError, OutOfMemory, UsageError
from planners.system.limits import time_left
from planners.system.messages import echoed
from planners.system.signals import postponed_signals

#: Seconds in which a scheduler must answer.
_CONNECTING = 10.0
#: .. or in this part of the time that is left.
_SHARE = 0.8
#: Whose messages are ours to write.
_LOGGERS = ("distributed", "tornado", "asyncio")
#: Seconds between two looks at whether there are workers.
_TICK = 0.2
_ADDRESS = re.compile(r"(?:(?:tcp|tls)://)?(?:[\w.-]+|\[[0-9a-fA-F:.]+\]):\d{1,5}")
#: Bytes that the file of a scheduler has at most.
_MOST_BYTES = 1 << 20


class ClusterFailed(CoordlangError):
    """The cluster is gone, or its workers are lost again and again."""


@contextmanager
def connected(
    where: str, packages: tuple[str, ...], note: Callable[[str], None]
) -> Iterator[Callable[[Batch], ClusterPool]]:
    """Connect to a running cluster, and leave nothing of ours on it.

    Parameters
    ----------
    where
        The address of its scheduler, or the file that the scheduler has written.
    packages
        The packages whose code does the jobs: it must be the same on all workers.
    note
        Called with a line of text for a person: that there are no workers yet.

    Raises
    ------
    UsageError
        Where no scheduler answers, or the versions of a worker are others than here.
    """
    distributed = _distributed()
    with _silence():
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # versions are compared below
            client = _client(distributed, where)
        try:
            yield partial(ClusterPool, client, where, versions_here(packages), packages, note)
        finally:
            with postponed_signals(), suppress(OSError, TimeoutError, RuntimeError):
                client.close()


@contextmanager
def _silence() -> Iterator[None]:
    """Let Dask log nothing in the block: what matters is raised, as an error of ours."""
    names = [n for n in logging.root.manager.loggerDict if n.partition(".")[0] in _LOGGERS]
    loggers = [logging.getLogger(name) for name in names]
    levels = [logger.level for logger in loggers]
    try:
        for logger in loggers:
            logger.setLevel(logging.CRITICAL + 1)
        yield
    finally:
        for logger, level in zip(loggers, levels, strict=True):
            logger.setLevel(level)


class ClusterPool:
    """The workers of a cluster, for the jobs of one batch.

    What all jobs share is a plugin of the workers, so that one that joins later has it, too, and
    jobs depend on nothing: Dask sends them to whoever is free.

    Raises
    ------
    UsageError
        If a worker has other versions than ``expected`` of the packages.
    ClusterFailed
        If the scheduler is gone.
    """

    def __init__(
        self,
        client: Any,
        where: str,
        expected: dict[str, str],
        packages: tuple[str, ...],
        note: Callable[[str], None],
        batch: Batch,
    ) -> None:
        self.capacity = len(batch.jobs)
        self._client, self._where, self._batch = client, where, batch
        self._expected, self._packages = expected, packages
        self._name = f"coordlang-{uuid4().hex}"
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # of large values
                self._require_equal_versions(note)
                packed = pickle.dumps((batch.function, batch.shared), pickle.HIGHEST_PROTOCOL)
                client.register_plugin(_plugin(self._name, packed), name=self._name)
        except (OSError, TimeoutError, CancelledError, asyncio.CancelledError):
            raise self._gone() from None
        self._executor = client.get_executor(pure=False, retries=0)

    def submit(self, number: int) -> Future[bytes]:
        """Send a job; the scheduler begins them in their order."""
        job = pickle.dumps(self._batch.jobs[number], pickle.HIGHEST_PROTOCOL)
        order = (self._name, self._expected, self._packages)
        future: Future[bytes] = self._executor.submit(_do, job, *order)
        return future

    def lost(self, error: BaseException) -> bool:
        """Raise what the error of a task means."""
        if type(error).__name__ == "KilledWorker":
            raise OutOfMemory(
                f"{self._batch.name}: several workers were lost in one job: probably there is no "
                "memory for it",
                remedy="Give the workers more memory (dask worker --memory-limit), or use smaller "
                "or fewer tasks.",
            )
        if isinstance(error, CoordlangError | MemoryError):
            raise error
        raise self._gone() from error

    @property
    def is_broken(self) -> bool:
        """Whether a worker is gone: Dask sees to that."""
        return False

    def close(self) -> None:
        """Drop the jobs that are not begun; those under way end by themselves, unheard."""
        with postponed_signals(), suppress(OSError, TimeoutError, RuntimeError):
            self._executor.shutdown(wait=False)  # it cancels them
            if self._client.status == "running":
                self._client.unregister_worker_plugin(self._name)

    def _gone(self) -> ClusterFailed:
        return ClusterFailed(
            f"the Dask scheduler {self._where} has gone, or has dropped the work",
            remedy="Start it again; with --resume DIR the finished jobs are kept.",
        )

    def _require_equal_versions(self, note: Callable[[str], None]) -> None:
        """Compare what is installed on the workers that are there with what is installed here."""
        client, said = self._client, False
        while not client.scheduler_info(n_workers=-1)["workers"]:
            if client.status != "running":
                raise self._gone()
            if not said:
                note(f"no worker has connected to {self._where} so far: waiting for one")
                said = True
            with suppress(TimeoutError):
                client.wait_for_workers(1, timeout=_TICK)
        expected, packages = self._expected, self._packages

        def found() -> str | None:  # sent as it is: a worker may have no coordlang at all
            try:
                from planners.parallel.versions import differing
            except ImportError as error:
                return f"coordlang is missing there ({error})"
            return differing(expected, packages)

        for address, difference in sorted(client.run(found).items()):
            if difference is not None:
                raise _other_version(address, difference)


def _other_version(address: str, difference: str) -> UsageError:
    return UsageError(
        f"the worker {address} does not do the same work: {difference}",
        remedy="Use one environment for client, scheduler and workers, or install the same "
        "versions everywhere (pip install 'coordlang[cluster]').",
    )


def _distributed() -> Any:
    """The library, imported where it is used."""
    try:
        import distributed
    except ImportError:
        raise UsageError(
            "--scheduler needs the package distributed, which is not installed",
            remedy="Install it: pip install 'coordlang[cluster]'.",
        ) from None
    return distributed


def _client(distributed: Any, where: str) -> Any:
    """A client of the cluster."""
    address = (
        where if _ADDRESS.fullmatch(where) and not Path(where).exists() else _address_in(where)
    )
    seconds = min(_CONNECTING, _SHARE * time_left())
    try:
        # A client that fails goes on trying when it is thrown away: this does not.
        with ThreadPoolExecutor(1) as thread:  # the caller may be in an event loop
            thread.submit(asyncio.run, _shake_hands(distributed, address, seconds)).result()
        return distributed.Client(address, timeout=seconds, set_as_default=False)
    # Whatever answers, or a security that does not fit: TypeError, MemoryError of a length that
    # is noise, ..
    except (OSError, ValueError, TypeError, RuntimeError, MemoryError, LookupError) as error:
        text = str(error).partition("\n")[0] or type(error).__name__
        raise UsageError(
            f"no Dask scheduler answers at {echoed(where)} ({echoed(text)})",
            remedy="Start one: dask scheduler --scheduler-file FILE; tls:// needs certificates "
            "(docs/cluster.md).",
        ) from None


async def _shake_hands(distributed: Any, address: str, seconds: float) -> None:
    """Connect to a scheduler, and no more."""
    security = distributed.Security().get_connection_args("client")
    async with asyncio.timeout(seconds):  # Dask's own does not count the answer
        comm = await distributed.comm.connect(address, timeout=seconds, **security)
    await comm.close()


class _SchedulerFile(msgspec.Struct):
    address: str


def _address_in(file: str) -> str:
    """The address that a scheduler has written into a file."""
    try:
        if not Path(file).is_file() and Path(file).exists():
            raise ValueError("a folder or a device")
        with open(file, "rb") as opened:
            data = opened.read(_MOST_BYTES)
        address = msgspec.json.decode(data, type=_SchedulerFile).address
    except OSError as error:
        raise UsageError(
            f"--scheduler {echoed(file)}: {error.strerror}, and it is no address",
            remedy="Say tcp://HOST:PORT, or the file that `dask scheduler --scheduler-file FILE` "
            "has written.",
        ) from None
    except (ValueError, RecursionError):
        address = ""
    if not _ADDRESS.fullmatch(address):
        raise UsageError(
            f"--scheduler {echoed(file)} is no file of a Dask scheduler",
            remedy="Name the file that `dask scheduler --scheduler-file FILE` has written.",
        )
    return address


# ---- on the Dask workers


def _plugin(name: str, packed: bytes) -> Any:
    """What a Dask worker has of ours, while our jobs are on the cluster."""
    from planners.parallel.dask_plugin import BatchPlugin

    return BatchPlugin(name, packed)


def _do(job: bytes, name: str, expected: dict[str, str], packages: tuple[str, ...]) -> bytes:
    """One job, as a task; see `planners.parallel.worker.attempt`."""
    from distributed import get_worker

    from planners.parallel.worker import attempt

    worker = get_worker()
    difference = differing(expected, packages)
    if difference is not None:  # of a worker that has joined later
        raise _other_version(worker.address, difference)
    return attempt(worker.plugins[name].work(), job)
