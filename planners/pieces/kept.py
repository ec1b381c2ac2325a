# SPDX-License-Identifier: GPL-3.0-or-later
"""Finished pieces kept in a folder, so that work that was killed goes on where it was.

A file is named by the key of its piece (`Work.key`): of the function, the model, the options, the
piece and the code.  A file that is damaged is not read.
"""

from __future__ import annotations

import io
import zipfile
from collections.abc import Callable, Generator, Sequence
from contextlib import closing
from dataclasses import replace
from hashlib import sha256
from pathlib import Path

import numpy as np

from planners.errors import UsageError
from planners.pieces.versions import code_hash
from planners.pieces.work import Done, Report, Runner, Table, Work, silent
from planners.writing import write_atomically

_HEAD = b"coordlang piece 1\n"


class Kept:
    """A runner whose finished pieces are kept.

    Parameters
    ----------
    runner
        What does the pieces that are not known yet.
    folder
        Where they are kept; it is made.
    note
        Called with a line of text for each damaged file.

    Raises
    ------
    UsageError
        If the folder cannot be made.
    """

    def __init__(self, runner: Runner, folder: Path, note: Callable[[str], None]) -> None:
        self._runner, self._folder, self._note = runner, folder, note
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise UsageError(
                f"{folder} cannot be made: {error.strerror}",
                remedy="Say --resume DIR, with a folder that you may write to.",
            ) from None

    def run(self, work: Work, report: Report = silent) -> Generator[Done]:
        """See `Runner.run`; pieces that are known come first."""
        package = work.function.__module__.partition(".")[0]
        version = " ".join(
            (code_hash(package), code_hash("planners"), f"numpy {np.version.version}")
        )
        paths = [
            self._folder / f"{work.key(number, version)}.piece"
            for number in range(len(work.pieces))
        ]
        left = []
        for number, path in enumerate(paths):
            table = self._read(path)
            if table is None:
                left.append(number)
            else:
                yield Done(number, table)

        def running(numbers: Sequence[int]) -> None:
            report([left[number] for number in numbers])

        rest = replace(
            work,
            pieces=[work.pieces[number] for number in left],
            efforts=[work.efforts[number] for number in left],
        )
        with closing(self._runner.run(rest, running)) as following:
            for done in following:
                number = left[done.number]
                if done.table is not None:
                    write_atomically(paths[number], as_bytes(done.table))
                yield replace(done, number=number)

    def _read(self, path: Path) -> Table | None:
        """The table of a file, None where there is none."""
        try:
            data = path.read_bytes()
        except FileNotFoundError:
            return None
        except OSError as error:
            self._note(f"{path} cannot be read ({error.strerror}): its piece is done again")
            return None
        table = from_bytes(data)
        if table is None:
            self._note(f"{path} is damaged: its piece is done again")
        return table


def as_bytes(table: Table) -> bytes:
    """A table as the bytes of a file: a head, a hash, and numpy's own format without pickles."""
    buffer = io.BytesIO()
    np.savez(buffer, allow_pickle=False, **table)
    data = buffer.getvalue()
    return _HEAD + sha256(data).hexdigest().encode() + b"\n" + data


def from_bytes(data: bytes) -> Table | None:
    """The table that `as_bytes` has written, None for anything else."""
    head = len(_HEAD) + 65
    if not data.startswith(_HEAD) or data[len(_HEAD) : head] != _line(data[head:]):
        return None
    try:
        with np.load(io.BytesIO(data[head:]), allow_pickle=False) as arrays:
            return {name: arrays[name] for name in arrays.files}
    except (ValueError, OSError, zipfile.BadZipFile):
        return None


def _line(data: bytes) -> bytes:
    return sha256(data).hexdigest().encode() + b"\n"
