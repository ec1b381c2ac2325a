# SPDX-License-Identifier: GPL-3.0-or-later
"""A Dask cluster for tests: its scheduler and its workers are processes of their own."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from importlib.util import find_spec
from pathlib import Path

import psutil
import pytest

from tests.support.domains import ROOT

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


class Cluster:
    """A scheduler, and workers that are started one by one; ``file`` names the scheduler."""

    def __init__(self, folder: Path, scheduler: str, workers: str) -> None:
        if shutil.which("dask", path=ENVIRONMENT["PATH"]) is None:
            pytest.skip("the program dask is not there")
        self._folder, self._workers = folder, workers
        self.file = folder / "scheduler.json"
        self.scheduler = Started(f"exec {scheduler}", folder, "scheduler")
        end = time.monotonic() + 60
        while not (self.file.exists() and self.file.stat().st_size):
            assert time.monotonic() < end, self.scheduler.log.read_text()
            time.sleep(0.05)
        self.workers: list[Started] = []

    def add_worker(self) -> Started:
        """Start one more ``dask worker``."""
        name = f"worker-{len(self.workers)}"
        self.workers.append(Started(f"exec {self._workers}", self._folder, name))
        return self.workers[-1]

    def end(self) -> None:
        """End all processes."""
        for started in (*self.workers, self.scheduler):
            started.end()


_HERE = "--host 127.0.0.1 --no-dashboard --dashboard-address 127.0.0.1:0"
SCHEDULER = f"dask scheduler --scheduler-file scheduler.json --port 0 {_HERE}"
WORKER = f"dask worker --scheduler-file scheduler.json --nworkers 1 --nthreads 1 --memory-limit 1GiB {_HERE}"


@contextmanager
def running_cluster(
    folder: Path, workers: int, scheduler: str = SCHEDULER, worker: str = WORKER
) -> Iterator[Cluster]:
    """A cluster with so many ``dask worker`` commands, until the block ends."""
    cluster = Cluster(folder, scheduler, worker)
    try:
        for _ in range(workers):
            cluster.add_worker()
        yield cluster
    finally:
        cluster.end()
