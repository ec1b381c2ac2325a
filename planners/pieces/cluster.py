# SPDX-License-Identifier: GPL-3.0-or-later
"""Pieces on a running Dask cluster (the extra ``cluster``).

Every piece is a Dask task, done in a worker process that the Dask worker starts and keeps: it can
be ended at any moment, and has a memory limit of its own.  A task whose Dask worker is lost is
done again elsewhere: Dask sees to that.
"""

from __future__ import annotations

import json
import logging
import os
import pickle
import warnings
from collections.abc import Callable, Generator, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from uuid import uuid4

from planners.errors import CoordlangError, OutOfMemory, UsageError
from planners.messages import echoed
from planners.pieces.versions import versions_here
from planners.pieces.work import Done, Report, Work, silent
from planners.pieces.worker_process import packed_piece, packed_work
from planners.signals import postponed_signals

#: Seconds in which a scheduler must answer.
_CONNECTING = "10s"


@dataclass(frozen=True, slots=True)
class Order:
    """What a task says besides its piece: see `Work`, and the versions that are expected."""

    plugin: str
    packages: tuple[str, ...]
    versions: dict[str, str]
    work: str
    isolated: bool
    limit: float | None


class ClusterFailed(CoordlangError):
    """The cluster is gone, or its workers are lost again and again."""


@contextmanager
def cluster(
    where: str, packages: tuple[str, ...], note: Callable[[str], None]
) -> Iterator[Cluster]:
    """Connect to a running cluster, and leave nothing of ours on it.

    Parameters
    ----------
    where
        The address of its scheduler, or the file that the scheduler has written.
    packages
        The packages whose code does the pieces: it must be the same on all workers.
    note
        Called with a line of text for a person: that there are no workers yet.

    Raises
    ------
    UsageError
        Where no scheduler answers, or the versions of a worker are others than here.
    """
    distributed = _distributed()
    logger = logging.getLogger("distributed")
    level = logger.level
    logger.setLevel(logging.CRITICAL + 1)  # what matters is raised here, as an error of ours
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # versions are compared below
            client = _client(distributed, where)
        try:
            yield Cluster(client, where, packages, note)
        finally:
            with postponed_signals(), suppress(OSError, TimeoutError):
                client.close()
    finally:
        logger.setLevel(level)


