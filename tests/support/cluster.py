# SPDX-License-Identifier: GPL-3.0-or-later
"""A Dask cluster for tests: its scheduler and its workers are processes of their own."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from importlib.util import find_spec
from pathlib import Path

import psutil
import pytest

from tests.support.domains import ROOT
from tests.support.jobs import until

needs_distributed = pytest.mark.skipif(
    find_spec("distributed") is None,
    reason="distributed is not installed (pip install 'coordlang[cluster]')",
)

#: Programs of this environment come first; workers import this checkout.
ENVIRONMENT = {
    **os.environ,
    "PATH": os.pathsep.join((str(Path(sys.executable).parent), os.environ.get("PATH", ""))),
    "PYTHONPATH": os.pathsep.join((str(ROOT), os.environ.get("PYTHONPATH", ""))),
    "DASK_DISTRIBUTED__SCHEDULER__DASHBOARD__STATUS__TASK_STREAM_LENGTH": "1",
}


class Started:
    """A shell command in a process group of its own, its stderr in a file."""

    def __init__(self, command: str, folder: Path, name: str) -> None:
        self.log = folder / f"{name}.log"
        with self.log.open("wb") as log:
            self._process = subprocess.Popen(
                ["sh", "-c", command],
                cwd=folder,
                env=ENVIRONMENT,
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=log,
                start_new_session=True,
            )

    def kill(self, number: int = signal.SIGKILL) -> None:
        """Send a signal to all processes of the command."""
        with suppress(ProcessLookupError):
            os.killpg(self._process.pid, number)

    def processes(self) -> list[psutil.Process]:
        """Its processes."""
        first = psutil.Process(self._process.pid)
        return [first, *first.children(recursive=True)]

    def end(self) -> None:
        """End all of it."""
        self.kill(signal.SIGTERM)
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(5)
        self.kill()
        self._process.wait()


_HERE = "--host 127.0.0.1 --no-dashboard --dashboard-address 127.0.0.1:0"
SCHEDULER = f"dask scheduler --scheduler-file scheduler.json --port 0 {_HERE}"
WORKER = f"dask worker --scheduler-file scheduler.json --nworkers 1 --nthreads 1 --memory-limit 1GiB {_HERE}"


@dataclass
class Cluster:
    """A scheduler, and workers that are started one by one; ``file`` names the scheduler."""

    folder: Path
    command: str
    scheduler: Started
    workers: list[Started] = field(default_factory=list)

    @property
    def file(self) -> Path:
        return self.folder / "scheduler.json"

    def add_worker(self) -> Started:
        """Start one more ``dask worker``."""
        name = f"worker-{len(self.workers)}"
        self.workers.append(Started(f"exec {self.command}", self.folder, name))
        return self.workers[-1]


@contextmanager
def running_cluster(
    folder: Path, workers: int, scheduler: str = SCHEDULER, worker: str = WORKER
) -> Iterator[Cluster]:
    """A cluster with so many ``dask worker`` commands, until the block ends."""
    if shutil.which("dask", path=ENVIRONMENT["PATH"]) is None:
        pytest.skip("the program dask is not there")
    cluster = Cluster(folder, worker, Started(f"exec {scheduler}", folder, "scheduler"))
    try:
        until(lambda: cluster.file.exists() and cluster.file.stat().st_size)
        for _ in range(workers):
            cluster.add_worker()
        yield cluster
    finally:
        for started in (*cluster.workers, cluster.scheduler):
            started.end()
