# SPDX-License-Identifier: GPL-3.0-or-later
"""What all jobs of a batch share, on a Dask worker."""

from __future__ import annotations

import pickle
from typing import Any

from distributed.diagnostics.plugin import WorkerPlugin


class BatchPlugin(WorkerPlugin):  # type: ignore[misc]
    """The function of a batch and what its jobs share: packed, and unpacked with the first job.

    Parameters
    ----------
    name
        Under which the worker knows this plugin.
    packed
        Both.
    """

    def __init__(self, name: str, packed: bytes) -> None:
        self.name, self._packed = name, packed

    def work(self) -> tuple[Any, Any]:
        """The function, and what is shared."""
        if not hasattr(self, "_work"):
            self._work: tuple[Any, Any] = pickle.loads(self._packed)
        return self._work
