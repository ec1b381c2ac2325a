# SPDX-License-Identifier: GPL-3.0-or-later
"""Jobs of one kind, and their keys.

A job is a pure function of values that can be pickled; its result is a table.  How work is cut
into jobs depends on the work alone, never on who does it, so that results are equal whoever does.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

#: What a job finds: arrays by name, no Python objects in them.
Table = dict[str, NDArray[Any]]
#: A table, or the error that a job has raised.
Outcome = Table | BaseException
#: What does a job: a function of a module (it is sent to other processes by name) that gets what
#: all jobs share, and the job.
Function = Callable[[Any, Any], Table]


@dataclass(frozen=True, slots=True)
class Batch:
    """Jobs of one kind, each of which is done by ``function(shared, job)``.

    Attributes
    ----------
    name
        What is done, for messages.
    function
        A function of a module, without side effects that a second call would disturb: a job whose
        worker is lost is done again.
    shared
        What all jobs need; every worker gets it once.
    jobs
        In the order in which they are begun.
    identity
        A hash of all that ``shared`` says, the same in every process (`digest`).
    efforts
        The estimated work of each job, in nodes times robots.
    """

    name: str
    function: Function
    shared: Any
    jobs: Sequence[Any]
    identity: str
    efforts: Sequence[float]

    def keys(self) -> list[str]:
        """What each job depends on as a hash, the code among it: equal keys, equal results."""
        function = f"{self.function.__module__}.{self.function.__qualname__}"
        packages = {"planners", self.function.__module__.partition(".")[0]}
        code = (*map(code_hash, sorted(packages)), np.version.version)
        return [digest(code, function, self.identity, job) for job in self.jobs]


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
    """The SHA-256 of values, the same in every process.

    Numbers, texts, arrays, ranges, None, and tuples of these.
    """
    found = sha256()
    for part in parts:
        for chunk in _chunks(part):
            found.update(len(chunk).to_bytes(8, "big"))
            found.update(chunk)
    return found.hexdigest()


def _chunks(part: object) -> Iterator[bytes]:
    """A value as bytes that say its type, too."""
    match part:
        case np.ndarray():
            yield f"array {part.dtype.str} {part.shape}".encode()
            yield np.ascontiguousarray(part).tobytes()
        case tuple():
            yield f"tuple {len(part)}".encode()
            for inner in part:
                yield from _chunks(inner)
        case bytes():
            yield b"bytes"
            yield part
        case None | bool() | int() | float() | str() | range():
            yield f"{type(part).__name__} {part!r}".encode()
        case _:
            raise TypeError(f"{type(part).__name__} has no digest")
