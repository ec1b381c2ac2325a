# SPDX-License-Identifier: GPL-3.0-or-later
"""A conversation with a process of its own, which works while this one does."""

from __future__ import annotations

import pickle
from typing import Any

from planners.pieces.conversation import Here, Talk
from planners.pieces.worker_process import WorkerLost, WorkerProcess, end_all

#: Seconds between two looks at the limits.
_TICK = 1.0


class Beside:
    """A conversation with a process of its own.

    A process that is lost is replaced by this one, which begins again: the same messages have the
    same answers, so those that were heard are left out.

    Parameters
    ----------
    talk, shared
        What answers, and what it works on.
    memory
        Bytes that the process may take; None: no limit of its own.
    """

    def __init__(self, talk: Talk, shared: Any, memory: int | None = None) -> None:
        self._talk, self._shared = talk, shared
        self._sent: list[Any] = []
        self._heard = 0
        self._instead: Here | None = None
        self._worker = WorkerProcess(memory)
        self._worker.begin_talk(pickle.dumps((talk, shared), pickle.HIGHEST_PROTOCOL))

    @property
    def goes_on_alone(self) -> bool:
        """See `Conversation`."""
        return self._instead is None

    @property
    def pid(self) -> int:
        """The number of the process."""
        return self._worker.pid

    def send(self, message: Any) -> None:
        """See `Conversation`."""
        self._sent.append(message)
        if self._instead is not None:
            self._instead.send(message)
        else:
            self._worker.say(pickle.dumps(message, pickle.HIGHEST_PROTOCOL))

    def ready(self) -> bool:
        """See `Conversation`."""
        return self._instead is None and self._worker.ready(0)

    def answer(self) -> Any:
        """See `Conversation`."""
        if self._instead is None:
            try:
                while not self._worker.ready(_TICK):
                    pass
                found = self._worker.heard()
            except WorkerLost:
                self._begin_again()
            else:
                self._heard += 1
                return found
        assert self._instead is not None
        return self._instead.answer()

    def close(self) -> None:
        """See `Conversation`."""
        if self._instead is not None:
            self._instead.close()
        else:
            end_all([self._worker])

    def _begin_again(self) -> None:
        self._instead = Here(self._talk, self._shared)
        for message in self._sent:
            self._instead.send(message)
        for _ in range(self._heard):
            self._instead.answer()
