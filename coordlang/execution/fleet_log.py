# SPDX-License-Identifier: GPL-3.0-or-later
"""What robots tell each other: how they agree on a sentence, events so far, and what each knows.

A `RobotLog` only grows, and logs of one robot are joined by taking the further one: messages may
come late, twice or not at all, and a robot that was started again learns its own events from the
others.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Annotated, Any, NamedTuple

import msgspec
from msgspec import Meta, Struct

from planners.system.errors import Refuted

#: Events in one message; a robot that lacks more gets them one message after another.
_EVENTS_SENT = 16

_Number = Annotated[int, Meta(ge=0, lt=1 << 53)]


class Contradiction(ValueError):
    """A message that cannot be true beside what is known; it is refused, and ends nothing."""


class Version(NamedTuple):
    """How far a robot's log goes: its events, how many have begun, were told to the driver, ended.

    The last event may be chosen and not begun: then the robot is ready for a meeting.  ``is_done``
    says that the robot does no more.
    """

    events: _Number = 0
    begun: _Number = 0
    told: _Number = 0
    ended: _Number = 0
    is_done: bool = False

    def lacks(self, other: Version) -> bool:
        """Whether the other one goes further in anything."""
        return any(its > own for own, its in zip(self, other, strict=True))


class Event(Struct, frozen=True, array_like=True):
    """An event of a robot: how its choices name it, what is done, and the robots that it meets."""

    name: str
    subaction: str
    partners: tuple[str, ...] = ()


class LogPart(Struct, frozen=True):
    """A part of a robot's log: its events from number ``first`` (from 0) on."""

    version: Version
    first: _Number = 0
    events: tuple[Event, ...] = ()


@dataclass(slots=True)
class RobotLog:
    """All that is known of what one robot did: its events, and its `Version`."""

    events: list[Event] = field(default_factory=list)
    version: Version = field(default_factory=Version)

    def advance(self, **changed: Any) -> None:
        """Change the version."""
        self.version = self.version._replace(events=len(self.events), **changed)

    def part(self, known: Version) -> LogPart:
        """What somebody lacks who knows so much, and the event before, by which it is checked."""
        first = max(0, min(known.events, len(self.events)) - 1)
        return LogPart(self.version, first, tuple(self.events[first : first + 1 + _EVENTS_SENT]))

    def join(self, part: LogPart) -> bool:
        """Take in what is new; whether anything was.  `Contradiction`: and all is as before."""
        known, told = self.events, part.version
        most = told.ended + (not told.is_done)
        is_possible = told.ended <= told.told <= told.begun <= told.events <= most
        if not is_possible or part.first + len(part.events) > told.events:
            raise Contradiction(f"no robot can be so far: {told}")
        if part.first >= max(1, len(known)):
            return False  # the event before it is missing: it comes again
        shared = known[part.first : part.first + len(part.events)]
        if tuple(shared) != part.events[: len(shared)]:
            raise Contradiction("its events are others than those that were told before")
        events = [*known, *part.events[len(shared) :]]
        if len(events) < told.events:  # as far as this part goes all events have ended
            all_of = len(events)
            told = Version(all_of, all_of, all_of, all_of)
        joined = Version._make(map(max, self.version, told))
        if joined == self.version:
            return False
        self.events, self.version = events, joined._replace(events=len(events))
        return True

    def meetings(self, robot: str, number: int | None = None) -> list[Event]:
        """Of the first ``number`` events, by default of all, those that meet a robot, in order."""
        return [event for event in self.events[:number] if robot in event.partners]


class Reply(Struct, frozen=True):
    """A robot's answer to a proposed sentence: it agrees, or has ``wishes`` that are not met."""

    sentence: str
    wishes: tuple[str, ...] = ()


class Message(Struct, frozen=True, omit_defaults=True):
    """A message of one robot to another, sent as JSON; all of them have this form.

    ``run`` names what all must agree on (domain, task, words), ``life`` the process that speaks;
    ``lives`` says of which process of each robot it has heard, ``knows`` how far it knows each
    robot's log, ``logs`` what the other one lacks.  ``sentence`` is what was agreed on; before that
    a robot that has wishes ``speaks``, one ``proposes`` a sentence, the others ``answer``.
    ``late``: its event takes so many seconds longer.
    """

    run: str
    by: str
    life: _Number
    lives: dict[str, _Number] = {}
    knows: dict[str, Version] = {}
    logs: dict[str, LogPart] = {}
    sentence: str | None = None
    speaks: bool = False
    proposes: str | None = None
    answer: Reply | None = None
    late: Annotated[float, Meta(ge=0)] | None = None


