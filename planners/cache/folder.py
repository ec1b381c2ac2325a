# SPDX-License-Identifier: GPL-3.0-or-later
"""A folder of entries found by their keys: bounded in size, safe for several processes at once."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from planners.errors import CoordlangError, note
from planners.parallel.batch import Table
from planners.parallel.store import Damaged, as_bytes, read_table, write_table

#: The version of the entries' form: entries of another one are never looked at, and go in time.
FORM = 2
#: Bytes that all entries together may take.
MOST_BYTES = 2**30
#: An entry may take one part in so many of them.
_LARGEST = 4
#: Seconds after which a temporary file is one that a killed process left.
_WRITING = 3600.0


def default_folder(environment: Mapping[str, str] = os.environ) -> Path | None:
    """Where a user's entries are; None where the user wants none, or has no home.

    ``$COORDLANG_CACHE`` if it is set (``off``: none), else ``coordlang`` in ``$XDG_CACHE_HOME``, or
    in ``~/.cache``.
    """
    chosen = environment.get("COORDLANG_CACHE", "")
    if chosen:
        return None if chosen.lower() == "off" else Path(chosen)
    base = environment.get("XDG_CACHE_HOME", "")
    with suppress(RuntimeError):
        # By its specification a relative path is ignored.
        caches = Path(base) if os.path.isabs(base) else Path.home() / ".cache"
        if caches.parent.is_dir():
            return caches / "coordlang"
    return None


@dataclass(frozen=True, slots=True)
class Folder:
    """A folder of entries.

    An entry is written beside its place and renamed, so that no process sees a part of one; it
    begins with a hash of all that follows.  An entry that is damaged, or a folder that cannot be
    read or written, is said in a note, and never an error.

    Attributes
    ----------
    path
        The folder; it is made when it is written to.
    most_bytes
        What all entries together may take: where it is more, those that were not used for longest
        go.
    """

    path: Path
    most_bytes: int = MOST_BYTES

    def read(self, key: str) -> Table | None:
        """The table of an entry; None if there is none, or none that is whole."""
        path = self._path(key)
        try:
            table = read_table(path)
        except Damaged as damage:
            self.ignored(key, str(damage))
            return None
        if table is not None:
            with suppress(OSError):  # a folder that is only read
                os.utime(path)  # it was used now
        return table

    def write(self, key: str, table: Table) -> None:
        """Keep a table, and let the oldest entries go where there are too many."""
        data = as_bytes(table)
        if len(data) * _LARGEST > self.most_bytes:
            return
        path = self._path(key)
        try:
            path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
            write_table(path, data)
            self._let_go()
        except (OSError, CoordlangError) as error:
            said = error.strerror if isinstance(error, OSError) else str(error).partition("\n")[0]
            note(
                f"the plans that were found are not kept: {said} ({self.path})",
                remedy="Say --no-cache, or set COORDLANG_CACHE to a folder that you may write to.",
            )

    def ignored(self, key: str, why: str) -> None:
        """Say that an entry is not used, and remove it."""
        note(f"{why}: it is ignored, and the task is searched again")
        with suppress(OSError):  # it is gone already, or the folder is only read
            os.unlink(self._path(key))

    def _path(self, key: str) -> Path:
        return self.path / f"plans-{FORM}" / key

    def _let_go(self) -> None:
        entries = sorted(self._entries())
        left = sum(size for _, size, _ in entries)
        for _, size, path in entries:
            if left <= self.most_bytes:
                break
            with suppress(FileNotFoundError):  # another process was faster
                os.unlink(path)
            left -= size

    def _entries(self) -> Iterator[tuple[float, int, str]]:
        """When each file was used last, its size and path; what killed processes left, too."""
        for folder in sorted(self.path.glob("plans-*")):
            for entry in os.scandir(folder):
                try:
                    found = entry.stat(follow_symlinks=False)
                except FileNotFoundError:
                    continue
                left = not entry.name.startswith(".") or found.st_mtime < time.time() - _WRITING
                if entry.is_file(follow_symlinks=False) and left:
                    yield found.st_mtime, found.st_size, entry.path
