# SPDX-License-Identifier: GPL-3.0-or-later
"""Jobs on a Dask cluster: equal results, errors, losses, limits, and nothing left behind."""

from __future__ import annotations

import gc
import os
import signal
import socket
import socketserver
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from planners.parallel.workers import Workers
from planners.parallel.workers import workers as opened
from planners.system.errors import BadInput, CoordlangError, Note, OutOfTime, UsageError
from planners.system.limits import time_limit
from tests.support import cluster as dask
from tests.support import jobs, thorough
from tests.support.cluster import ENVIRONMENT, Cluster, needs_distributed, running_cluster
from tests.support.domains import DOMAINS
from tests.support.jobs import batch, until, workers

pytestmark = needs_distributed


@pytest.fixture(scope="module")
def shared(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Cluster]:
    """A cluster with one worker, for all that does not hurt it."""
    with running_cluster(tmp_path_factory.mktemp("cluster"), 1) as found:
        yield found


@pytest.fixture
def connected(shared: Cluster) -> Iterator[Workers]:
    with opened(scheduler=str(shared.file)) as found:
        yield found


def left_on(found: Workers) -> tuple[int, list[str]]:
    """How many tasks the scheduler knows, and our plugins on it."""

    def look(dask_scheduler: Any) -> tuple[int, list[str]]:
        ours = [name for name in dask_scheduler.worker_plugins if name.startswith("coordlang")]
        return len(dask_scheduler.tasks), ours

    client: Any = found.cluster.client  # type: ignore[union-attr]
    left: tuple[int, list[str]] = client.run_on_scheduler(look)
    return left


def test_results_and_errors(connected: Workers) -> None:
    squares = batch(jobs.squares, 3, [range(low, low + 3) for low in range(0, 12, 3)])
    found = [table["values"].tolist() for table in connected.tables(squares)]
    assert found == [[3 * n * n for n in part] for part in squares.jobs]
    assert list(connected.tables(batch(jobs.squares, 3, []))) == []
    with pytest.raises(BadInput) as caught:
        list(connected.tables(batch(jobs.fails, None, [1, 0, 1])))
    assert str(caught.value) == "here:3:4: no good\n  Try 2."
    with pytest.raises(ZeroDivisionError):
        list(connected.tables(batch(jobs.fails, None, [0, 1])))
    until(lambda: left_on(connected) == (0, []))


@pytest.mark.parametrize(("ends", "limit"), [(KeyboardInterrupt, None), *thorough((OutOfTime, 2))])
def test_work_that_is_stopped_leaves_nothing(
    ends: type[BaseException], limit: int | None, connected: Workers, tmp_path: Path
) -> None:
    def interrupt() -> None:
        until(lambda: workers(tmp_path))
        os.kill(os.getpid(), signal.SIGINT)

    waiting = batch(jobs.waits, str(tmp_path), [0, 1, 2])
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    if limit is None:
        threading.Thread(target=interrupt).start()
    try:
        with pytest.raises(ends), time_limit(limit):
            list(connected.tables(waiting))
    finally:
        signal.signal(signal.SIGINT, before)
    (tmp_path / "go").touch()  # what is under way ends by itself
    until(lambda: left_on(connected) == (0, []))
    assert len(workers(tmp_path)) == 1  # no other job was begun
    done = list(connected.tables(batch(jobs.squares, 1, [range(2)])))
    assert len(done) == 1  # the worker is as good as before


def test_other_versions_are_refused(connected: Workers, monkeypatch: pytest.MonkeyPatch) -> None:
    from planners.parallel import dask_cluster

    ours = [("planners", "Python 2.7"), *dask_cluster.versions("planners")[1:]]
    monkeypatch.setattr(dask_cluster, "versions", lambda *_: ours)
    with pytest.raises(UsageError, match=r"has Python 3.* there, Python 2.7 here") as caught:
        list(connected.tables(batch(jobs.squares, 1, [range(2)])))
    assert "coordlang[cluster]" in str(caught.value)


