# SPDX-License-Identifier: GPL-3.0-or-later
"""Kept results: read again, never for another job, never when damaged, and never executed."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from planners.parallel import batch as batches
from planners.parallel.batch import Batch, Store, digest
from planners.parallel.workers import Workers, workers
from planners.system.errors import UsageError
from tests.support import jobs as support
from tests.support.jobs import batch

PARTS = [range(low, low + 2) for low in range(0, 10, 2)]


def results(store: Store, given: Batch) -> tuple[list[list[int]], int]:
    """The results, and how many tables were not kept before."""
    before = set(store.path.glob("*.table"))
    found = [table["values"].tolist() for table in Workers(kept=store).tables(given)]
    return found, len(set(store.path.glob("*.table")) - before)


def test_what_is_kept_is_not_done_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    squares = batch(support.squares, 3, PARTS)
    store = Store(tmp_path / "folder", say=pytest.fail)
    first, new = results(store, squares)
    assert new == 5
    assert results(store, batch(support.squares, 4, PARTS))[1] == 5  # of other words, as it were
    more = results(store, batch(support.squares, 3, [*PARTS, range(3)]))  # more of the same
    assert more == ([*first, [0, 3, 12]], 1)
    monkeypatch.setattr(support, "squares", None)
    assert results(store, replace(squares)) == (first, 0)

    def other(_: str) -> str:
        return "other code"

    monkeypatch.setattr(batches, "code_hash", other)
    assert results(store, squares)[1] == 5


@pytest.mark.parametrize("damage", [b"", b"x" * 500, None, "other", "none"])
def test_a_damaged_table_is_worked_out_again_and_said(
    damage: bytes | str | None, tmp_path: Path
) -> None:
    """One that is empty, noise, has another last byte, is that of another key, or is no file."""
    squares, notes = batch(support.squares, 3, PARTS), list[str]()
    store = Store(tmp_path, say=notes.append)
    first, _ = results(store, squares)
    path, other = sorted(tmp_path.iterdir())[2:4]
    whole = path.read_bytes()
    if damage == "none":
        path.unlink()
        path.symlink_to(path)
    elif damage == "other":
        path.write_bytes(other.read_bytes())
    else:
        path.write_bytes(damage if isinstance(damage, bytes) else whole[:-1] + b"?")
    assert results(store, squares)[0] == first
    (note,) = notes
    why = "cannot be read (Too many levels of symbolic links)" if damage == "none" else "is damaged"
    assert note == f"{path} {why}: it is ignored, and its result is worked out again"
    assert path.read_bytes() == whole


@given(st.binary(max_size=300))
def test_no_bytes_are_taken_for_a_table(data: bytes) -> None:
    with TemporaryDirectory() as folder:
        notes = list[str]()
        store = Store(Path(folder), say=notes.append)
        (store.path / "k.table").write_bytes(data)
        assert store.read("k") is None
        assert len(notes) == 1


def test_tables_are_read_as_they_were_written(tmp_path: Path) -> None:
    table = {
        "a": np.arange(6).reshape(2, 3),
        "text": np.array("ß"),
        "empty": np.zeros((0, 2)),
        "one": np.array(True),
    }
    store = Store(tmp_path / "new" / "folder")
    store.write("k", table)
    read = store.read("k")
    assert read is not None
    assert read.keys() == table.keys()
    for name, array in table.items():
        assert (read[name].dtype, read[name].shape) == (array.dtype, array.shape)
        assert (read[name] == array).all()


def test_objects_are_not_read(tmp_path: Path) -> None:
    """An array of Python objects would run code when it is read."""
    store = Store(tmp_path)
    store.write("k", {"objects": np.array([{}], object)})
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
    with (
        pytest.raises(UsageError, match="cannot be made"),
        workers(resume=tmp_path / "file" / "folder"),
    ):
        pytest.fail("there is no folder")
