# SPDX-License-Identifier: GPL-3.0-or-later
"""Time and memory limits of a process.

Over the limit, work in progress ends with an error that the caller can catch.

An alarm raises `OutOfTime` wherever the program is, so that algorithms need no clock of their own;
anytime methods catch it and return what they have.  The memory limit is the operating system's
(address space), met as `MemoryError`.
"""

from __future__ import annotations

import errno
import math
import os
import resource
import signal
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType

from planners.errors import OutOfMemory, OutOfTime

#: The alarm rings again, should nobody have caught it (libraries in C may lose an exception); not
#: too soon, so that whoever caught it can save his work and stop the clock.
_AGAIN = 5.0
#: And very soon where Python itself lost it: an exception cannot leave a finalizer or the callback
#: of a weak reference.
_SOON = 0.01
#: Seconds that no timer counts to the end (some cannot be set to more).
_FOR_EVER = 1e9
#: What ends work early, so that an anytime method returns what it has.
STOPPING = (OutOfTime, OutOfMemory, MemoryError, KeyboardInterrupt)
#: How loaders and libraries say that there is no memory.
_NO_MEMORY = (
    "failed to map segment",
    "cannot allocate memory",
    "cannot create thread",
    "can't start new thread",
    "std::bad_alloc",
)
_LONGER = "Use a larger --time-limit."


@contextmanager
def time_limit(seconds: float | None) -> Iterator[None]:
    """Raise `OutOfTime` in the block when ``seconds`` of wall time are over (main thread only).

    Blocks may be nested; the limit that is over first rings, and it names its own seconds.
    """
    if seconds is None or seconds > _FOR_EVER or time_left() < seconds:
        yield
        return

    def ring(_signal: int, _frame: FrameType | None) -> None:
        raise OutOfTime(f"the time limit of {seconds:g} s is over", remedy=_LONGER)

    def lost(unraisable: sys.UnraisableHookArgs) -> None:
        if isinstance(unraisable.exc_value, OutOfTime):
            signal.setitimer(signal.ITIMER_REAL, _SOON, _AGAIN)
        else:
            lost_before(unraisable)

    before = signal.signal(signal.SIGALRM, ring)
    lost_before, sys.unraisablehook = sys.unraisablehook, lost
    begin = time.monotonic()
    outer, again = signal.getitimer(signal.ITIMER_REAL)
    try:
        signal.setitimer(signal.ITIMER_REAL, seconds, _AGAIN)  # inside: it may ring at once
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)
        sys.unraisablehook = lost_before
        if outer:  # the block around this one goes on with its own time
            signal.setitimer(
                signal.ITIMER_REAL, max(_SOON, outer - (time.monotonic() - begin)), again
            )


def stop_clock() -> None:
    """Ring no more: for work that has met its time limit and still has to save what it has."""
    signal.setitimer(signal.ITIMER_REAL, 0)


def run_until_stopped(
    work: Callable[[], object],
    *,
    keep_time_after: type[BaseException] | tuple[type[BaseException], ...] = (),
) -> BaseException | None:
    """Do anytime work; return the error that ended it early (one of `STOPPING`), or None.

    The clock is then stopped, so that what the work has left can be saved, except after errors of
    the types ``keep_time_after``.  The error comes without its traceback, which would hold on to
    all that the work had in memory.
    """
    try:
        work()
    except STOPPING as error:
        if not isinstance(error, keep_time_after):
            stop_clock()
        return error.with_traceback(None)
    return None


def time_left() -> float:
    """Seconds until the alarm of a `time_limit` rings; infinite without one."""
    left, _ = signal.getitimer(signal.ITIMER_REAL)
    return left if left > 0 else math.inf


@contextmanager
def reaching(so_far: Callable[[], str], instead: str) -> Iterator[None]:
    """Should a limit end the block, let the error say how far it got.

    ``so_far`` says it, in numbers; ``instead`` is what to try besides a larger limit ("fewer
    objects").  Of nested blocks the innermost speaks.  Memory that is used up (`MemoryError`)
    leaves the block as `OutOfMemory`.
    """
    try:
        yield
        return
    except (OutOfTime, OutOfMemory) as error:
        if error.reached is None:
            error.reached = f"Reached: {so_far()}."
            if error.remedy == _LONGER:
                error.remedy = f"Use a larger --time-limit, or {instead}."
        raise
    except MemoryError:
        pass  # what the frames below hold is free once this block is left
    full = OutOfMemory(
        "the memory is used up", remedy=f"Use a larger --memory-limit, or {instead}."
    )
    full.reached = f"Reached: {so_far()}."
    raise full


def limit_memory(size: int | None) -> None:
    """Let this process and its children have at most ``size`` bytes of address space."""
    if size is not None:
        _, hard = resource.getrlimit(resource.RLIMIT_AS)
        most = sys.maxsize if hard == resource.RLIM_INFINITY else hard
        resource.setrlimit(resource.RLIMIT_AS, (min(size, most), hard))


def require_memory(size: int) -> None:
    """Raise `OutOfMemory` if the program alone already has more than ``size`` bytes.

    Its libraries are loaded by then.

    To be asked before `limit_memory`: numpy aborts the process when it is loaded under a limit that
    is too small.
    """
    import numpy as np

    np.zeros((8, 8)) @ np.zeros((8, 8))
    if size < _used():
        raise OutOfMemory(
            f"the program alone needs {_used() / 2**20:.0f} MiB of address space",
            remedy="Use a larger --memory-limit.",
        )


def require_libraries() -> None:
    """Raise `OutOfMemory` if numpy does not load under the limit that the process started with.

    BLAS ends the process then (``ulimit -v``), so that a child process tries it.
    """
    soft, _ = resource.getrlimit(resource.RLIMIT_AS)
    if soft == resource.RLIM_INFINITY or "numpy" in sys.modules:
        return
    child = os.fork()
    if child == 0:
        os._exit(_load_quietly())
    _, status = os.waitpid(child, 0)
    if status != 0:
        raise OutOfMemory(
            f"the libraries do not load in {soft / 2**20:.0f} MiB of address space",
            remedy="Use a larger limit (ulimit -v).",
        )


def _load_quietly() -> int:
    """Load numpy, silently: the exit code of the process that tries it."""
    try:
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, 1)
        os.dup2(nowhere, 2)
        import numpy as np

        np.zeros((8, 8)) @ np.zeros((8, 8))
    except (ImportError, MemoryError, OSError, RuntimeError, SystemError):
        return 1
    return 0


def lacks_memory(error: BaseException) -> bool:
    """Whether this error, of whatever library, means that the memory is used up."""
    if isinstance(error, MemoryError):
        return True
    if isinstance(error, OSError) and error.errno == errno.ENOMEM:
        return True
    return any(text in str(error).lower() for text in _NO_MEMORY)


def memory_left() -> int:
    """Bytes that this process may still take: under its limit and as the machine has them free."""
    free = _available()
    soft, _ = resource.getrlimit(resource.RLIMIT_AS)
    if soft == resource.RLIM_INFINITY:
        return free
    return max(0, min(free, soft - _used()))


def _available() -> int:
    """Bytes that the machine has free or can free at once."""
    import psutil  # some milliseconds, and only long work asks

    return int(psutil.virtual_memory().available)


def _used() -> int:
    """Bytes of address space that this process has."""
    import psutil

    return int(psutil.Process().memory_info().vms)
