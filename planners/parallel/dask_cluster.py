# SPDX-License-Identifier: GPL-3.0-or-later
"""Jobs on a running Dask cluster (the extra ``cluster``), by its executor.

A job is a Dask task in a thread of a Dask worker.  One whose worker is lost is done again
elsewhere: Dask sees to that.
"""

from __future__ import annotations

import asyncio
import json
import logging
import platform
import re
import warnings
from collections.abc import Iterator, Sequence
from concurrent.futures import CancelledError, Future, ThreadPoolExecutor
from contextlib import contextmanager, suppress
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any
from uuid import uuid4

import distributed
from distributed.client import ClosedClientError
from distributed.scheduler import KilledWorker

from planners.parallel.batch import Batch, Outcome, Packed, code_hash
from planners.system.errors import CoordlangError, Note, OutOfMemory, UsageError, note
from planners.system.limits import time_left
from planners.system.messages import echoed
from planners.system.signals import postponed_signals

#: Seconds in which a scheduler must answer, or this part of the time that is left.
_CONNECTING, _SHARE = 10.0, 0.8
#: Whose messages are ours to write.
_LOGGERS = ("distributed", "tornado", "asyncio")
#: Seconds between two looks at whether there are workers.
_TICK = 0.2
_ADDRESS = re.compile(r"(?:(?:tcp|tls)://)?(?:[\w.-]+|\[[0-9a-fA-F:.]+\]):\d{1,5}")
#: How the end of a connection is said.
_GONE = (OSError, TimeoutError, CancelledError, asyncio.CancelledError, ClosedClientError)


@contextmanager
def connected(where: str) -> Iterator[Cluster]:
    """Connect to a running cluster, and leave nothing of ours on it.

    ``where`` is the address of its scheduler, or the file that the scheduler has written.  Raises
    `UsageError` where no scheduler answers.
    """
    is_address = _ADDRESS.fullmatch(where) and not Path(where).exists()
    address = where if is_address else _address_in(where)
    with _silence():
        try:
            client = _client(address)
        except (OSError, ValueError, TypeError, RuntimeError, MemoryError, LookupError) as error:
            text = str(error).partition("\n")[0] or type(error).__name__
            raise UsageError(
                f"no Dask scheduler answers at {echoed(where)} ({echoed(text)})",
                remedy="Start one: dask scheduler --scheduler-file FILE; tls:// needs certificates "
                "(docs/cluster.md).",
            ) from None
        try:
            yield Cluster(client, where)
        finally:
            with postponed_signals(), suppress(OSError, TimeoutError, RuntimeError):
                client.close()


def _client(address: str) -> Any:
    """A client, once somebody has answered as a scheduler does: one that fails goes on trying."""
    seconds = min(_CONNECTING, _SHARE * time_left())

    async def shake_hands() -> None:
        security = distributed.Security().get_connection_args("client")
        async with asyncio.timeout(seconds):  # Dask's own does not count the answer
            comm = await distributed.comm.connect(address, timeout=seconds, **security)
        await comm.close()

    with ThreadPoolExecutor(1) as thread:  # the caller may be in an event loop
        thread.submit(asyncio.run, shake_hands()).result()
    return distributed.Client(address, timeout=seconds, set_as_default=False)


@contextmanager
def _silence() -> Iterator[None]:
    """Let Dask say nothing in the block: what matters is raised, as an error of ours."""
    names = [n for n in logging.root.manager.loggerDict if n.partition(".")[0] in _LOGGERS]
    levels = {logger: logger.level for logger in map(logging.getLogger, names)}
    try:
        for logger in levels:
            logger.setLevel(logging.CRITICAL + 1)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # versions are compared below
            warnings.simplefilter("always", Note)
            yield
    finally:
        for logger, level in levels.items():
            logger.setLevel(level)