class Cluster:
    """Does pieces on a Dask cluster, whatever their number."""

    def __init__(
        self, client: Any, where: str, packages: tuple[str, ...], note: Callable[[str], None]
    ) -> None:
        self._client, self._where, self._packages, self._note = client, where, packages, note
        self._expected = versions_here(packages)

    def run(self, work: Work, report: Report = silent) -> Generator[Done]:
        """See `planners.pieces.work.Runner.run`."""
        if not work.pieces:
            return
        self._require_equal_versions()
        name = f"coordlang-{uuid4().hex}"
        futures: dict[Any, int] = {}
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # of large values in a task
                # What all pieces share goes with the plugin, so that a worker that joins later has
                # it too, and pieces depend on nothing: Dask sends them to whoever is free.
                self._client.register_plugin(_plugin(name, packed_work(work)), name=name)
                self._submit(work, name, futures)
            yield from self._results(work, futures, report)
        finally:
            with postponed_signals(), suppress(OSError, TimeoutError, RuntimeError):
                self._client.cancel(list(futures), reason="no longer wanted")
                futures.clear()
                self._client.unregister_worker_plugin(name)

    def _submit(self, work: Work, name: str, futures: dict[Any, int]) -> None:
        """Send all pieces; the scheduler begins them in their order."""
        order = Order(name, self._packages, self._expected, work.name, work.isolated, work.limit)
        for number in range(len(work.pieces)):
            future = self._client.submit(
                _do,
                packed_piece(work, number),
                order,
                key=f"{name}-{number}",
                priority=-number,
                pure=False,
                retries=0,
            )
            futures[future] = number

    def _results(self, work: Work, futures: dict[Any, int], report: Report) -> Generator[Done]:
        """Yield pieces as they end."""
        distributed = _distributed()
        left = set(futures.values())
        report(sorted(left))
        for future in distributed.as_completed(list(futures), loop=self._client.loop):
            number = futures[future]
            done = self._done(work, number, future)
            del futures[future]  # the cluster may forget its result
            left.discard(number)
            report(sorted(left))
            yield done

    def _done(self, work: Work, number: int, future: Any) -> Done:
        """The piece of a future that has ended."""
        if future.status == "finished":
            return Done(number, *pickle.loads(future.result()))
        if future.status == "error":
            error = future.exception()
            if type(error).__name__ != "KilledWorker":
                return Done(number, None, error)
            if work.isolated:
                return Done(number, None, None, "died")
            raise OutOfMemory(
                f"{work.name}: several workers were lost in one piece of the work: probably there "
                "is no memory for it",
                remedy="Give the workers more memory (dask worker --memory-limit), or use smaller "
                "or fewer tasks.",
            )
        raise ClusterFailed(
            f"the Dask scheduler {self._where} has gone, or has dropped the work",
            remedy="Start it again; with --resume DIR the finished pieces are kept.",
        )

    def _require_equal_versions(self) -> None:
        """Compare what is installed on the workers that are there with what is installed here."""
        if not self._client.scheduler_info(n_workers=-1)["workers"]:
            self._note(f"no worker has connected to {self._where} so far: waiting for one")
            self._client.wait_for_workers(1)
        expected, packages = self._expected, self._packages

        def found() -> str | None:  # sent as it is: a worker may have no coordlang at all
            try:
                from planners.pieces.versions import differing
            except ImportError as error:
                return f"coordlang is missing there ({error})"
            return differing(expected, packages)

        for address, difference in sorted(self._client.run(found).items()):
            if difference is not None:
                raise _other_version(address, difference)


def _other_version(address: str, difference: str) -> UsageError:
    return UsageError(
        f"the worker {address} does not do the same work: {difference}",
        remedy="Use one environment for client, scheduler and workers, or install the same "
        "versions everywhere (pip install 'coordlang[cluster]').",
    )


def _distributed() -> Any:
    """The library, imported where it is used.

    Raises
    ------
    UsageError
        If it is not installed.
    """
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
    address = where if "://" in where or _is_address(where) else _address_in(where)
    try:
        return distributed.Client(address, timeout=_CONNECTING, set_as_default=False)
    except (OSError, TimeoutError, ValueError) as error:
        raise UsageError(
            f"no Dask scheduler answers at {echoed(where)} ({echoed(str(error))})",
            remedy="Start one: dask scheduler --scheduler-file FILE.",
        ) from None


def _address_in(file: str) -> str:
    """The address that a scheduler has written into a file."""
    try:
        address = json.loads(Path(file).read_bytes())["address"]
    except OSError as error:
        raise UsageError(
            f"--scheduler {echoed(file)}: {error.strerror}, and it is no address",
            remedy="Say tcp://HOST:PORT, or the file that `dask scheduler --scheduler-file FILE` "
            "has written.",
        ) from None
    except (ValueError, KeyError, TypeError):
        raise UsageError(
            f"--scheduler {echoed(file)} is no file of a Dask scheduler",
            remedy="Name the file that `dask scheduler --scheduler-file FILE` has written.",
        ) from None
    return str(address)


def _is_address(text: str) -> bool:
    """Whether this is HOST:PORT."""
    host, _, port = text.rpartition(":")
    return bool(host) and port.isdecimal() and not os.path.exists(text)


# ---- on the Dask workers


def _plugin(name: str, work: bytes) -> Any:
    """What a Dask worker has of ours, while our work is on the cluster."""
    from planners.pieces.dask_worker import WorkerProcesses

    return WorkerProcesses(name, work)


def _do(piece: bytes, order: Order) -> bytes:
    """One piece, as a task."""
    from planners.pieces.dask_worker import do

    return do(piece, order)
