# SPDX-License-Identifier: GPL-3.0-or-later
"""Graphs by scipy, which is loaded only where there is room for its BLAS."""

from __future__ import annotations

import math
import os
import sys
from typing import Any

from planners.system.errors import OutOfMemory
from planners.system.limits import address_space_left, more_memory

#: Bytes of address space that scipy takes at most, with one thread.
_LIBRARY = 192 << 20
#: How many threads BLAS starts, for the time in which it is loaded.
_THREADS = "OPENBLAS_NUM_THREADS"


def csgraph() -> Any:
    """The module ``scipy.sparse.csgraph``.

    Raises `OutOfMemory` if the limit on the address space leaves no room for it: BLAS would ask for
    memory without end while it is loaded, and hear no signal.
    """
    left = address_space_left()
    if "scipy.sparse.csgraph" in sys.modules or left == math.inf:
        from scipy.sparse import csgraph

        return csgraph
    if left < _LIBRARY:
        raise OutOfMemory(
            f"scipy takes up to {_LIBRARY / 2**20:.0f} MiB of address space, and "
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
