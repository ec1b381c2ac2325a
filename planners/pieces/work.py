# SPDX-License-Identifier: GPL-3.0-or-later
"""The nouns of work that is cut into pieces, and what a runner of pieces is.

A piece is a pure function of values that can be pickled; its result is a table.  How work is cut
depends on the work alone, never on who does it, so that results are equal whoever does it.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass
from hashlib import sha256
from typing import Any, Literal, Protocol

import numpy as np
from numpy.typing import NDArray

#: What a piece of work finds: arrays by name, no Python objects in them.
Table = dict[str, NDArray[Any]]
#: What does a piece: a function of a module (it is sent to other processes by name) that gets what
#: all pieces share, and the piece.
Function = Callable[[Any, Any], Table]
#: Why an isolated piece has no result: its process died, or it met `Work.limit`.
Loss = Literal["died", "late"]


@dataclass(frozen=True, slots=True)
class Work:
    """Pieces of one kind, each of which is done by ``function(shared, piece)``.

    Attributes
    ----------
    name
        What is done, for messages and keys.
    function
        A function of a module, without side effects that a second call would disturb: a piece
        whose worker is lost is done again.
    shared
        What all pieces need; every worker gets it once.
    pieces
        In the order in which they are begun.
    identity
        A hash of all that ``shared`` says, the same in every process (`digest`).
    efforts
        The estimated work of each piece, in nodes times robots.
    isolated
        Do each piece in a process of its own, however small, and report pieces that are lost
        instead of trying again: for pieces with limits of their own.
    limit
        Seconds after which an isolated piece is killed.
    """

    name: str
    function: Function
    shared: Any
    pieces: Sequence[Any]
    identity: str
    efforts: Sequence[float]
    isolated: bool = False
    limit: float | None = None

    def key(self, number: int, version: str) -> str:
        """The content of a piece as a hash: equal keys, equal results."""
        function = f"{self.function.__module__}.{self.function.__qualname__}"
        return digest(version, function, self.identity, self.pieces[number])


@dataclass(frozen=True, slots=True)
class Done:
    """A piece that has ended.

    Attributes
    ----------
    number
        Which one of `Work.pieces`.
    table
        Its result; None if it has raised an error, or is lost, which only isolated pieces may be.
    error
        What a piece has raised.
    lost
        Why there is neither.
    seconds, cpu
        Wall time and processor time, where they were measured.
    """

    number: int
    table: Table | None
    error: BaseException | None = None
    lost: Loss | None = None
    seconds: float = 0.0
    cpu: float = 0.0


#: Called with the numbers of the pieces that are under way, each time these change.
Report = Callable[[Sequence[int]], None]


class Runner(Protocol):
    """Does the pieces of a work."""

    def run(self, work: Work, report: Report = ...) -> Generator[Done]:
        """Yield the pieces as they end; what is under way is ended when this is closed.

        Raises
        ------
        OutOfMemory
            For a piece that is not isolated and whose processes die.
        """
        ...


def silent(_: Sequence[int]) -> None:
    """Report nothing."""


def tables(done: Generator[Done]) -> Generator[Table]:
    """The tables of pieces in the order of their numbers, each as soon as its turn has come.

    So is the error of a piece raised: whoever does the pieces, it is the same one.
    """
    waiting: dict[int, Done] = {}
    following = 0
    with closing(done):
        for piece in done:
            waiting[piece.number] = piece
            while (first := waiting.pop(following, None)) is not None:
                if first.error is not None:
                    raise first.error
                assert first.table is not None, "only isolated pieces are lost"
                yield first.table
                following += 1


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
