# SPDX-License-Identifier: GPL-3.0-or-later
"""Worker processes: equal results, errors as they are here, losses, limits, clean ends; kept jobs."""

from __future__ import annotations

import errno
import os
import signal
import subprocess
import sys
from dataclasses import replace
from multiprocessing import current_process, resource_tracker, spawn
from multiprocessing.context import SpawnProcess
from pathlib import Path
from shutil import move
from tempfile import TemporaryDirectory
from unittest.mock import Mock

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from planners.parallel import batch as batches
from planners.parallel.batch import Batch, Store, digest
from planners.parallel.workers import Workers
from planners.parallel.workers import workers as given_workers
from planners.system.errors import BadInput, Note, OutOfMemory, OutOfTime, UsageError
from planners.system.limits import address_space, limited_memory, time_limit
from planners.system.writing import is_device, write_atomically
from tests.support import jobs, thorough
from tests.support.command import program
from tests.support.domains import ROOT
from tests.support.jobs import batch, runs, until, workers

TWO = Workers(2)
#: How a script begins that has jobs done by two processes.
SCRIPT = (
    "import signal, sys\n"
    "signal.signal(signal.SIGINT, signal.default_int_handler)  # ignored in the background\n"
    "signal.signal(signal.SIGHUP, signal.SIG_IGN)  # as by nohup\n"
    "from planners.parallel.workers import Workers; from tests.support import jobs\n"
)


def test_jobs_do_not_matter_and_small_work_stays_here(monkeypatch: pytest.MonkeyPatch) -> None:
    def who(given: Batch) -> set[int]:
        return {int(table["process"][0]) for table in TWO.tables(given)}

    parts = [range(low, low + 3) for low in range(0, 15, 3)]
    squares = batch(jobs.squares, 3, parts)
    wanted = [[3 * n * n for n in part] for part in parts]
    for number in (1, 2):
        assert [table["values"].tolist() for table in Workers(number).tables(squares)] == wanted
    assert os.getpid() not in who(squares)
    assert who(batch(jobs.squares, 3, parts, efforts=[1.0] * len(parts))) == {os.getpid()}
    monkeypatch.setitem(vars(current_process())["_config"], "daemon", True)
    assert who(squares) == {os.getpid()}  # as a worker of another pool it may start no process


@pytest.mark.parametrize("number", [1, *thorough(2)])
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
    command, pipe = [sys.executable, "-c", SCRIPT + lines, str(folder)], subprocess.PIPE
    return subprocess.Popen(command, stdout=pipe, stderr=pipe)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGKILL])
def test_no_worker_is_left(number: signal.Signals, tmp_path: Path) -> None:
    """And one that is asked to end removes what it writes."""
    work = "list(Workers(2).tables(jobs.batch(jobs.removes, sys.argv[1], [0, 1])))"
    process = script(tmp_path, work)
    until(lambda: len(workers(tmp_path)) == 2)
    process.send_signal(number)
    process.communicate(timeout=60)
    until(lambda: not any(map(runs, workers(tmp_path))))
    assert number == signal.SIGKILL or list(tmp_path.glob("half-*")) == []


def test_no_worker_is_left_where_time_is_over_or_the_iterator_is_left(tmp_path: Path) -> None:
    with pytest.raises(OutOfTime), time_limit(1.5):
        list(TWO.tables(batch(jobs.waits, str(tmp_path), [0, 1])))
    assert not any(map(runs, workers(tmp_path)))
    (tmp_path / "go").touch()
    running = TWO.tables(batch(jobs.waits, str(tmp_path), range(8)))
    assert int(next(running)["values"][0]) == 0
    running.close()
    assert not any(map(runs, workers(tmp_path)))


@pytest.mark.parametrize(
    ("number", "count"), [(signal.SIGKILL, 3), *thorough((signal.SIGTERM, 3), (signal.SIGHUP, 2))]
)
def test_one_worker_is_ended_and_its_job_done_by_another(
    number: signal.Signals, count: int, tmp_path: Path
) -> None:
    found = "Workers(2).tables(jobs.batch(jobs.waits, sys.argv[1], [0, 1, 2]))"
    process = script(tmp_path, f"print([int(table['values'][0]) for table in {found}])")
    until(lambda: len(workers(tmp_path)) == 2)
    os.kill(workers(tmp_path)[0], number)
    until(lambda: len(workers(tmp_path)) == count)
    (tmp_path / "go").touch()
    assert process.communicate(timeout=60) == (b"[0, 1, 2]\n", b"")
    assert len(set(workers(tmp_path))) == count


