# SPDX-License-Identifier: GPL-3.0-or-later
"""Worker processes: equal results, errors as they are here, losses, limits, and clean ends."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from planners.errors import BadInput, OutOfMemory
from planners.limits import address_space, limited_memory
from planners.pieces.processes import Processes
from planners.pieces.work import tables
from tests.support import pieces
from tests.support.pieces import work
from tests.support.processes import runs, until, workers

TWO = Processes(jobs=2)


def test_jobs_do_not_matter_and_small_work_stays_here() -> None:
    parts = [range(low, low + 3) for low in range(0, 15, 3)]
    squares = work(pieces.squares, 3, parts)
    results = {
        jobs: [table["values"].tolist() for table in tables(Processes(jobs).run(squares))]
        for jobs in (1, 2)
    }
    assert results[1] == results[2] == [[3 * n * n for n in part] for part in parts]
    elsewhere = {int(table["process"][0]) for table in tables(TWO.run(squares))}
    assert os.getpid() not in elsewhere
    small = work(pieces.squares, 3, parts, efforts=[1.0] * len(parts))
    here = {int(table["process"][0]) for table in tables(TWO.run(small))}
    assert here == {os.getpid()}


@pytest.mark.parametrize("jobs", [1, 2])
def test_errors_are_those_of_the_first_piece_that_has_one(jobs: int) -> None:
    with pytest.raises(BadInput) as caught:
        list(tables(Processes(jobs).run(work(pieces.fails, None, [1, 0, 1]))))
    assert str(caught.value) == "here:3:4: no good\n  Try 2."
    with pytest.raises(ZeroDivisionError, match="a bug"):
        list(tables(Processes(jobs).run(work(pieces.fails, None, [0, 1]))))


def test_a_piece_whose_process_dies_is_done_again_once(tmp_path: Path) -> None:
    again = work(pieces.dies_once, str(tmp_path), [0, 1, 2])
    assert [int(table["values"][0]) for table in tables(TWO.run(again))] == [0, 1, 2]
    (tmp_path / "always").touch()
    with pytest.raises(OutOfMemory, match="lost its process twice"):
        list(tables(TWO.run(again)))
    isolated = work(pieces.dies_once, str(tmp_path), [0, 1], isolated=True)
    assert {done.number: done.lost for done in TWO.run(isolated)} == {0: "died", 1: None}


@pytest.mark.thorough
def test_memory_is_divided_among_processes() -> None:
    with limited_memory(address_space() + (1 << 30)):
        fits = work(pieces.takes_memory, None, [100, 100])
        assert len(list(tables(TWO.run(fits)))) == 2
        with pytest.raises(MemoryError):
            list(tables(TWO.run(work(pieces.takes_memory, None, [100, 700]))))
        assert len(list(tables(Processes(jobs=1).run(work(pieces.takes_memory, None, [700]))))) == 1


def test_a_worker_that_is_asked_to_end_removes_what_it_writes(tmp_path: Path) -> None:
    script = (
        "import signal, sys\n"
        "signal.signal(signal.SIGINT, signal.default_int_handler)  # ignored in the background\n"
        "from tests.support import pieces; from planners.pieces.processes import *\n"
        "list(Processes(2).run(pieces.work(pieces.removes, sys.argv[1], [0, 1])))"
    )
    process = subprocess.Popen([sys.executable, "-c", script, tmp_path], stderr=subprocess.PIPE)
    until(lambda: len(workers(tmp_path)) == 2)
    process.send_signal(signal.SIGINT)
    process.communicate(timeout=60)
    until(lambda: not any(map(runs, workers(tmp_path))))
    assert list(tmp_path.glob("half-*")) == []


def test_workers_end_with_their_parent(tmp_path: Path) -> None:
    script = (
        "import sys; from tests.support import pieces; from planners.pieces.processes import *\n"
        "list(Processes(2).run(pieces.work(pieces.waits, sys.argv[1], [0, 1])))"
    )
    process = subprocess.Popen([sys.executable, "-c", script, tmp_path])
    until(lambda: len(workers(tmp_path)) == 2)
    process.kill()
    process.wait()
    until(lambda: not any(map(runs, workers(tmp_path))))


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
def test_one_worker_is_ended_and_its_piece_done_by_another(
    number: signal.Signals, tmp_path: Path
) -> None:
    script = (
        "import sys; from tests.support import pieces; from planners.pieces.processes import *\n"
        "from planners.pieces.work import tables\n"
        "found = tables(Processes(2).run(pieces.work(pieces.waits, sys.argv[1], [0, 1, 2])))\n"
        "print([int(table['values'][0]) for table in found])"
    )
    process = subprocess.Popen([sys.executable, "-c", script, tmp_path], stdout=subprocess.PIPE)
    until(lambda: len(workers(tmp_path)) == 2)
    os.kill(workers(tmp_path)[0], number)
    until(lambda: len(workers(tmp_path)) == 3)
    (tmp_path / "go").touch()
    out, _ = process.communicate(timeout=60)
    assert out == b"[0, 1, 2]\n"


def test_the_iterator_may_be_left_early(tmp_path: Path) -> None:
    (tmp_path / "go").touch()
    running = tables(TWO.run(work(pieces.waits, str(tmp_path), range(8))))
    assert int(next(running)["values"][0]) == 0
    running.close()
    assert not any(map(runs, workers(tmp_path)))


def test_a_script_without_main_guard_is_not_run_again(tmp_path: Path) -> None:
    script = tmp_path / "script.py"
    script.write_text(
        "from planners.pieces.processes import Processes\n"
        "from tests.support import pieces\n"
        "print(len(list(Processes(2).run(pieces.work(pieces.squares, 1, [range(2), range(3)])))))\n"
    )
    done = subprocess.run([sys.executable, script], capture_output=True, check=True, timeout=60)
    assert done.stdout == b"2\n"
