# SPDX-License-Identifier: GPL-3.0-or-later
"""Pieces on a Dask cluster: equal results, errors, losses, limits, and nothing left behind."""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from planners.errors import BadInput, CoordlangError, OutOfMemory, OutOfTime, UsageError
from planners.limits import time_limit
from planners.pieces import cluster as cluster_module
from planners.pieces.runners import Where, runner
from planners.pieces.work import Runner, tables
from tests.support import pieces
from tests.support.cluster import Cluster, needs_distributed, running_cluster
from tests.support.pieces import work
from tests.support.processes import runs, until, workers

pytestmark = needs_distributed

PACKAGES = ("planners", "tests")


@pytest.fixture(scope="module")
def shared(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Cluster]:
    """A cluster with one worker, for all that does not hurt it."""
    with running_cluster(tmp_path_factory.mktemp("cluster"), 1) as found:
        yield found


@pytest.fixture
def connected(shared: Cluster) -> Iterator[Runner]:
    with runner(Where(scheduler=str(shared.file)), PACKAGES) as found:
        yield found


def left_on(found: Any) -> tuple[int, list[str]]:
    """How many tasks the scheduler knows, and our plugins on it."""

    def look(dask_scheduler: Any) -> tuple[int, list[str]]:
        ours = [name for name in dask_scheduler.worker_plugins if name.startswith("coordlang")]
        return len(dask_scheduler.tasks), ours

    left: tuple[int, list[str]] = found._client.run_on_scheduler(look)
    return left


def test_results_errors_and_losses(connected: Runner, tmp_path: Path) -> None:
    squares = work(pieces.squares, 3, [range(low, low + 3) for low in range(0, 12, 3)])
    found = [table["values"].tolist() for table in tables(connected.run(squares))]
    assert found == [[3 * n * n for n in part] for part in squares.pieces]
    assert list(connected.run(work(pieces.squares, 3, []))) == []
    with pytest.raises(BadInput) as caught:
        list(tables(connected.run(work(pieces.fails, None, [1, 0, 1]))))
    assert str(caught.value) == "here:3:4: no good\n  Try 2."
    with pytest.raises(ZeroDivisionError):
        list(tables(connected.run(work(pieces.fails, None, [0, 1]))))
    again = work(pieces.dies_once, str(tmp_path), [0, 1])
    assert [int(table["values"][0]) for table in tables(connected.run(again))] == [0, 1]
    (tmp_path / "always").touch()
    with pytest.raises(OutOfMemory, match="lost its process"):
        list(tables(connected.run(again)))
    isolated = work(pieces.dies_once, str(tmp_path), [0, 1], isolated=True)
    assert {done.number: done.lost for done in connected.run(isolated)} == {0: "died", 1: None}
    with pytest.raises(MemoryError):  # a worker of this cluster may have 1 GiB
        list(tables(connected.run(work(pieces.takes_memory, None, [100, 1000]))))
    until(lambda: left_on(connected) == (0, []))


@pytest.mark.thorough
@pytest.mark.parametrize("how", ["interrupt", "time limit"])
def test_work_that_is_stopped_leaves_nothing(how: str, connected: Runner, tmp_path: Path) -> None:
    def interrupt() -> None:
        until(lambda: workers(tmp_path))
        os.kill(os.getpid(), signal.SIGINT)

    waiting = work(pieces.waits, str(tmp_path), [0, 1, 2])
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        if how == "interrupt":
            threading.Thread(target=interrupt).start()
            with pytest.raises(KeyboardInterrupt):
                list(tables(connected.run(waiting)))
        else:
            with pytest.raises(OutOfTime), time_limit(4):
                list(tables(connected.run(waiting)))
            assert workers(tmp_path)
    finally:
        signal.signal(signal.SIGINT, before)
    until(lambda: not any(map(runs, workers(tmp_path))), 20)
    until(lambda: left_on(connected) == (0, []))
    done = list(tables(connected.run(work(pieces.squares, 1, [range(2)]))))
    assert len(done) == 1  # the worker is as good as before


def test_other_versions_are_refused(connected: Runner, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(connected._expected, "numpy", "1.0")  # type: ignore[attr-defined]
    with pytest.raises(UsageError, match=r"numpy is .* there and 1.0 here") as caught:
        list(connected.run(work(pieces.squares, 1, [range(2)])))
    assert "coordlang[cluster]" in str(caught.value)


def test_there_is_no_cluster(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cluster_module, "_CONNECTING", "1s")
    (tmp_path / "not.json").write_text("nothing")
    for where in (
        str(tmp_path / "none.json"),
        "tcp://127.0.0.1:9",
        "127.0.0.1:9",
        str(tmp_path / "not.json"),
    ):
        with pytest.raises(UsageError, match="scheduler"), runner(Where(scheduler=where)):
            pytest.fail("there is none")


@pytest.mark.slow
def test_a_worker_is_waited_for_and_said(tmp_path: Path) -> None:
    notes: list[str] = []
    with (
        running_cluster(tmp_path, 0) as cluster,
        runner(Where(scheduler=str(cluster.file)), PACKAGES, notes.append) as found,
    ):
        threading.Timer(0.5, cluster.add_worker).start()
        assert len(list(found.run(work(pieces.squares, 1, [range(2)])))) == 1
    (note,) = notes
    assert "no worker has connected" in note


@pytest.mark.thorough
def test_killed_workers_cost_their_pieces_only(tmp_path: Path) -> None:
    with (
        running_cluster(tmp_path, 2) as cluster,
        runner(Where(scheduler=str(cluster.file)), PACKAGES) as found,
    ):
        until(lambda: len(found._client.scheduler_info()["workers"]) == 2)  # type: ignore[attr-defined]
        waiting = tables(found.run(work(pieces.waits, str(tmp_path), range(5))))
        threads: list[dict[str, Any]] = []
        thread = threading.Thread(target=lambda: threads.extend(waiting))
        thread.start()
        until(lambda: len(workers(tmp_path)) == 2)
        first = workers(tmp_path)
        cluster.workers[0].kill(signal.SIGKILL)
        until(lambda: sum(map(runs, first)) == 1)  # its process has ended with it
        cluster.add_worker()
        until(lambda: len(workers(tmp_path)) >= 3)
        (tmp_path / "go").touch()
        thread.join(60)
    assert [int(table["values"][0]) for table in threads] == list(range(5))


@pytest.mark.slow
def test_a_scheduler_that_goes_is_an_error(tmp_path: Path) -> None:
    def kill() -> None:
        until(lambda: workers(tmp_path))
        cluster.scheduler.kill(signal.SIGKILL)

    with (
        running_cluster(tmp_path, 1) as cluster,
        runner(Where(scheduler=str(cluster.file)), PACKAGES) as found,
    ):
        threading.Thread(target=kill).start()
        with pytest.raises(CoordlangError, match="has gone"):
            list(found.run(work(pieces.waits, str(tmp_path), [0, 1])))
