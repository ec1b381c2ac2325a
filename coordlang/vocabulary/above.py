# SPDX-License-Identifier: GPL-3.0-or-later
"""The search from above as the search from below sees it: languages, in turns.

Both go on in turns, each with more effort than the one before, and neither looks at a clock, so
that the result does not depend on who is faster.  The search from below needs nothing of the other
one but the end; turn ``k`` from above knows the bound that was proved in turn ``k - 2``.  Where
both find a language with the fewest words, that from above is taken if it was found in the next
turn at the latest: farther it never is ahead.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from coordlang.vocabulary.from_above import Fewer, Trying, TurnOver
from coordlang.vocabulary.job import Assignment, word_count
from planners.pieces.conversation import Conversation

#: Turns by which the search from below may be ahead.
_AHEAD = 2


class Above:
    """What is heard of `coordlang.vocabulary.from_above.from_above`.

    Parameters
    ----------
    conversation
        With it.
    states
        Numbers of the states that need words.
    take
        Called with each language when it is heard.
    progress
        Called with what is done next.

    Attributes
    ----------
    best
        The last language, which has the fewest words; None before there is one.
    figures
        The work done.
    """

    def __init__(
        self,
        conversation: Conversation,
        states: Sequence[int],
        take: Callable[[Assignment], None],
        progress: Callable[[str], None],
    ) -> None:
        self._conversation, self._states = conversation, states
        self._take, self._progress = take, progress
        self._over = 0
        self.best: Assignment | None = None
        self.figures: dict[str, float] = {}

    def allow_turn(self, lower: int) -> None:
        """Allow one more turn, in which so many words are known to be needed."""
        self._conversation.send(lower)

    def begin_turn(self, turn: int, words: int) -> None:
        """Wait as long as the search from below may not begin this turn; see `wait_for`."""
        self.wait_for(turn - _AHEAD if self._conversation.goes_on_alone else turn, words)

    def wait_for(self, turn: int, words: int) -> None:
        """Wait until a turn is over, or there is a language with so few words."""
        while self._over < turn and (self.best is None or word_count(self.best) > words):
            self._hear()

    def listen(self) -> None:
        """Hear what there is to be heard."""
        while self._conversation.ready():
            self._hear()

    def close(self) -> None:
        """End the search."""
        self._conversation.close()

    def _hear(self) -> None:
        match self._conversation.answer():
            case Trying(what):
                self._progress(what)
            case Fewer(words):
                self.best = dict(zip(self._states, words.tolist(), strict=True))
                self._take(self.best)
            case TurnOver(figures):
                self._over += 1
                self.figures = dict(figures)
