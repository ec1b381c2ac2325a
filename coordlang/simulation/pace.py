# SPDX-License-Identifier: GPL-3.0-or-later
"""Ways to keep step: when a robot may begin its next step.

- ``clock``: step k begins k periods after the start, by a clock that all robots have.
- ``barrier``: step k begins when every robot has told that it has done k steps.
- ``word``: a robot goes on as soon as it has done a step.  Only where the next word may have begun
  it tells so, and waits until every robot has.

Robots tell each other `Message` s and nothing else: how far they are, never what they do.  Standard
library only: a robot carries it.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, Protocol

Kind = Literal["step", "word"]
#: By name, as ``--step`` has them.
PACES = ("clock", "barrier", "word")

#: Seconds by which times may differ that are the same: sums of ticks.
_SAME = 1e-6


@dataclass(frozen=True, slots=True)
class Message:
    """What a robot tells all others: that it has done so many steps, or come to this word.

    ``number`` counts steps from 1 (``step``), or is the index of a word in the sentence (``word``).
    """

    sender: str
    kind: Kind
    number: int


@dataclass(frozen=True, slots=True)
class Progress:
    """How far a robot is, by its own account.

    ``steps`` are done, ``words`` of the sentence are passed at most; the last step was done at time
    ``done`` (seconds; 0 before the first), and begun at time ``begun`` (negative before the first).
    """

    steps: int = 0
    words: int = 0
    done: float = 0.0
    begun: float = -1.0


class Pace(Protocol):
    """One robot's way to keep step with the others."""

    #: Whether all robots turn in the same time before they drive, and idle without time.
    is_common: bool

    def hears(self, messages: Iterable[Message]) -> None:
        """Take in what was told."""

    def told(self, before: Progress, after: Progress) -> Sequence[tuple[Kind, int]]:
        """Return what to tell all robots after a step."""

    def may_begin(self, progress: Progress, time: float) -> bool:
        """Say whether the next step may begin."""


class Clock:
    """A common clock: one step at most in a period, begun with it; nothing is told."""

    is_common = True

    def __init__(self, period: float) -> None:
        self._period = period

    def hears(self, messages: Iterable[Message]) -> None:
        """Take in nothing."""

    def told(self, before: Progress, after: Progress) -> Sequence[tuple[Kind, int]]:
        """Return nothing."""
        return ()

    def may_begin(self, progress: Progress, time: float) -> bool:
        """Say whether a period begins: who is not there in time misses its beginning."""
        begins = abs(math.remainder(time, self._period)) < _SAME
        return begins and progress.begun < time


class Barrier:
    """A barrier before each step: it opens when all have told that the step before is done."""

    is_common = True

    def __init__(self, robots: Iterable[str]) -> None:
        self._done = dict.fromkeys(robots, 0)

    def hears(self, messages: Iterable[Message]) -> None:
        """Take in how many steps each robot has done."""
        _count(self._done, messages, "step")

    def told(self, before: Progress, after: Progress) -> Sequence[tuple[Kind, int]]:
        """Return that a further step is done."""
        return [("step", after.steps)]

    def may_begin(self, progress: Progress, time: float) -> bool:
        """Say whether all have done as many steps as this robot."""
        return all(done >= progress.steps for done in self._done.values())


class WordBarrier:
    """A barrier before each word of the sentence, and free running within a word."""

    is_common = False

    def __init__(self, robots: Iterable[str]) -> None:
        self._words = dict.fromkeys(robots, 0)

    def hears(self, messages: Iterable[Message]) -> None:
        """Take in how many words each robot has passed."""
        _count(self._words, messages, "word")

    def told(self, before: Progress, after: Progress) -> Sequence[tuple[Kind, int]]:
        """Return that the robot may have come to a further word, if so."""
        return [("word", after.words)] if after.words > before.words else ()

    def may_begin(self, progress: Progress, time: float) -> bool:
        """Say whether all have come as far in the sentence as this robot."""
        return all(words >= progress.words for words in self._words.values())


def pace_of(name: str, robots: Iterable[str], period: float) -> Pace:
    """Return a way to keep step by its name, of one robot."""
    if name == "clock":
        return Clock(period)
    return Barrier(robots) if name == "barrier" else WordBarrier(robots)


def _count(heard: dict[str, int], messages: Iterable[Message], kind: Kind) -> None:
    for message in messages:
        if message.kind == kind and message.sender in heard:
            heard[message.sender] = max(heard[message.sender], message.number)


@dataclass(frozen=True, slots=True)
class OwnWords:
    """How far in the sentence a robot may be after own subactions, whatever the others choose.

    An automaton over own subactions, from state 0: ``moves[s]`` leads on, ``words[s]`` is the
    greatest number of words that plans of the sentence have passed there.
    """

    moves: Sequence[Mapping[str, int]]
    words: Sequence[int]
