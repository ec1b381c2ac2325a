# SPDX-License-Identifier: GPL-3.0-or-later
"""Time and memory limits of a process: over them, work ends with an error that can be caught.

An alarm raises `OutOfTime` wherever the program is, so that algorithms need no clock of their own;
anytime methods catch it and return what they have.  The memory limit is the operating system's
(address space), met as `MemoryError`.
"""

from __future__ import annotations

import errno
import math
import os
import re
import resource
import signal
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from types import FrameType
from typing import Any

from planners.system.errors import CoordlangError, OutOfMemory, OutOfTime

#: The alarm rings again, should nobody have caught it (libraries in C may lose an exception); not
#: too soon, so that whoever caught it can save his work and stop the clock.
_AGAIN = 5.0
#: And very soon where Python itself lost it: an exception cannot leave a finalizer or the callback
#: of a weak reference.
_SOON = 0.01
#: Seconds until a timer rings that is to ring at once.
_AT_ONCE = 1e-6
#: Seconds that no timer counts to the end (some cannot be set to more).
_FOR_EVER = 1e9
#: Seconds for what has to follow on work that a limit ended: the clock has been stopped by then.
_LITTLE = 0.5
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
#: How Python says that C code has failed without a word.
_NO_REASON = ("without exception set", "without setting an exception")
_LONGER = "Use a larger --time-limit."
#: Of the memory that is free, what a process takes that is given no limit.
_SHARE = 0.8
#: Bytes of address space that scipy takes at most, with one thread; and how many threads its BLAS
#: starts, for the time in which it is loaded.
_SCIPY, _THREADS = 192 << 20, "OPENBLAS_NUM_THREADS"


@contextmanager
def time_limit(seconds: float | None) -> Iterator[None]:
    """Raise `OutOfTime` in the block when ``seconds`` of wall time are over (main thread only).

    No time is over at once.  Blocks may be nested; the limit that is over first rings, and it names
    its own seconds.
    Libraries, above all while they are imported, make other errors of it: they leave the block as
    `OutOfTime`, unless the clock has been stopped.
    """
    if seconds is None or seconds > _FOR_EVER or time_left() < seconds:
        yield
        return

    rang = False

    def over() -> OutOfTime:
        return OutOfTime(f"the time limit of {seconds:g} s is over", remedy=_LONGER)

    def ring(_signal: int, _frame: FrameType | None) -> None:
        nonlocal rang
        rang = True
        raise over()

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
        # Inside: it may ring at once; and 0 would stop the clock.
        signal.setitimer(signal.ITIMER_REAL, max(_AT_ONCE, seconds), _AGAIN)
        yield
    except Exception as error:
        is_ours = isinstance(error, CoordlangError | MemoryError | AssertionError)
        if is_ours or not rang or time_left() == math.inf:
            raise
        raise over() from error
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


def start_clock(seconds: float) -> None:
    """Let the alarm of the `time_limit` around ring after so many seconds; infinite: as before."""
    if seconds < math.inf:
        signal.setitimer(signal.ITIMER_REAL, max(_SOON, seconds), _AGAIN)


def run_until_stopped(work: Callable[[], object]) -> BaseException | None:
    """Do anytime work; return the error that ended it early (one of `STOPPING`), or None.

    The clock is then stopped, so that what the work has left can be saved.  The error comes without
    its traceback, which would hold on to all that the work had in memory.
    """
    try:
        work()
    except STOPPING as error:
        stop_clock()
        return error.with_traceback(None)
    return None


@contextmanager
def little_time_after(stopped: BaseException | None) -> Iterator[None]:
    """Raise an error again where a block that follows on work which it ended takes long, too.

    ``stopped`` is what `run_until_stopped` returned.  After work that was not stopped, and after an
    error of memory, the block has the time that is left.
    """
    if not isinstance(stopped, OutOfTime | KeyboardInterrupt):
        yield
        return
    try:
        with time_limit(_LITTLE):
            yield
    except OutOfTime:
        raise stopped from None


def time_left() -> float:
    """Seconds until the alarm of a `time_limit` rings; infinite without one."""
    left, _ = signal.getitimer(signal.ITIMER_REAL)
    return left if left > 0 else math.inf


#: How far the blocks of `reaching` got that the program is in, the innermost last.
_UNDERWAY: list[Callable[[], str]] = []


def underway() -> Callable[[], str] | None:
    """Says how far the innermost block of `reaching` got; None outside of all.

    Another thread may ask.  What it is told is then read while the work changes it.
    """
    blocks = _UNDERWAY[-1:]
    return blocks[0] if blocks else None


@contextmanager
def reaching(so_far: Callable[[], str], instead: str) -> Iterator[None]:
    """Should a limit end the block, let the error say how far it got; meanwhile `underway` does.

    ``so_far`` says it, in numbers; ``instead`` is what to try besides a larger limit ("fewer
    objects").  Of nested blocks the innermost speaks.  Memory that is used up (`MemoryError`)
    leaves the block as `OutOfMemory`.
    """
    depth = len(_UNDERWAY)
    try:
        _UNDERWAY.append(so_far)
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
    finally:
        del _UNDERWAY[depth:]
    full = OutOfMemory("the memory is used up", remedy=f"Use {more_memory()}, or {instead}.")
    full.reached = f"Reached: {so_far()}."
    raise full


