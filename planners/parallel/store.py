# SPDX-License-Identifier: GPL-3.0-or-later
"""A folder of tables found by their keys: safe for several processes at once.

What is read is never executed: a file holds arrays without Python objects.
"""

from __future__ import annotations

import os
import stat
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from hashlib import sha256
from io import BytesIO
from pathlib import Path

import numpy as np

from planners.parallel.batch import Table
from planners.system.errors import note
from planners.system.writing import write_atomically

#: A table may take one part in so many of what a bounded store may take.
_LARGEST = 4


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
            if not stat.S_ISREG(path.stat().st_mode):  # a pipe would be waited for
                self._ignore(path, "is no file")
                return None
            data = path.read_bytes()
            if self.most_bytes is not None:
                with suppress(OSError):  # a folder that is only read
                    os.utime(path)  # it was used now
        except (FileNotFoundError, NotADirectoryError):
            return None
        except OSError as error:
            self._ignore(path, f"cannot be read ({error.strerror})")
            return None
        begin, content = data[:32], data[32:]
        if begin != _hash(key, content):
            self._ignore(path, "is damaged")
            return None
        with np.load(BytesIO(content), allow_pickle=False) as arrays:
            return dict(arrays)

    def write(self, key: str, table: Table) -> None:
        """Keep a table.  Raises `OSError` or `UsageError` where it cannot be written."""
        content = BytesIO()
        np.savez(content, **table)  # type: ignore[arg-type]
        data = _hash(key, content.getvalue()) + content.getvalue()
        if self.most_bytes is not None and len(data) * _LARGEST > self.most_bytes:
            return
        self.path.mkdir(mode=0o700, parents=True, exist_ok=True)
        write_atomically(self._path(key), data)
        if self.most_bytes is not None:
            self._let_go(self.most_bytes)

    def _ignore(self, path: Path, why: str) -> None:
        """Say that a file is not used, and remove it."""
        self.say(f"{path} {why}: it is ignored, and its result is worked out again")
        with suppress(OSError):  # it is gone already, or the folder is only read
            path.unlink()

    def _path(self, key: str) -> Path:
        return self.path / f"{key}.table"

    def _let_go(self, most: int) -> None:
        """Remove files until the others take no more than ``most`` bytes."""
        entries = []
        for folder in self.path.parent.glob(f"{self.path.name.rpartition('-')[0]}-*"):
            for path in folder.glob("[!.]*"):  # others are being written
                with suppress(FileNotFoundError):  # another process was faster
                    found = path.stat()
                    entries.append((found.st_mtime, found.st_size, path))
        left = sum(size for _, size, _ in entries)
        for _, size, path in sorted(entries):
            if left <= most:
                break
            path.unlink(missing_ok=True)
            left -= size


def _hash(key: str, content: bytes) -> bytes:
    return sha256(key.encode() + b"\n" + content).digest()
