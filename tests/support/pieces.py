# SPDX-License-Identifier: GPL-3.0-or-later
"""Pieces of work for tests, done in processes of their own: functions that can be sent by name."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from planners.errors import BadInput, Position
from planners.pieces.work import Function, Table, Work, digest


def squares(shared: int, piece: range) -> Table:
    """The squares of some numbers, times what is shared, and who worked them out."""
    return {"values": shared * np.array(piece, np.int64) ** 2, "process": np.array([os.getpid()])}


def fails(_: object, piece: int) -> Table:
    """An error of ours for piece 1, a bug for any other."""
    if piece == 1:
        raise BadInput("no good", position=Position("here", 3, 4), remedy="Try 2.")
    raise ZeroDivisionError("a bug")


def dies_once(folder: str, piece: int) -> Table:
    """Piece 0 loses its process the first time, and every time if the folder says so."""
    mark = Path(folder, f"died-{piece}")
    if piece == 0 and (Path(folder, "always").exists() or not mark.exists()):
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return {"values": np.array([piece])}


def takes_memory(_: object, piece: int) -> Table:
    """So many MiB at once."""
    return {"values": np.ones(piece << 17)[:1]}


def waits(folder: str, piece: int) -> Table:
    """Say which process does it, then wait until the folder says that it may go on."""
    Path(folder, f"pid-{os.getpid()}-{piece}").touch()
    while not Path(folder, "go").exists():
        time.sleep(0.02)
    return {"values": np.array([piece])}


def removes(folder: str, piece: int) -> Table:
    """Half write a file, and remove it when asked to end."""
    half = Path(folder, f"half-{piece}")
    half.touch()
    try:
        Path(folder, f"pid-{os.getpid()}").touch()
        time.sleep(60)
    finally:
        half.unlink()
    return {}


def work(
    function: Function,
    shared: object,
    parts: Iterable[object],
    efforts: Sequence[float] | None = None,
    *,
    isolated: bool = False,
) -> Work:
    """A work of these pieces, each large enough for processes."""
    listed = list(parts)
    return Work(
        "a test",
        function,
        shared,
        listed,
        digest(shared),
        efforts or [1e6] * len(listed),
        isolated=isolated,
    )
