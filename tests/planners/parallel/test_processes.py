# SPDX-License-Identifier: GPL-3.0-or-later
"""Worker processes: equal results, errors as they are here, losses, limits, and clean ends."""

from __future__ import annotations

import errno
import os
import signal
import subprocess
import sys
from multiprocessing import resource_tracker, spawn
from multiprocessing.context import SpawnProcess
from pathlib import Path

import pytest

from planners.parallel.workers import Workers
from planners.system.errors import BadInput, OutOfMemory, OutOfTime, UsageError
from planners.system.limits import address_space, limited_memory, time_limit
from tests.support import jobs
from tests.support.domains import ROOT
from tests.support.jobs import batch, runs, until, workers

TWO = Workers(2)
#: How a script begins that has jobs done by two processes.
SCRIPT = (
    "import signal, sys\n"
    "signal.signal(signal.SIGINT, signal.default_int_handler)  # ignored in the background\n"
    "from planners.parallel.workers import Workers; from tests.support import jobs\n"
)


def test_jobs_do_not_matter_and_small_work_stays_here() -> None:
    parts = [range(low, low + 3) for low in range(0, 15, 3)]
    squares = batch(jobs.squares, 3, parts)
    results = {
        number: [table["values"].tolist() for table in Workers(number).tables(squares)]
        for number in (1, 2)
    }
    assert results[1] == results[2] == [[3 * n * n for n in part] for part in parts]
    elsewhere = {int(table["process"][0]) for table in TWO.tables(squares)}
    assert os.getpid() not in elsewhere
    small = batch(jobs.squares, 3, parts, efforts=[1.0] * len(parts))
    here = {int(table["process"][0]) for table in TWO.tables(small)}
    assert here == {os.getpid()}


@pytest.mark.parametrize("number", [1, 2])
def test_errors_are_those_of_the_first_job_that_has_one(number: int) -> None:
    with pytest.raises(BadInput) as caught:
        list(Workers(number).tables(batch(jobs.fails, None, [1, 0, 1])))
    assert str(caught.value) == "here:3:4: no good\n  Try 2."
    with pytest.raises(ZeroDivisionError, match="a bug"):
        list(Workers(number).tables(batch(jobs.fails, None, [0, 1])))


def test_a_job_whose_worker_dies_is_done_again(tmp_path: Path) -> None:
    again = batch(jobs.dies_once, str(tmp_path), [0, 1, 2])
    assert [int(table["values"][0]) for table in TWO.tables(again)] == [0, 1, 2]
    (tmp_path / "always").touch()
    with pytest.raises(OutOfMemory, match="lost its worker 2 times"):
        list(TWO.tables(again))


@pytest.mark.thorough
def test_memory_is_divided_among_processes() -> None:
    with limited_memory(address_space() + (1 << 30)):
        assert len(list(TWO.tables(batch(jobs.takes_memory, None, [100, 100])))) == 2
        with pytest.raises(MemoryError):
            list(TWO.tables(batch(jobs.takes_memory, None, [100, 700])))
        assert len(list(Workers().tables(batch(jobs.takes_memory, None, [700])))) == 1


def script(folder: Path, lines: str) -> subprocess.Popen[bytes]:
    """A program that begins with `SCRIPT`, and the folder as its argument."""
    return subprocess.Popen(
        [sys.executable, "-c", SCRIPT + lines, folder],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGKILL])
def test_no_worker_is_left(number: signal.Signals, tmp_path: Path) -> None:
    """And one that is asked to end removes what it writes."""
    process = script(
        tmp_path, "list(Workers(2).tables(jobs.batch(jobs.removes, sys.argv[1], [0, 1])))"
    )
    until(lambda: len(workers(tmp_path)) == 2)
    process.send_signal(number)
    process.communicate(timeout=60)
    until(lambda: not any(map(runs, workers(tmp_path))))
    assert number == signal.SIGKILL or list(tmp_path.glob("half-*")) == []


def test_no_worker_is_left_when_time_is_over(tmp_path: Path) -> None:
    with pytest.raises(OutOfTime), time_limit(1.5):
        list(TWO.tables(batch(jobs.waits, str(tmp_path), [0, 1])))
    assert not any(map(runs, workers(tmp_path)))


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGKILL])
def test_one_worker_is_ended_and_its_job_done_by_another(
    number: signal.Signals, tmp_path: Path
) -> None:
    process = script(
        tmp_path,
        "found = Workers(2).tables(jobs.batch(jobs.waits, sys.argv[1], [0, 1, 2]))\n"
        "print([int(table['values'][0]) for table in found])",
    )
    until(lambda: len(workers(tmp_path)) == 2)
    os.kill(workers(tmp_path)[0], number)
    until(lambda: len(workers(tmp_path)) == 3)
    (tmp_path / "go").touch()
    assert process.communicate(timeout=60) == (b"[0, 1, 2]\n", b"")


def test_workers_that_cannot_start(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    given = batch(jobs.squares, 3, [range(2), range(3)])
    resource_tracker.ensure_running()  # it is started by the same program
    # One that ended at once would close its pipes while the next one is given them.
    program = tmp_path / "ends"
    program.write_text("#!/bin/sh\nsleep 0.2\nexit 1\n")
    program.chmod(0o755)
    monkeypatch.setattr(spawn, "_python_exe", os.fsencode(program))
    with pytest.raises(OutOfMemory, match="lost its worker 2 times") as caught:
        list(TWO.tables(given))
    assert "--jobs 1" in str(caught.value)

    def refused(*_: object) -> None:
        raise BlockingIOError(errno.EAGAIN, os.strerror(errno.EAGAIN))

    monkeypatch.setattr(SpawnProcess, "start", refused)
    with pytest.raises(UsageError, match="cannot be started: Resource temporarily") as error:
        list(TWO.tables(given))
    assert "--jobs 1" in str(error.value)


def test_the_iterator_may_be_left_early(tmp_path: Path) -> None:
    (tmp_path / "go").touch()
    running = TWO.tables(batch(jobs.waits, str(tmp_path), range(8)))
    assert int(next(running)["values"][0]) == 0
    running.close()
    assert not any(map(runs, workers(tmp_path)))


def test_a_script_without_main_guard_is_not_run_again(tmp_path: Path) -> None:
    (tmp_path / "script.py").write_text(
        SCRIPT
        + "print(len(list(Workers(2).tables(jobs.batch(jobs.squares, 1, [range(2)] * 2)))))\n"
    )
    program = [sys.executable, "-P", "script.py"]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    done = subprocess.run(
        program, cwd=tmp_path, env=environment, capture_output=True, check=True, timeout=60
    )
    assert done.stdout == b"2\n"