_DECODER = msgspec.json.Decoder(Message)


def decoded(data: bytes, run: str, robot: str, others: Sequence[str]) -> Message:
    """A message to a robot of one of the others in this run; `Contradiction` for anything else."""
    try:
        message = _DECODER.decode(data)
    except (msgspec.DecodeError, RecursionError) as error:
        raise Contradiction(f"this is no message of a robot: {error}") from None
    if message.by not in others:
        raise Contradiction("this robot is not one of ours")
    if message.run != run:
        raise Contradiction(f"{message.by} does another task, or with other words")
    if strange := (message.logs.keys() | message.knows.keys()) - {robot, *others}:
        raise Contradiction(f"{message.by} tells of a robot that there is not: {min(strange)}")
    return message


@dataclass(slots=True)
class Agreement:
    """How far one robot has come in agreeing with the ``others`` on a sentence, by three messages.

    Propose: of the robots that have wishes the one with the least name proposes the sentence that
    it likes best; if nobody has any, the one with the least name of all.  Answer: every other one
    accepts, or answers with its own wishes if the sentence does not grant them.  Agreed: what was
    proposed if all accept, else the best sentence by the proposer's own wishes and, where these
    leave a choice, by those of the others in the order of their names.

    ``sentence`` is what was agreed on, or given from outside; None before that.  ``best`` gives the
    best sentence by wishes in order of weight, ``grants`` says whether a sentence grants wishes.
    """

    robot: str
    others: Sequence[str]
    sentence: str | None
    wishes: tuple[str, ...]
    best: Callable[[Sequence[str]], str]
    grants: Callable[[str, Sequence[str]], bool]
    _proposal: str | None = None
    _answer: Reply | None = None
    _heard: dict[str, Message] = field(default_factory=dict)
    _said: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._said = self.said()

    def check(self, message: Message) -> None:
        """Raise `Refuted` if another robot follows another sentence."""
        if message.sentence is not None and self.sentence not in (None, message.sentence):
            what = f'{message.by} follows "{message.sentence}", {self.robot} "{self.sentence}"'
            raise Refuted(what, remedy="Give all robots one SENTENCE, or none.")

    def hears(self, message: Message) -> None:
        """Take in what another robot says, where that is no contradiction."""
        self._heard[message.by] = message
        self.sentence = self.sentence or message.sentence

    def advance(self) -> bool:
        """Propose, answer or agree, if it can be done now; whether there is something to say."""
        if self.sentence is None and len(self._heard) == len(self.others):
            self._talk()
        before, self._said = self._said, self.said()
        return self._said != before

    def _talk(self) -> None:
        speakers = [name for name, message in self._heard.items() if message.speaks]
        if self.wishes:
            speakers.append(self.robot)
        proposer = min(speakers or [self.robot, *self.others])
        if proposer == self.robot:
            self._propose()
        else:
            self._reply(self._heard[proposer].proposes)

    def _propose(self) -> None:
        """Propose the best sentence, and agree on one when all have answered."""
        if self._proposal is None:
            self._proposal = self.best(self.wishes)
        answers = [self._heard[name].answer for name in sorted(self.others)]
        given = [reply for reply in answers if reply and reply.sentence == self._proposal]
        if len(given) == len(self.others):
            further = [wish for reply in given for wish in reply.wishes]
            self.sentence = self.best([*self.wishes, *further]) if further else self._proposal

    def _reply(self, proposed: str | None) -> None:
        """Accept what was proposed, or answer with own wishes, once."""
        answered = self._answer.sentence if self._answer else None
        if proposed is not None and proposed != answered:
            is_granted = self.grants(proposed, self.wishes)
            self._answer = Reply(proposed, () if is_granted else self.wishes)

    def said(self) -> dict[str, Any]:
        """What a message of this robot says of it."""
        return {
            "sentence": self.sentence,
            "speaks": bool(self.wishes),
            "proposes": self._proposal,
            "answer": self._answer,
        }
