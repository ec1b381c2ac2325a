# SPDX-License-Identifier: GPL-3.0-or-later
"""Tables kept in files, found by their keys: finished jobs, and plans of earlier commands.

A file is named by a hash of all that its table depends on, the code included, and begins with a
hash of all that follows.  It is written beside its place and renamed, so that no process sees a
part of one.  What is damaged is not read, and nothing that is read can execute code.
"""

from __future__ import annotations

import io
import os
import stat
import zipfile
from collections.abc import Callable
from dataclasses import dataclass
from hashlib import sha256
from os import PathLike
from pathlib import Path

import numpy as np

from planners.errors import UsageError
from planners.parallel.batch import Batch, Table
from planners.parallel.versions import code_hash
from planners.writing import write_atomically

_HEAD = b"coordlang table 1\n"
#: Bytes that are read of one file.
_MOST_BYTES = 2**30


class Damaged(ValueError):
    """A file that is there and cannot be read, and why."""


def read_table(path: Path) -> Table | None:
    """The table of a file; None if there is none.

    Raises
    ------
    Damaged
        For a file that is not as it was written, or is none (a pipe, a device, a folder).
    """
    try:
        # A pipe without writer would be waited for.
        number = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
        with open(number, "rb") as file:
            found = os.fstat(number)
            if not stat.S_ISREG(found.st_mode) or found.st_size > _MOST_BYTES:
                raise Damaged(f"{path} is damaged")
            data = file.read()
    except (FileNotFoundError, NotADirectoryError):
        return None
    except OSError as error:
        raise Damaged(f"{path} cannot be read ({error.strerror})") from None
    table = from_bytes(data)
    if table is None:
        raise Damaged(f"{path} is damaged")
    return table


def write_table(path: Path, data: bytes) -> None:
    """Write what `as_bytes` has made; not where something is in the way that is no file."""
    if path.is_file() or not os.path.lexists(path):
        write_atomically(path, data)


def as_bytes(table: Table) -> bytes:
    """A table as the bytes of a file: a head, a hash, and numpy's own format without pickles."""
    buffer = io.BytesIO()
    np.savez(buffer, allow_pickle=False, **table)
    data = buffer.getvalue()
    return _HEAD + _line(data) + data


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


@dataclass(frozen=True, slots=True)
class KeptJobs:
    """Finished jobs in a folder, so that work that was killed goes on where it was."""

    folder: Path
    note: Callable[[str], None]

    @classmethod
    def in_folder(cls, folder: str | PathLike[str], note: Callable[[str], None]) -> KeptJobs:
        """Make the folder; raises `UsageError` if that cannot be."""
        try:
            Path(folder).mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise UsageError(
                f"{folder} cannot be made: {error.strerror}",
                remedy="Say --resume DIR, with a folder that you may write to.",
            ) from None
        return cls(Path(folder), note)

    def keys(self, batch: Batch) -> list[str]:
        """The key of each job: of the function, what it works on, and the code."""
        package = batch.function.__module__.partition(".")[0]
        code = code_hash(package), code_hash("planners"), f"numpy {np.version.version}"
        return [batch.key(number, " ".join(code)) for number in range(len(batch.jobs))]

    def read(self, key: str) -> Table | None:
        """What a job has found; None if that is not known."""
        try:
            return read_table(self._path(key))
        except Damaged as damage:
            self.note(f"{damage}: its job is done again")
            return None

    def write(self, key: str, table: Table) -> None:
        """Keep what a job has found."""
        write_table(self._path(key), as_bytes(table))

    def _path(self, key: str) -> Path:
        return self.folder / f"{key}.job"
