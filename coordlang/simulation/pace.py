# SPDX-License-Identifier: GPL-3.0-or-later
"""Ways to keep step: when a robot may begin its next step.

- ``clock``: step k begins k periods after the start, by a clock that all robots have.
- ``barrier``: step k begins when every robot has told that it has done k steps.
- ``word``: a robot goes on as soon as it has done a step.  Only where the next word may have begun
  it tells so, and waits until every robot has.
- ``passings``: there are no steps.  A robot starts an event when those of others that it waits for
  have ended, which they tell if it matters to somebody, and so that they are ready for a meeting.

Robots tell each other `Message` s and nothing else.  Standard library only: a robot carries it.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

Kind = Literal["step", "word", "ended", "ready"]
#: By name, as ``--step`` has them.
PACES = ("clock", "barrier", "word", "passings")

#: Seconds by which times may differ that are the same: sums of ticks.
_SAME = 1e-6


@dataclass(frozen=True, slots=True)
class Message:
    """What a robot tells all others: that it has done so many steps, or come to this word.

    ``number`` counts steps from 1 (``step``), or is the index of a word in the sentence (``word``).
    Without steps that its event with this number has ended, or is ready for its partners, and which
    ``subaction`` it is.
    """

    sender: str
    kind: Kind
    number: int
    subaction: str = ""


class Pace:
    """One robot's way to keep step with the others, one of `PACES`; a period is in seconds."""

    def __init__(self, way: str, robots: Iterable[str], period: float) -> None:
        self._way, self.period = way, period
        self._heard = dict.fromkeys(robots, 0)

    @property
    def is_common(self) -> bool:
        """Whether all robots turn in the same time before they drive, and idle without time."""
        return self._way in ("clock", "barrier")

    def hears(self, messages: Iterable[Message]) -> None:
        """Take in how far the others are."""
        if self._way == "passings":
            return
        for message in messages:
            self._heard[message.sender] = max(self._heard[message.sender], message.number)

    def told(self, steps: int, words: int, is_further: bool) -> Sequence[tuple[Kind, int]]:
        """What to tell all robots after a step, by which ``is_further`` in the sentence."""
        if self._way == "barrier":
            return [("step", steps)]
        return [("word", words)] if self._way == "word" and is_further else []

    def may_begin(self, steps: int, words: int, begun: float, time: float) -> bool:
        """Whether the next step may begin.

        ``steps`` are done, and ``words`` of the sentence passed at most; the last step was begun at
        ``begun`` (seconds; negative before the first).  By the clock, who is late misses a
        beginning.
        """
        if self._way == "clock":
            return abs(math.remainder(time, self.period)) < _SAME and begun < time
        if self._way == "passings":
            return True
        own = steps if self._way == "barrier" else words
        return all(heard >= own for heard in self._heard.values())

    def missed(self, steps: int, time: float) -> int:
        """How many beginnings by the clock a step comes too late that now begins after others."""
        return round(time / self.period) - steps if self._way == "clock" else 0


@dataclass(frozen=True, slots=True)
class OwnWords:
    """How far in the sentence a robot may be after own subactions, whatever the others choose.

    An automaton over own subactions, from state 0: ``moves[s]`` leads on, ``words[s]`` is the
    greatest number of words that plans of the sentence have passed there.
    """

    moves: Sequence[Mapping[str, int]]
    words: Sequence[int]