def test_workers_that_cannot_start(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    given = batch(jobs.squares, 3, [range(2), range(3)])
    resource_tracker.ensure_running()  # it is started by the same program
    # One that ended at once would close its pipes while the next one is given them.
    ends = program(tmp_path / "ends", "sleep 0.2\nexit 1")
    monkeypatch.setattr(spawn, "_python_exe", os.fsencode(ends))
    with pytest.raises(OutOfMemory, match="lost its worker 2 times") as caught:
        list(TWO.tables(given))
    assert "--jobs 1" in str(caught.value)
    refused = Mock(side_effect=BlockingIOError(errno.EAGAIN, os.strerror(errno.EAGAIN)))
    monkeypatch.setattr(SpawnProcess, "start", refused)
    with pytest.raises(UsageError, match="cannot be started: Resource temporarily") as error:
        list(TWO.tables(given))
    assert "--jobs 1" in str(error.value)


@pytest.mark.thorough
def test_a_script_without_main_guard_is_not_run_again(tmp_path: Path) -> None:
    line = "print(len(list(Workers(2).tables(jobs.batch(jobs.squares, 1, [range(2)] * 2)))))\n"
    (tmp_path / "script.py").write_text(SCRIPT + line)
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    command = [sys.executable, "-P", "script.py"]
    assert subprocess.check_output(command, cwd=tmp_path, env=environment, timeout=60) == b"2\n"


# ---- jobs that are kept

PARTS = [range(low, low + 2) for low in range(0, 10, 2)]


def results(store: Store, given: Batch) -> tuple[list[list[int]], int]:
    """The results, and how many tables were not kept before."""
    before = set(store.path.glob("*.table"))
    found = [table["values"].tolist() for table in Workers(kept=store).tables(given)]
    return found, len(set(store.path.glob("*.table")) - before)


@pytest.mark.filterwarnings("error")
def test_what_is_kept_is_not_done_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    squares = batch(jobs.squares, 3, PARTS)
    store = Store(tmp_path / "folder")
    first, new = results(store, squares)
    assert new == 5
    assert results(store, batch(jobs.squares, 4, PARTS))[1] == 5  # of other words, as it were
    more = results(store, batch(jobs.squares, 3, [*PARTS, range(3)]))  # more of the same
    assert more == ([*first, [0, 3, 12]], 1)
    monkeypatch.setattr(jobs, "squares", None)
    assert results(store, replace(squares)) == (first, 0)
    monkeypatch.setattr(batches, "code_hash", lambda _: "other code")
    assert results(store, squares)[1] == 5


@pytest.mark.parametrize("damage", [b"", b"x" * 500, None, "other", "none", "huge"])
def test_a_damaged_table_is_worked_out_again_and_said(
    damage: bytes | str | None, tmp_path: Path
) -> None:
    """Empty, noise, with another last byte, that of another key, no file, or of 8 TiB."""
    squares, store = batch(jobs.squares, 3, PARTS), Store(tmp_path)
    first, _ = results(store, squares)
    path, other = sorted(tmp_path.iterdir())[2:4]
    whole = path.read_bytes()
    if damage == "none":
        path.unlink()
        path.symlink_to(path)
    elif damage == "huge":
        os.truncate(path, 2**43)
    elif damage == "other":
        path.write_bytes(other.read_bytes())
    else:
        path.write_bytes(damage if isinstance(damage, bytes) else whole[:-1] + b"?")
    with pytest.warns(Note) as notes:
        assert results(store, squares)[0] == first
    (note,) = notes
    why = "cannot be read (Too many levels of symbolic links)" if damage == "none" else "is damaged"
    assert str(note.message) == f"{path} {why}: it is ignored, and its result is worked out again"
    assert path.read_bytes() == whole


@given(st.binary(max_size=300))
def test_no_bytes_are_taken_for_a_table(data: bytes) -> None:
    with TemporaryDirectory() as folder:
        store = Store(Path(folder))
        (store.path / "k.table").write_bytes(data)
        with pytest.warns(Note):
            assert store.read("k") is None


def test_tables_are_read_as_they_were_written(tmp_path: Path) -> None:
    a, empty = np.arange(6).reshape(2, 3), np.zeros((0, 2))
    table = {"a": a, "text": np.array("ß"), "empty": empty, "one": np.array(True)}
    store = Store(tmp_path / "new" / "folder")
    store.write("k", table)
    read = store.read("k")
    assert read is not None
    assert read.keys() == table.keys()
    for name, array in table.items():
        np.testing.assert_array_equal(read[name], array, strict=True)
    store.write("k", {"objects": np.array([{}], object)})  # they would run code when read
    with pytest.raises(ValueError, match="allow_pickle"):
        store.read("k")


def test_digests_tell_values_apart() -> None:
    values: list[object] = [
        *((1,), 1, True, 1.0, "1", b"1", None, (1, 2), (12,), ((1,), 2), (1, (2,)), "", b"", ()),
        *(range(2), np.arange(2), (np.arange(2),), np.arange(2.0), np.arange(2)[None]),
    ]
    assert len({digest(value) for value in values}) == len(values)
    assert digest("a", "b") != digest("ab")
    assert digest(np.arange(4)[::2]) == digest(np.array([0, 2]))
    with pytest.raises(TypeError, match="no digest"):
        digest({1})


def test_no_folder(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    refused = pytest.raises(UsageError, match="cannot be made")
    with refused, given_workers(resume=tmp_path / "file" / "folder"):
        pytest.fail("there is no folder")
    with refused:
        Store(tmp_path / "file").write("k", {})


def test_what_others_remove_meanwhile_stops_no_writing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder, times = tmp_path / "folder", [False, False, True, True]
    remove = Mock(side_effect=lambda _: times.pop() and move(folder, tmp_path / "gone"))
    monkeypatch.setattr("planners.system.writing.os.fsync", remove)
    Store(folder).write("k", {"none": np.zeros(0)})
    assert (folder / "k.table").exists()
    for name in ("exists", "isfile"):  # it was there a moment ago
        monkeypatch.setattr(f"os.path.{name}", lambda _: True)
    assert not is_device(folder / "gone")
    write_atomically(folder / "new", b"", outdated=folder / "gone")
