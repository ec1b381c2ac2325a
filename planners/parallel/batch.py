# SPDX-License-Identifier: GPL-3.0-or-later
"""Jobs of one kind, and their keys.

A job is a pure function of values that can be pickled; its result is a table.  How work is cut
into jobs depends on the work alone, never on who does it, so that results are equal whoever does.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from hashlib import sha256
from typing import Any

import numpy as np
from numpy.typing import NDArray

#: What a job finds: arrays by name, no Python objects in them.
Table = dict[str, NDArray[Any]]
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

    def key(self, number: int, version: str) -> str:
        """The content of a job as a hash: equal keys, equal results."""
        function = f"{self.function.__module__}.{self.function.__qualname__}"
        return digest(version, function, self.identity, self.jobs[number])


@dataclass(frozen=True, slots=True)
class Done:
    """A job that has ended: its number, and its table or the error that it has raised."""

    number: int
    table: Table | None
    error: BaseException | None = None


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
