# SPDX-License-Identifier: GPL-3.0-or-later
"""Jobs for tests, done by other processes: functions that can be sent by name, and waiting for them."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

import numpy as np

from planners.parallel.batch import Batch, Function, Table, digest
from planners.system.errors import BadInput, Position


def squares(shared: int, job: range) -> Table:
    """The squares of some numbers, times what is shared, and who worked them out."""
    return {"values": shared * np.array(job, np.int64) ** 2, "process": np.array([os.getpid()])}


def fails(_: object, job: int) -> Table:
    """An error of ours for job 1, a bug for any other."""
    if job == 1:
        raise BadInput("no good", position=Position("here", 3, 4), remedy="Try 2.")
    raise ZeroDivisionError("a bug")


def dies_once(folder: str, job: int) -> Table:
    """Job 0 loses its process the first time, and every time if the folder says so."""
    mark = Path(folder, f"died-{job}")
    if job == 0 and (Path(folder, "always").exists() or not mark.exists()):
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return {"values": np.array([job])}


def takes_memory(_: object, job: int) -> Table:
    """So many MiB at once."""
    return {"values": np.ones(job << 17)[:1]}


def waits(folder: str, job: int) -> Table:
    """Say which process does it, then wait until the folder says that it may go on."""
    Path(folder, f"pid-{os.getpid()}-{job}").touch()
    while not Path(folder, "go").exists():
        time.sleep(0.02)
    return {"values": np.array([job])}


def removes(folder: str, job: int) -> Table:
    """Half write a file, and remove it when asked to end: job 1 takes a while for that."""
    half = Path(folder, f"half-{job}")
    half.touch()
    try:
        Path(folder, f"pid-{os.getpid()}").touch()
        time.sleep(60)
    finally:
        time.sleep(0.3 * job)
        half.unlink()
    return {}


def batch(
    function: Function,
    shared: object,
    jobs: Iterable[object],
    efforts: Sequence[float] | None = None,
) -> Batch:
    """These jobs, each large enough for processes."""
    listed = list(jobs)
    return Batch("a test", function, shared, listed, digest(shared), efforts or [1e6] * len(listed))


def until(condition: Callable[[], object], seconds: float = 60) -> None:
    """Wait for it."""
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.02)


def runs(pid: int) -> bool:
    """Whether there is such a process, and it is no zombie."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False


def workers(folder: Path) -> list[int]:
    """The processes that `waits` and `removes` have met."""
    return [int(path.name.split("-")[1]) for path in folder.glob("pid-*")]
