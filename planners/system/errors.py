# SPDX-License-Identifier: GPL-3.0-or-later
"""The one error tree.  Every error carries the exit code that the command line ends with.

The codes follow Fast Downward's grouping: 1x proved impossible, 2x out of resources, 3x bad input
or a failure.
"""

from __future__ import annotations

import copyreg
import warnings
from dataclasses import dataclass
from typing import Any

from planners.system.messages import sentence


@dataclass(frozen=True, slots=True)
class Position:
    """A position in a file, for messages: ``file:line:column`` (both counted from 1)."""

    file: str
    line: int = 0
    column: int = 0

    def __str__(self) -> str:
        file = sentence(self.file)
        return f"{file}:{self.line}:{self.column}" if self.line else file

    def fail(self, what: str, remedy: str) -> BadInput:
        """The error of what is wrong there; the caller raises it."""
        return BadInput(what, position=self, remedy=remedy)


class CoordlangError(Exception):
    """Base of all errors that a user may cause: what was wrong, where, and what to do about it.

    ``what`` and ``remedy`` are one sentence each, ``position`` is where in a file it was found, and
    ``reached`` says how far the work got that a limit ended (`planners.system.limits.reaching`).
    The text of an error may be shown as it is, whatever it quotes: characters that steer a terminal
    are escaped, and what is very long is cut (`planners.system.messages`).
    """

    #: A program that coordlang relies on failed (the other codes are set below).
    exit_code = 32

    def __init__(
        self, what: str, *, position: Position | None = None, remedy: str | None = None
    ) -> None:
        super().__init__(what)
        self.what = what
        self.position = position
        self.remedy = remedy
        self.reached: str | None = None

    def __reduce__(self) -> tuple[Any, ...]:
        """Errors of jobs are sent from one process to another, whatever they need."""
        made = copyreg.__newobj__  # type: ignore[attr-defined]
        return made, (type(self), *self.args), self.__dict__

    def __str__(self) -> str:
        what = sentence(self.what)
        lines = [f"{self.position}: {what}" if self.position else what]
        lines += [sentence(line, keep="\n") for line in (self.reached, self.remedy) if line]
        return "\n  ".join(lines)


class Note(UserWarning):
    """What was read in a way that its writer may not have meant; no error.

    A Python warning: the command line writes it to stderr, a program may filter or raise it.
    """


def note(what: str, *, position: Position | None = None, remedy: str | None = None) -> None:
    """Give a `Note`, written as errors are."""
    text = str(CoordlangError(what, position=position, remedy=remedy))
    warnings.warn(Note(text), stacklevel=3)


class Refuted(CoordlangError):
    """A check ended with "no": the thing that was checked is not what it claims to be."""

    exit_code = 1


class UsageError(CoordlangError):
    """The command line contradicts itself or the files it names."""

    exit_code = 2


class ProvedImpossible(CoordlangError):
    """There is no answer, and this is proved (an unsolvable task, inseparable plans)."""

    exit_code = 11


class OutOfMemory(CoordlangError):
    """The memory budget is used up, or an estimate says that it would be."""

    exit_code = 22


class OutOfTime(CoordlangError):
    """The time limit is over."""

    exit_code = 23


class BadInput(CoordlangError):
    """A file does not say what it must say."""

    exit_code = 31


class Unsupported(CoordlangError):
    """A PDDL feature that coordlang does not read."""

    exit_code = 34