def limit_memory(size: int | None) -> None:
    """Let this process and its children have at most ``size`` bytes of address space."""
    if size is not None:
        _, hard = resource.getrlimit(resource.RLIMIT_AS)
        most = sys.maxsize if hard == resource.RLIM_INFINITY else hard
        resource.setrlimit(resource.RLIMIT_AS, (min(size, most), hard))


@contextmanager
def limited_memory(size: int | None) -> Iterator[None]:
    """`limit_memory` for the block; after it the limit is what it was."""
    before = resource.getrlimit(resource.RLIMIT_AS)
    limit_memory(size)
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_AS, before)


def has_memory_limit() -> bool:
    """Whether the address space of this process is limited."""
    return resource.getrlimit(resource.RLIMIT_AS)[0] != resource.RLIM_INFINITY


def more_memory() -> str:
    """What to use where the memory was too little, in words."""
    return "a larger --memory-limit" if has_memory_limit() else "a machine with more memory"


def default_memory_limit() -> int:
    """What a process may have that is given no limit: 80 % of what is free, besides what it has.

    What is free is that of the machine or of the process's control group, whichever is less.
    """
    return address_space() + int(_SHARE * _available())


def require_memory(size: int) -> None:
    """Raise `OutOfMemory` if the program with its libraries already has more than ``size`` bytes.

    To be asked before `limit_memory`: numpy aborts the process when it is loaded under a limit that
    is too small.
    """
    load_libraries()
    if size < address_space():
        raise OutOfMemory(
            f"the program alone needs {address_space() / 2**20:.0f} MiB of address space",
            remedy="Use a larger --memory-limit.",
        )


def load_libraries() -> None:
    """Load numpy with all that it takes memory for."""
    import numpy as np

    np.zeros((8, 8)) @ np.zeros((8, 8))


def csgraph() -> Any:
    """The module ``scipy.sparse.csgraph``.

    Raises `OutOfMemory` if the limit on the address space leaves no room for it: BLAS would ask for
    memory without end while it is loaded, and hear no signal.
    """
    left = address_space_left()
    if "scipy.sparse.csgraph" in sys.modules or left == math.inf:
        from scipy.sparse import csgraph

        return csgraph
    if left < _SCIPY:
        raise OutOfMemory(
            f"scipy takes up to {_SCIPY / 2**20:.0f} MiB of address space, and "
            f"{left / 2**20:.0f} MiB are left",
            remedy=f"Use {more_memory()}.",
        )
    before = os.environ.get(_THREADS)
    os.environ[_THREADS] = "1"  # graphs need no BLAS, and each thread of it takes memory
    try:
        from scipy.sparse import csgraph
    finally:
        if before is None:
            del os.environ[_THREADS]
        else:
            os.environ[_THREADS] = before
    return csgraph


def lacks_memory(error: BaseException) -> bool:
    """Whether this error, of whatever library, means that the memory is used up."""
    is_refused = isinstance(error, OSError) and error.errno == errno.ENOMEM
    if is_refused or isinstance(error, MemoryError):
        return True
    # C code that was refused memory and does not say so; without a limit it is a bug.
    if isinstance(error, SystemError) and any(text in str(error) for text in _NO_REASON):
        return has_memory_limit()
    return any(text in str(error).lower() for text in _NO_MEMORY)


def memory_left() -> int:
    """Bytes that this process may still take: under its limit and as the machine has them free."""
    return int(min(_available(), address_space_left()))


def address_space_left() -> float:
    """Bytes that the limit of this process leaves it; infinite without one."""
    soft, _ = resource.getrlimit(resource.RLIMIT_AS)
    return math.inf if soft == resource.RLIM_INFINITY else max(0, soft - address_space())


def _available() -> int:
    """Bytes that the machine, or the process's control group, has free or can free at once."""
    with suppress(OSError):  # of Linux
        text = Path("/proc/meminfo").read_text()
        if found := re.search(r"^MemAvailable:\s*(\d+) kB$", text, re.M):
            return min(int(found[1]) * 2**10, _group_memory_left())
    import psutil  # which takes as long to load as a small task to solve

    return int(psutil.virtual_memory().available)  # there are no control groups


def _group_memory_left() -> int:
    """Bytes that the control groups of this process leave it (jobs of a scheduler, containers)."""
    left = sys.maxsize
    for folder in _memory_groups():
        with suppress(OSError, ValueError):  # no group of its own, or one without a limit
            most, used = (int((folder / f"memory.{n}").read_text()) for n in ("max", "current"))
            # Files in memory are given up where it is short.
            files = re.search(r"^inactive_file (\d+)", (folder / "memory.stat").read_text(), re.M)
            left = min(left, max(0, most - used + (int(files[1]) if files else 0)))
    return left


def _memory_groups() -> Iterator[Path]:
    """The folders of the control groups (version 2) that this process is in, and those above."""
    with suppress(OSError):
        own = Path("/proc/self/cgroup").read_text().strip().rpartition("0::/")[2]
        group = Path("/sys/fs/cgroup", own)
        yield from (group, *group.parents)  # in a container ``own`` may be of the machine


def address_space() -> int:
    """Bytes of address space that this process has."""
    with suppress(OSError):
        return int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    import psutil

    return int(psutil.Process().memory_info().vms)
