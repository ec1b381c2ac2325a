# SPDX-License-Identifier: GPL-3.0-or-later
"""A folder of tables found by their keys: safe for several processes at once.

What is read is never executed: a file holds names, types and shapes of arrays, and their bytes.
"""

from __future__ import annotations

import math
import os
import stat
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from typing import Annotated

import msgspec
import numpy as np

from planners.parallel.batch import Table
from planners.system.errors import note
from planners.system.writing import write_atomically

_HEAD = b"coordlang table 1\n"
_ENDING = ".table"
_Size = Annotated[int, msgspec.Meta(ge=0)]
#: A table may take one part in so many of what a bounded store may take.
_LARGEST = 4
#: Seconds after which a temporary file is one that a killed process left.
_WRITING = 3600.0


@dataclass(frozen=True, slots=True)
class Store:
    """A folder of tables.

    A file is written beside its place and renamed, so that no process sees a part of one.  It
    begins with a hash of its key and of all that follows: a file that is damaged, or has the name
    of another one, is said and not believed.

    Attributes
    ----------
    path
        The folder; it is made when it is written to.
    most_bytes
        What it and the folders beside it with the same name up to the last ``-`` may take: where it
        is more, files that were not used for longest go.  None: no bound.
    say
        Called with a line of text for each file that is not believed.
    """

    path: Path
    most_bytes: int | None = None
    say: Callable[[str], None] = note

    def read(self, key: str) -> Table | None:
        """The table of a key; None if there is none, or none that is whole."""
        path = self._path(key)
        try:
            data = _content(path, self.most_bytes)
        except (FileNotFoundError, NotADirectoryError):
            return None
        except OSError as error:
            self.ignore(key, f"{path} cannot be read ({error.strerror})")
            return None
        table = None if data is None else from_bytes(key, data)
        if table is None:
            self.ignore(key, f"{path} is {'no file' if data is None else 'damaged'}")
        elif self.most_bytes is not None:
            with suppress(OSError):  # a folder that is only read
                os.utime(path)  # it was used now
        return table

    def write(self, key: str, table: Table) -> None:
        """Keep a table.  Raises `OSError` or `UsageError` where it cannot be written."""
        data = as_bytes(key, table)
        if self.most_bytes is not None and len(data) * _LARGEST > self.most_bytes:
            return
        self.path.mkdir(mode=0o700, parents=True, exist_ok=True)
        path = self._path(key)
        if os.path.lexists(path) and not path.is_file():
            return  # a pipe or a folder in its place: `read` has said it
        write_atomically(path, data)
        if self.most_bytes is not None:
            self._let_go(self.most_bytes)

    def ignore(self, key: str, why: str) -> None:
        """Say that a file is not used, and remove it."""
        self.say(f"{why}: it is ignored, and its result is worked out again")
        with suppress(OSError):  # it is gone already, or a folder, or the folder is only read
            os.unlink(self._path(key))

    def _path(self, key: str) -> Path:
        return self.path / f"{key}{_ENDING}"

    def _let_go(self, most: int) -> None:
        """Remove files until the others take no more than ``most`` bytes."""
        entries = sorted(self._entries())
        left = sum(size for _, size, _ in entries)
        for _, size, path in entries:
            if left <= most:
                break
            with suppress(FileNotFoundError):  # another process was faster
                os.unlink(path)
            left -= size

    def _entries(self) -> Iterator[tuple[float, int, str]]:
        """When each file was used last, its size and path; what killed processes left, too."""
        family = f"{self.path.name.rpartition('-')[0]}-*"
        for folder in sorted(self.path.parent.glob(family)):
            for entry in os.scandir(folder):
                try:
                    found = entry.stat(follow_symlinks=False)
                except FileNotFoundError:
                    continue
                left = not entry.name.startswith(".") or found.st_mtime < time.time() - _WRITING
                if entry.is_file(follow_symlinks=False) and left:
                    yield found.st_mtime, found.st_size, entry.path


def as_bytes(key: str, table: Table) -> bytes:
    """A table as the content of a file.

    Raises
    ------
    ValueError
        For an array of Python objects.
    """
    if any(array.dtype.hasobject for array in table.values()):
        raise ValueError("an array of Python objects is not kept")
    arrays = [(name, array.dtype.str, array.shape) for name, array in table.items()]
    data = b"\n".join((msgspec.json.encode(arrays), b"".join(a.tobytes() for a in table.values())))
    return _HEAD + _hash(key, data) + data


def from_bytes(key: str, content: bytes) -> Table | None:
    """The table that `as_bytes` has written for this key, None for anything else."""
    begin = len(_HEAD) + 65
    data = content[begin:]
    if content[:begin] != _HEAD + _hash(key, data):
        return None
    offset = data.find(b"\n") + 1
    table: Table = {}
    try:
        arrays = msgspec.json.decode(data[:offset], type=list[tuple[str, str, tuple[_Size, ...]]])
        for name, kind, shape in arrays:
            array = np.empty(0, kind)
            count = math.prod(shape)
            if count:
                array = np.frombuffer(data, kind, count, offset)
            table[name] = array.reshape(shape).copy()
            offset += array.nbytes
    except (ValueError, TypeError, OverflowError):
        return None
    return table if offset == len(data) else None


def _hash(key: str, data: bytes) -> bytes:
    return sha256(key.encode() + b"\n" + data).hexdigest().encode() + b"\n"


def _content(path: Path, most: int | None) -> bytes | None:
    """The content of a file; None if it is none or too large: a pipe could be waited for."""
    with open(os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC), "rb") as file:
        found = os.fstat(file.fileno())
        if not stat.S_ISREG(found.st_mode) or (most is not None and found.st_size > most):
            return None
        return file.read()
