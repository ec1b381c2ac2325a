# SPDX-License-Identifier: GPL-3.0-or-later
"""A conversation with work beside this one: messages go there, answers come back.

What answers is a generator function of a module (it is sent to another process by name).  What it
answers depends on what it was given and on the messages alone, so it makes no difference who runs
it: this process, whenever an answer is waited for (`Here`), or one of its own
(`planners.pieces.beside.Beside`).
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Generator, Iterator
from typing import Any, Protocol

#: What answers: it gets what it works on, and the messages; it takes one when it needs it.
Talk = Callable[[Any, Iterator[Any]], Generator[Any]]


class Conversation(Protocol):
    """One conversation; who waits for an answer must have sent the messages that it needs."""

    @property
    def goes_on_alone(self) -> bool:
        """Whether there is work done while nobody waits for it."""
        ...

    def send(self, message: Any) -> None:
        """Send a message."""
        ...

    def ready(self) -> bool:
        """Whether there is an answer already."""
        ...

    def answer(self) -> Any:
        """The next answer; waits for it.  Raises what the work raises."""
        ...

    def close(self) -> None:
        """End the work, wherever it is."""
        ...


class Here:
    """A conversation with a generator in this process.

    Parameters
    ----------
    talk, shared
        What answers, and what it works on.
    """

    goes_on_alone = False

    def __init__(self, talk: Talk, shared: Any) -> None:
        self._messages: deque[Any] = deque()
        self._answers = talk(shared, self._received())

    def send(self, message: Any) -> None:
        """See `Conversation`."""
        self._messages.append(message)

    def ready(self) -> bool:
        """See `Conversation`: there is none before one is waited for."""
        return False

    def answer(self) -> Any:
        """See `Conversation`."""
        return next(self._answers)

    def close(self) -> None:
        """See `Conversation`."""
        self._answers.close()

    def _received(self) -> Iterator[Any]:
        while self._messages:
            yield self._messages.popleft()
        raise AssertionError("an answer was waited for that needs another message")
