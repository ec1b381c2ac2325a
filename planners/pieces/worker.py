# SPDX-License-Identifier: GPL-3.0-or-later
"""A process that does pieces, one after another: ``python -m planners.pieces.worker FD PARENT``.

It ends when its parent does, when it is asked to (SIGINT, SIGTERM, SIGHUP), and when it has had
nothing to do for a while; what is half written is removed then.  Whoever starts it:
`planners.pieces.worker_process`.
"""

from __future__ import annotations

import os
import pickle
import signal
import sys
import threading
import traceback
from contextlib import suppress
from multiprocessing.connection import Connection
from time import perf_counter, process_time
from types import FrameType
from typing import Any

#: The exit code of a worker that was asked to end.
ASKED_TO_END = 75
#: Seconds without anything to do after which it ends by itself.
_IDLE = 600.0
#: Seconds between two looks at whether the parent is there.
_TICK = 0.5


class Ended(SystemExit):
    """A signal ends the worker, wherever it is."""


def main() -> None:
    """Do pieces until the connection is closed."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, _end)
    connection, parent = Connection(int(sys.argv[1])), int(sys.argv[2])
    threading.Thread(target=_end_with, args=(parent,), daemon=True).start()
    with suppress(EOFError, ConnectionError):
        path, memory = connection.recv()
        sys.path[:] = path
        if memory is not None:
            _limit(memory)
        _serve(connection)


def _serve(connection: Connection) -> None:
    """Answer messages: ``("work", bytes)`` is remembered, ``("piece", bytes)`` is done."""
    packed, work = b"", None
    while connection.poll(_IDLE):
        what, payload = connection.recv()
        if what == "work":
            packed, work = payload, None
            continue
        since, busy = perf_counter(), process_time()
        try:
            work = work or pickle.loads(packed)
            function, shared = work
            answer: tuple[Any, ...] = ("done", function(shared, pickle.loads(payload)))
        except (Exception, KeyboardInterrupt) as error:
            answer = ("error", *_as_sent(error))
        connection.send((answer, perf_counter() - since, process_time() - busy))


def _as_sent(error: BaseException) -> tuple[bytes | None, str, str]:
    """An error as a pickle (None where that fails), its own text, and where it was raised."""
    where = "".join(traceback.format_exception(error))
    text = f"{type(error).__name__}: {error}"
    try:
        packed = pickle.dumps(error.with_traceback(None))
        pickle.loads(packed)
    except Exception:
        return None, text, where
    return packed, text, where


def _limit(memory: int) -> None:
    """Let this process take so many bytes more than its libraries do."""
    import numpy as np

    from planners.limits import address_space, limit_memory

    np.zeros((8, 8)) @ np.zeros((8, 8))
    limit_memory(address_space() + memory)


def _end(_signal: int, _frame: FrameType | None) -> None:
    raise Ended(ASKED_TO_END)


def _end_with(parent: int) -> None:
    """End this process soon after its parent was killed."""
    tick = threading.Event()
    while os.getppid() == parent:
        tick.wait(_TICK)
    os._exit(1)


if __name__ == "__main__":
    main()
