# SPDX-License-Identifier: GPL-3.0-or-later
"""A stderr that takes everything: what it cannot show is lost, and the exit code stays."""

from __future__ import annotations

import io
import os
import sys
from typing import TextIO

_NUMBER = 2


def whatever_stderr() -> TextIO:
    """Return a stream for stderr on which nothing fails, be it closed or on a full disk.

    Of the first three file numbers those that are closed are reserved: else the next file that is
    opened would get one, and messages of libraries with it.
    """
    for number in range(_NUMBER + 1):
        try:
            os.fstat(number)
        except OSError:  # closed
            os.set_inheritable(os.open(os.devnull, os.O_RDWR), True)
    encoding = sys.stderr.encoding if sys.stderr is not None else "utf-8"
    buffer = io.BufferedWriter(_Lossy())  # type: ignore[type-var]
    return io.TextIOWrapper(buffer, encoding, errors="backslashreplace", line_buffering=True)


def flush_stdout() -> None:
    """Write what stdout still holds; the exit code says already if that failed before."""
    try:
        if sys.stdout is not None:
            sys.stdout.flush()
    except OSError:
        drop_stdout()


def drop_stdout() -> None:
    """Write no more to stdout, at the end of the process neither."""
    sys.stdout = open(os.devnull, "w")  # noqa: SIM115 - open to the end


class _Lossy(io.RawIOBase):
    """File number 2; what cannot be written to it is lost."""

    def writable(self) -> bool:
        return True

    def fileno(self) -> int:
        return _NUMBER

    def isatty(self) -> bool:
        return os.isatty(_NUMBER)

    def write(self, data: io.BytesIO | bytes) -> int:  # type: ignore[override]
        view = memoryview(data)  # type: ignore[arg-type]
        try:
            return os.write(_NUMBER, view)
        except OSError:
            return len(view)