@pytest.fixture
def noise() -> Iterator[str]:
    """The address of a port where somebody else answers."""

    class Handler(socketserver.BaseRequestHandler):
        def handle(self) -> None:
            self.request.sendall(b"HTTP/1.1 400 Bad Request\r\n\r\n" * 50)

    with socketserver.ThreadingTCPServer(("127.0.0.1", 0), Handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"tcp://127.0.0.1:{server.server_address[1]}"
        server.shutdown()


@pytest.fixture
def silence() -> Iterator[str]:
    """The address of a port where nobody answers."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        yield f"tcp://127.0.0.1:{server.getsockname()[1]}"


def test_there_is_no_cluster(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    noise: str,
    silence: str,
    capfd: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr("planners.parallel.dask_cluster._CONNECTING", 0.4)
    (tmp_path / "not.json").write_text("nothing")
    (tmp_path / "nested.json").write_text("[" * 100_000)
    (tmp_path / "other.json").write_text('{"address": "ucx://127.0.0.1:9"}')
    for where in (
        noise,
        silence,
        noise.replace("tcp", "tls"),
        "tcp://127.0.0.1:9",
        "127.0.0.1:9",
        "tcp://127.0.0.1:99999",
        "ftp://127.0.0.1:9",
        "",
        str(tmp_path),
        *(str(tmp_path / name) for name in ("none.json", "not.json", "nested.json", "other.json")),
    ):
        with pytest.raises(UsageError, match="scheduler"), opened(scheduler=where):
            pytest.fail("there is none")
    gc.collect()  # a client that has failed would go on
    assert capfd.readouterr() == ("", "")


@pytest.mark.thorough
def test_the_command_says_it_within_its_limit(silence: str) -> None:
    files = [DOMAINS / "grid" / f"{stem}.pddl" for stem in ("domain", "corners-6x6")]
    limits = ["--tasks", "all", "-o", "-", "--scheduler", silence, "--time-limit", "3"]
    command = [sys.executable, "-m", "coordlang", "build", *map(str, files), *limits]
    done = subprocess.run(command, capture_output=True, text=True, env=ENVIRONMENT)
    assert (done.returncode, done.stdout) == (2, "")
    assert len(done.stderr.splitlines()) == 2
    assert "no Dask scheduler answers" in done.stderr


@pytest.mark.slow
@pytest.mark.parametrize("other", ["scheduler", "worker"])
def test_other_code_that_cannot_read_a_job(other: str, tmp_path: Path) -> None:
    (tmp_path / "planners").mkdir()
    (tmp_path / "planners" / "__init__.py").touch()
    commands = {"scheduler": dask.SCHEDULER, "worker": dask.WORKER}
    commands[other] = f"env PYTHONPATH={tmp_path} {commands[other]}"
    with (
        running_cluster(tmp_path, 1, **commands) as cluster,
        opened(scheduler=str(cluster.file)) as found,
        pytest.raises(UsageError, match=r"worker .*not do the same work: .*planners\.parallel"),
    ):
        list(found.tables(batch(jobs.squares, 1, [range(2)])))


@pytest.mark.slow
def test_a_worker_is_waited_for_and_said_within_the_time_limit(tmp_path: Path) -> None:
    squares = batch(jobs.squares, 1, [range(2)])
    with running_cluster(tmp_path, 0) as cluster, opened(scheduler=str(cluster.file)) as found:
        with pytest.warns(Note, match="no worker"), pytest.raises(OutOfTime), time_limit(2):
            list(found.tables(squares))
        threading.Timer(0.5, cluster.add_worker).start()
        with pytest.warns(Note, match="no worker has connected"):
            assert len(list(found.tables(squares))) == 1


@pytest.mark.slow
@pytest.mark.parametrize("begun", [True, False])
def test_a_scheduler_that_goes_is_an_error(begun: bool, tmp_path: Path) -> None:
    def kill() -> None:
        until(lambda: workers(tmp_path) or not begun)
        cluster.scheduler.kill(signal.SIGKILL)

    with running_cluster(tmp_path, 1) as cluster, opened(scheduler=str(cluster.file)) as found:
        if begun:
            threading.Thread(target=kill).start()
        else:
            kill()
            until(lambda: found.cluster.client.status == "closed")  # type: ignore[union-attr]
        with pytest.raises(CoordlangError, match="has gone"):
            list(found.tables(batch(jobs.waits, str(tmp_path), [0, 1])))