class Cluster:
    """The workers of a cluster, as `planners.parallel.workers.Begin`."""

    def __init__(self, client: Any, where: str) -> None:
        self.client, self._where = client, where

    @contextmanager
    def __call__(self, batch: Batch, jobs: Sequence[Any]) -> Iterator[list[Future[Outcome]]]:
        """Send jobs, which the scheduler begins in their order.

        What they share is a plugin of the workers, so that one that joins later has it, too.
        Raises `UsageError` if a worker has other versions than are here, `OutOfMemory` if several
        are lost in one job, `CoordlangError` if the scheduler is gone.
        """
        name = f"coordlang-{uuid4().hex}"
        expected = versions(*batch.packages)
        executor = self.client.get_executor(pure=False, retries=0)
        try:
            self._require_workers()
            found = self.client.run(versions, *batch.packages, on_error="return")
            for worker, theirs in found.items():
                _compare(f"the worker {worker}", theirs, expected)
            self.client.register_plugin(_Shared(Packed(batch)), name=name)
            yield [executor.submit(_do, name, expected, job) for job in jobs]
        except KilledWorker:
            raise OutOfMemory(
                f"{batch.name}: several workers were lost in one job: probably there is no memory "
                "for it",
                remedy="Give the workers more memory (dask worker --memory-limit), or use smaller "
                "or fewer tasks.",
            ) from None
        except _GONE:
            raise self._gone() from None
        except (ImportError, TypeError, RuntimeError) as error:  # a job cannot be read there
            if self.client.status != "running":
                raise self._gone() from None
            raise _other_version("the scheduler or a worker", error.__cause__ or error) from None
        finally:  # jobs that are not begun are dropped; those under way end by themselves, unheard
            # ValueError, LookupError: a plugin that is not there yet, or not on every worker.
            with postponed_signals(), suppress(RuntimeError, ValueError, LookupError, *_GONE):
                executor.shutdown(wait=False)
                if self.client.status == "running":
                    self.client.unregister_worker_plugin(name)

    def _gone(self) -> CoordlangError:
        return CoordlangError(
            f"the Dask scheduler {self._where} has gone, or has dropped the work",
            remedy="Start it again; with --resume DIR the finished jobs are kept.",
        )

    def _require_workers(self) -> None:
        """Wait for a worker, and say that once."""
        said = False
        while not self.client.scheduler_info(n_workers=-1).get("workers"):  # none: it has gone
            if self.client.status != "running":
                raise self._gone()
            if not said:
                note(f"no worker has connected to {self._where} so far: waiting for one")
                said = True
            with suppress(TimeoutError):
                self.client.wait_for_workers(1, timeout=_TICK)


def _address_in(file: str) -> str:
    """The address that a scheduler has written into a file."""
    try:
        address = str(json.loads(Path(file).read_bytes())["address"])
    except OSError as error:
        raise UsageError(
            f"--scheduler {echoed(file)}: {error.strerror}, and it is no address",
            remedy="Say tcp://HOST:PORT, or the file that `dask scheduler --scheduler-file FILE` "
            "has written.",
        ) from None
    except (ValueError, RecursionError, LookupError, TypeError):
        address = ""
    if not _ADDRESS.fullmatch(address):
        raise UsageError(
            f"--scheduler {echoed(file)} is no file of a Dask scheduler",
            remedy="Name the file that `dask scheduler --scheduler-file FILE` has written.",
        )
    return address


# ---- here and on the Dask workers


@cache
def versions(*packages: str) -> list[tuple[str, str]]:
    """What the results of the packages' code depend on, by package, in this process."""
    python = ".".join(platform.python_version_tuple()[:2])
    needed = f"Python {python}", f"numpy {version('numpy')}", f"scipy {version('scipy')}"
    found = []
    for package in packages:
        __import__(package)
        found += [(package, one) for one in (*needed, f"the code {code_hash(package)[:12]}")]
    return found


def _compare(
    who: str, theirs: list[tuple[str, str]] | Exception, ours: Sequence[tuple[str, str]]
) -> None:
    """Refuse other versions; an error is that of a worker that has none."""
    if isinstance(theirs, OSError):  # it has just been lost
        return
    if isinstance(theirs, Exception):
        raise _other_version(who, theirs)
    for (package, its), (_, wanted) in zip(theirs, ours, strict=True):
        if its != wanted:
            raise _other_version(who, f"{package} has {its} there, {wanted} here")


def _other_version(who: str, difference: object) -> UsageError:
    said = str(difference).partition("\n")[0]
    return UsageError(
        f"{who} does not do the same work: {said}",
        remedy="Use one environment for client, scheduler and workers, or install the same "
        "versions everywhere (pip install 'coordlang[cluster]').",
    )


class _Shared(distributed.WorkerPlugin):  # type: ignore[misc]
    """The work of a batch, on each worker."""

    def __init__(self, work: Packed) -> None:
        self.work = work


def _do(name: str, expected: list[tuple[str, str]], job: Any) -> Any:
    """One job, as a task; see `planners.parallel.batch.Packed.attempt`."""
    worker = distributed.get_worker()
    _compare(f"the worker {worker.address}", versions(*dict(expected)), expected)
    return worker.plugins[name].work.attempt(job)
