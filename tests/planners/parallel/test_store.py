# SPDX-License-Identifier: GPL-3.0-or-later
"""Kept jobs: read again, never for another job, and never when they are damaged."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from planners.errors import UsageError
from planners.parallel.batch import Batch, digest
from planners.parallel.store import KeptJobs, as_bytes, from_bytes
from planners.parallel.workers import Workers
from tests.support import jobs
from tests.support.jobs import batch


def kept(folder: Path, note: Callable[[str], object] = pytest.fail) -> Workers:
    return Workers(kept=KeptJobs.in_folder(folder, note))  # type: ignore[arg-type]


def results(workers: Workers, given: Batch) -> list[list[int]]:
    return [table["values"].tolist() for table in workers.tables(given)]


PARTS = [range(low, low + 2) for low in range(0, 10, 2)]


def test_what_is_kept_is_not_done_again(tmp_path: Path) -> None:
    workers = kept(tmp_path / "folder")
    first = results(workers, batch(jobs.squares, 3, PARTS))
    assert len(list((tmp_path / "folder").iterdir())) == 5
    kept_files = {path: path.stat().st_mtime_ns for path in (tmp_path / "folder").iterdir()}
    assert results(workers, batch(jobs.squares, 3, PARTS)) == first
    assert kept_files == {p: p.stat().st_mtime_ns for p in (tmp_path / "folder").iterdir()}
    results(workers, batch(jobs.squares, 4, PARTS))  # of other words, as it were
    assert len(list((tmp_path / "folder").iterdir())) == 10
    results(workers, batch(jobs.squares, 3, [*PARTS, range(3)]))  # more of the same
    assert len(list((tmp_path / "folder").iterdir())) == 11


@pytest.mark.parametrize("damage", [b"", b"coordlang table 1\n", b"x" * 500, None])
def test_a_damaged_file_is_said_and_its_job_done_again(
    damage: bytes | None, tmp_path: Path
) -> None:
    squares = batch(jobs.squares, 3, PARTS)
    notes: list[str] = []
    workers = kept(tmp_path, notes.append)
    first = results(workers, squares)
    path = sorted(tmp_path.iterdir())[2]
    whole = path.read_bytes()
    path.write_bytes(whole[:-1] + b"?" if damage is None else damage)
    assert results(workers, squares) == first
    assert notes == [f"{path} is damaged: its job is done again"]
    assert path.read_bytes() == whole


@pytest.mark.parametrize("make", [os.mkfifo, Path.mkdir])
def test_what_is_no_file_is_said_and_left(make: Callable[[Path], None], tmp_path: Path) -> None:
    """Nobody waits for whoever may write into a pipe, or read from it."""
    notes: list[str] = []
    workers, squares = kept(tmp_path, notes.append), batch(jobs.squares, 3, PARTS)
    first = results(workers, squares)
    path = sorted(tmp_path.iterdir())[2]
    path.unlink()
    make(path)
    assert results(workers, squares) == first
    assert len(notes) == 1
    assert notes[0].endswith("its job is done again")


def test_no_folder(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(UsageError, match="cannot be made"):
        kept(tmp_path / "file" / "folder")


@given(st.binary(max_size=300))
def test_no_bytes_are_taken_for_a_table(data: bytes) -> None:
    assert from_bytes(data) is None
    assert from_bytes(b"coordlang table 1\n" + data) is None


def test_tables_are_read_as_they_were_written() -> None:
    table = {"a": np.arange(6).reshape(2, 3), "text": np.array("ß"), "empty": np.zeros((0, 2))}
    read = from_bytes(as_bytes(table))
    assert read is not None
    assert read.keys() == table.keys()
    for name, array in table.items():
        assert (read[name].dtype, read[name].shape) == (array.dtype, array.shape)
        assert (read[name] == array).all()
    with pytest.raises(ValueError, match="pickle"):
        as_bytes({"objects": np.array([{}], object)})


def test_digests_tell_values_apart() -> None:
    values: list[object] = [
        (1,),
        1,
        True,
        1.0,
        "1",
        b"1",
        None,
        (1, 2),
        (12,),
        range(2),
        np.arange(2),
        (np.arange(2),),
        np.arange(2.0),
        np.arange(2)[None],
        ((1,), 2),
        (1, (2,)),
        "",
        b"",
        (),
    ]
    assert len({digest(value) for value in values}) == len(values)
    assert digest("a", "b") != digest("ab")
    assert digest(np.arange(4)[::2]) == digest(np.array([0, 2]))
    with pytest.raises(TypeError, match="no digest"):
        digest({1})
