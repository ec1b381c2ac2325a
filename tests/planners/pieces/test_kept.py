# SPDX-License-Identifier: GPL-3.0-or-later
"""Kept pieces: read again, never for another piece, and never when they are damaged."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from planners.errors import UsageError
from planners.pieces.kept import Kept, as_bytes, from_bytes
from planners.pieces.processes import Processes
from planners.pieces.work import Runner, Work, digest, tables
from tests.support import pieces
from tests.support.pieces import work


class Counting:
    """A runner that counts what it does."""

    def __init__(self) -> None:
        self.did = 0

    def run(self, given: Work, report: object = None) -> Iterator[object]:
        self.did += len(given.pieces)
        yield from Processes(jobs=1).run(given)


def results(runner: Runner, given: Work) -> list[list[int]]:
    return [table["values"].tolist() for table in tables(runner.run(given))]


PARTS = [range(low, low + 2) for low in range(0, 10, 2)]


def test_what_is_kept_is_not_done_again(tmp_path: Path) -> None:
    squares, counting = work(pieces.squares, 3, PARTS), Counting()
    kept = Kept(counting, tmp_path / "folder", pytest.fail)  # type: ignore[arg-type]
    first = results(kept, squares)
    assert (counting.did, len(list((tmp_path / "folder").iterdir()))) == (5, 5)
    assert results(kept, squares) == first
    assert counting.did == 5
    results(kept, work(pieces.squares, 4, PARTS))  # of other words, as it were
    assert counting.did == 10
    results(kept, work(pieces.squares, 3, [*PARTS, range(3)]))  # more of the same
    assert counting.did == 11


@pytest.mark.parametrize("damage", [b"", b"coordlang piece 1\n", b"x" * 500, None])
def test_a_damaged_piece_is_done_again_and_said(damage: bytes | None, tmp_path: Path) -> None:
    squares, counting = work(pieces.squares, 3, PARTS), Counting()
    notes: list[str] = []
    kept = Kept(counting, tmp_path, notes.append)  # type: ignore[arg-type]
    first = results(kept, squares)
    path = sorted(tmp_path.iterdir())[2]
    whole = path.read_bytes()
    path.write_bytes(whole[:-1] + b"?" if damage is None else damage)
    assert results(kept, squares) == first
    assert counting.did == 6
    assert notes == [f"{path} is damaged: its piece is done again"]
    assert from_bytes(path.read_bytes()) is not None
    assert path.read_bytes() == whole


def test_no_folder(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(UsageError, match="cannot be made"):
        Kept(Processes(1), tmp_path / "file" / "folder", print)


@given(st.binary(max_size=300))
def test_no_bytes_are_taken_for_a_table(data: bytes) -> None:
    assert from_bytes(data) is None
    assert from_bytes(b"coordlang piece 1\n" + data) is None


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
