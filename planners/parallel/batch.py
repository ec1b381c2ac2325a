# SPDX-License-Identifier: GPL-3.0-or-later
"""Jobs of one kind, their keys, and a store in which results are kept.

A job is a pure function of values that can be pickled; its result is a table.  How work is cut
into jobs depends on the work alone, never on who does it, so that results are equal whoever does.
What is read from a store is never executed: a file holds arrays without Python objects.
"""

from __future__ import annotations

import os
import pickle
import stat
import sys
import threading
import time
import traceback
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cache, cached_property
from hashlib import sha256
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from planners.system.errors import UsageError, note
from planners.system.files import MAX_TEXT
from planners.system.writing import made_folder, write_atomically

#: What a job finds: arrays by name, no Python objects in them.
Table = dict[str, NDArray[Any]]
#: A table, or the error that a job has raised.
Outcome = Table | BaseException
#: What does a job: a function of a module (it is sent to other processes by name) that gets what
#: all jobs share, and the job.
Function = Callable[[Any, Any], Table]

#: A table may take one part in so many of what a bounded store may take.
_LARGEST = 4
#: Seconds after which what is half written is nobody's any more.
_LEFT_BEHIND = 3_600
#: How often a table is written in a folder that others remove meanwhile.
_TRIES = 3
#: Reading is for one thread at a time: numpy parses the head of each array as Python, and CPython
#: up to 3.12 counts how deep it is in a syntax tree for all threads together (gh-106905).
_PARSING = threading.Lock()


@dataclass(frozen=True, slots=True)
class Batch:
    """Jobs of one kind, each of which is done by ``function(shared, job)``.

    A job whose worker is lost is done again: a second call must disturb nothing.  Every worker gets
    ``shared`` once; ``identity`` is a `digest` of all that it says, ``name`` says what is done, in
    messages, and ``efforts`` are the estimated work of each job, in nodes times robots.
    """

    name: str
    function: Function
    shared: Any
    jobs: Sequence[Any]
    identity: str
    efforts: Sequence[float]

    @property
    def packages(self) -> list[str]:
        """Whose code does the jobs."""
        return sorted({"planners", self.function.__module__.partition(".")[0]})

    def keys(self) -> list[str]:
        """What each job depends on as a hash, the code among it: equal keys, equal results."""
        function = f"{self.function.__module__}.{self.function.__qualname__}"
        code = (*map(code_hash, self.packages), np.version.version)
        return [digest(code, function, self.identity, job) for job in self.jobs]


class Packed:
    """The function of a batch and what its jobs share: a worker unpacks it with its first job."""

    def __init__(self, batch: Batch) -> None:
        self._bytes = pickle.dumps((batch.function, batch.shared), pickle.HIGHEST_PROTOCOL)

    @cached_property
    def _unpacked(self) -> tuple[Function, Any]:
        found: tuple[Function, Any] = pickle.loads(self._bytes)
        return found

    def attempt(self, job: Any) -> Outcome:
        """Do a job: its table, or the error that it has raised."""
        function, shared = self._unpacked
        try:
            return function(shared, job)
        except Exception as error:
            error.add_note(f"in a worker:\n{traceback.format_exc()}")
            return error.with_traceback(None)


@cache
def code_hash(package: str) -> str:
    """The SHA-256 of all source files of a package that is loaded, by its name."""
    found = sha256()
    for folder in sorted(sys.modules[package].__path__):
        for path in sorted(Path(folder).rglob("*.py")):
            name = path.relative_to(folder).as_posix()
            found.update(f"{name} {sha256(path.read_bytes()).hexdigest()}\n".encode())
    return found.hexdigest()


def digest(*parts: object) -> str:
    """The SHA-256 of numbers, texts, arrays, ranges, None and tuples: the same in every process."""
    return sha256(repr(_described(parts)).encode()).hexdigest()


def _described(part: object) -> object:
    """A value whose `repr` says all of it, its type included."""
    match part:
        case np.ndarray():
            content = sha256(part.tobytes()).hexdigest()
            return f"array {part.dtype.str} {part.shape} {content}"
        case tuple():
            return tuple(map(_described, part))
        case None | bool() | int() | float() | str() | bytes() | range():
            return part
    raise TypeError(f"{type(part).__name__} has no digest")


@dataclass(frozen=True, slots=True)
class Store:
    """A folder of tables.

    A file is written beside its place and renamed, so that no process sees a part of one.  It
    begins with a hash of its key and of all that follows: a file that is damaged, or has the name
    of another one, is said and not believed.

    The folder is made when it is written to.  Where the tables in it take more than
    ``most_bytes``, those that were not used for longest go; among them is what processes that were
    killed have half written.
    """

    path: Path
    most_bytes: int | None = None

    def read(self, key: str) -> Table | None:
        """The table of a key; None if there is none, or none that is whole."""
        path, data, why = self._path(key), b"", "is damaged"
        try:
            found = path.stat()
            if not stat.S_ISREG(found.st_mode):  # a pipe would be waited for
                why = "is no file"
            elif found.st_size <= self._largest:
                data = path.read_bytes()
                if self.most_bytes is not None:
                    with suppress(OSError):  # a folder that is only read
                        os.utime(path)  # it was used now
        except (FileNotFoundError, NotADirectoryError):
            return None
        except OSError as error:
            why = f"cannot be read ({error.strerror})"
        except MemoryError:
            why = "does not fit into the memory"
        content = data[32:]
        if data[:32] == _hash(key, content):
            with _PARSING, np.load(BytesIO(content), allow_pickle=False) as arrays:
                return dict(arrays)
        note(f"{path} {why}: it is ignored, and its result is worked out again")
        with suppress(OSError):  # it is gone already, or the folder is only read
            path.unlink()
        return None

    def write(self, key: str, table: Table) -> None:
        """Keep a table, if it is not too large; raises `UsageError` where it cannot be written."""
        content = BytesIO()
        np.savez(content, **table)  # type: ignore[arg-type]
        data = _hash(key, content.getvalue()) + content.getvalue()
        if len(data) > self._largest:
            return
        for left in reversed(range(_TRIES)):
            try:
                made_folder(self.path, 0o700)
                write_atomically(self._path(key), data)
                break
            except UsageError:
                if not left:
                    raise
        if self.most_bytes is not None:
            self._let_go(self.most_bytes)

    @property
    def _largest(self) -> int:
        """Bytes of the largest file."""
        return MAX_TEXT if self.most_bytes is None else self.most_bytes // _LARGEST

    def _path(self, key: str) -> Path:
        return self.path / f"{key}.table"

    def _let_go(self, most: int) -> None:
        """Remove files until the others take no more than ``most`` bytes."""
        entries = []
        for path in (*self.path.glob("*.table"), *self.path.glob(".*.????????")):
            with suppress(OSError):  # another process was faster
                found = path.stat()
                if path.suffix == ".table" or found.st_mtime < time.time() - _LEFT_BEHIND:
                    entries.append((found.st_mtime, found.st_size, path))
        left = sum(size for _, size, _ in entries)
        for _, size, path in sorted(entries):
            if left <= most:
                break
            with suppress(OSError):  # it is gone already, or somebody else's
                path.unlink()
            left -= size


def _hash(key: str, content: bytes) -> bytes:
    return sha256(key.encode() + b"\n" + content).digest()
