# SPDX-License-Identifier: GPL-3.0-or-later
"""One robot's executive: when it starts which event, by what it hears of the others.

An `Executive` does no input and output and never waits: it is told lines of its driver, messages of
the other robots and the time, and leaves lines and messages to be written.  It keeps no common step
with the others.  What makes it safe is that of another robot only *ended* events count; all else
here is about losing nothing:

- A robot begins when it has heard of every other one, and knows of itself what they know.
- An event is begun when another robot has confirmed that it knows of it, and only then the driver
  is told.  So a robot that is started again learns from the others where it is.
- Who has finished stays until all have, to be asked.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import reduce
from random import Random
from typing import Any

import msgspec

from coordlang.execution.fleet_log import (
    Agreement,
    Contradiction,
    Event,
    LogPart,
    Message,
    RobotLog,
    Version,
    decoded,
)
from coordlang.execution.monitor import EventMonitor, MonitorError, NotPossible, drawn, plain_text
from planners.system.errors import Refuted

#: In the time after which a robot counts as silent each one is heard so often, if it has nothing
#: else to tell.
_BEATS = 4
#: Who is done waits so many times that long for a silent robot to come back.
_PATIENCE = 6
#: Seconds that a robot may be late.
_LATEST = 1e9
#: Parts of a wish, as `Monitor.can` names them.
_DETOURS = frozenset({"visit", "avoid", "do", "never"})
#: Characters of a refused line that are shown, and different messages that are refused with a line.
_SHOWN, _REFUSED = 200, 100


class Executive:
    """One robot's executive.

    ``run`` names what all must have alike (domain, task and words), ``agreement`` the robot and the
    others, ``monitor_of`` has its choices under a sentence; after ``silent_after`` seconds a robot
    that says nothing is named to the driver.  ``lines`` are for the driver, oldest first; whoever
    writes them takes them away.  ``life`` is when this process began: greater than those of former
    processes of this robot, whose messages may still come.  ``random`` draws what to do; without it
    the robot does as little as it may, and keeps most open.  So many messages were ``sent``.
    """

    def __init__(
        self,
        run: str,
        agreement: Agreement,
        monitor_of: Callable[[str], EventMonitor],
        silent_after: float,
    ) -> None:
        self.robot, self.others = agreement.robot, agreement.others
        self.lines = list[dict[str, Any]]()
        self.life = self.sent = 0
        self._late_by: float | None = None
        self.random: Random | None = None
        #: Nothing begins before this time.
        self.holds_until = 0.0
        self._run, self._agreement = run, agreement
        self._monitor_of, self._silent_after = monitor_of, silent_after
        self._monitor: EventMonitor | None = None
        self._logs = {name: RobotLog() for name in (self.robot, *self.others)}
        self._own = self._logs[self.robot]
        #: What the monitor was told: own events that started and ended, and those of the others.
        self._started = 0
        self._counted = dict.fromkeys(self._logs, 0)
        #: The last message of each other robot: its process, what it has heard of and knows.
        self._last = {name: Message(run, name, 0) for name in self.others}
        self._heard_at: dict[str, float] = {}
        self._silent: set[str] = set()
        self._refused: set[str] = set()
        self._wishes: list[dict[str, Any]] = []
        self._to_tell = {*self.others}
        self._beat_at = 0.0
        self._has_finished = False

    # ---- what its driver and the loop see

    @property
    def is_done(self) -> bool:
        """Whether its part is done."""
        return self._own.version.is_done

    @property
    def underway(self) -> tuple[int, str] | None:
        """The number (from 1) and the subaction of the event that the driver does now."""
        version = self._own.version
        if version.told == version.ended:
            return None
        return version.told, self._own.events[version.ended].subaction

    def may_leave(self, now: float) -> bool:
        """Whether nobody needs it any more: all are done and know that all are, or seem lost."""
        patience = _PATIENCE * self._silent_after
        return self.is_done and all(
            now - self._heard_at[name] >= patience
            or (self._logs[name].version.is_done and not self._lacked_by(name))
            for name in self.others
        )

    def due(self) -> float:
        """When `tick` has something to do again."""
        waits = [at for name, at in self._heard_at.items() if name not in self._silent]
        silent = min(waits, default=self._beat_at) + self._silent_after
        held = [self.holds_until] if self.holds_until > 0 else []
        return min(self._beat_at, silent, *held)

    def tick(self, now: float) -> None:
        """Do what is due at this time."""
        if now >= self._beat_at:
            self._beat_at = now + self._silent_after / _BEATS
            self._to_tell |= {*self.others}
        for name in self.others:
            self._heard_at.setdefault(name, now)  # from the first tick on
            if name not in self._silent and now - self._heard_at[name] >= self._silent_after:
                self._silent.add(name)
                self._tell_of("silent", name, now)
        if 0 < self.holds_until <= now:
            self.holds_until = 0.0
        self._advance(now)

    # ---- the driver

    def reads(self, line: str, now: float) -> None:
        """Take in a line of the driver: what is done, a wish, or that it will be late."""
        try:
            said = json.loads(line)
            if not isinstance(said, dict):
                raise ValueError("expected an object")
            if "done" in said:
                self._ended(said)
            elif "wish" in said:
                self._wishes.append(_wish(said["wish"]))
            elif "late" in said:
                self._late(said["late"])
            else:
                raise ValueError("expected done, wish or late")
        except (ValueError, RecursionError) as error:
            self._refuse(line, str(error))
        self._advance(now)

    def _ended(self, said: Mapping[str, Any]) -> None:
        """The event under way has ended; `ValueError` for anything else."""
        if self.underway is None:
            raise ValueError("no event is under way")
        number, subaction = self.underway
        if said.get("event", number) != number:
            raise ValueError(f"event {number} is under way")
        if said["done"] is not True and plain_text(str(said["done"])) != subaction:
            raise ValueError(f"event {number} is {subaction}")
        self._own.advance(ended=number)
        self._to_tell |= {*self.others}

    def _late(self, seconds: Any) -> None:
        if type(seconds) not in {int, float} or not 0 <= seconds < _LATEST:
            raise ValueError("late: expected a number of seconds")
        self._late_by = float(seconds)
        self._to_tell |= {*self.others}

    def _refuse(self, what: str, why: str, by: Mapping[str, str] | None = None) -> None:
        """Refuse what its driver says; or a robot, but once, as it may come again and again."""
        if by is not None:
            if why in self._refused or len(self._refused) == _REFUSED:
                return
            self._refused.add(why)
        self.lines.append({"refused": what[:_SHOWN], **(by or {}), "why": why})

    # ---- the other robots

    def hears(self, data: bytes, now: float) -> None:
        """Take in a message of another robot; what cannot be true is refused.

        Raises `Refuted` if nothing has begun and the other one follows another sentence.
        """
        try:
            message = decoded(data, self._run, self.robot, self.others)
            if message.life < self._last[message.by].life:  # what a former process said
                return
            self._agreement.check(message)
            self._take_in(message, now)
            self._agreement.hears(message)
        except (Contradiction, Refuted) as error:
            if self._monitor is None and isinstance(error, Refuted):
                self._to_tell |= {*self.others}
                raise
            why = error.what if isinstance(error, Refuted) else str(error)
            self._refuse(data.decode(errors="replace"), why, {})
            return
        self._advance(now)

    def _take_in(self, message: Message, now: float) -> None:
        name, former = message.by, message.lives.get(self.robot, 0)
        if self._monitor is None and former > self.life:  # the clock has gone back since
            self.life = former + 1
        for of, part in message.logs.items():
            self._join(name, of, part)
        is_new = self._last[name].life != message.life
        self._last[name], self._heard_at[name] = message, now
        if name in self._silent:
            self._silent.discard(name)
            self._tell_of("heard", name, now)
        if message.late is not None:
            waits = self._monitor is not None and name in self._monitor.late()
            self.lines.append({"late": name, "seconds": message.late, "waiting": waits})
        if is_new or not self._has_heard_us(name) or self._lacked_by(name):
            self._to_tell.add(name)

    def _join(self, by: str, of: str, part: LogPart) -> None:
        """Take in a part of a log that another robot tells of."""
        log = self._logs[of]
        if log is self._own and self._monitor and log.version.lacks(part.version):
            raise Contradiction(f"{by} knows of more than {self.robot} has done")
        was_done = log.version.is_done
        if log.join(part):
            # All must know that all know who is done, before they leave.
            is_news = log.version.is_done and not was_done
            self._to_tell |= {*self.others} if is_news else {by}

    def _tell_of(self, what: str, name: str, now: float) -> None:
        """Tell the driver that a robot which is not done is silent, or was heard again."""
        if not self._logs[name].version.is_done:
            self.lines.append({what: name, "time": now})

    def _has_heard_us(self, name: str) -> bool:
        return self._last[name].lives.get(self.robot) == self.life

    def _version_by(self, name: str, of: str) -> Version:
        """How far another robot knows a log."""
        return self._last[name].knows.get(of, Version())

    def _lacked_by(self, name: str) -> dict[str, LogPart]:
        """What another robot lacks of logs and should be told.

        It is told this robot's own one, its own one if it was started again, and those of robots
        that may not speak themselves, as they are silent or have left.
        """
        told = {self.robot, name, *self._silent}
        return {
            of: log.part(known)
            for of, log in self._logs.items()
            if (of in told or log.version.is_done)
            and (known := self._version_by(name, of)).lacks(log.version)
        }

    def messages(self) -> Iterator[tuple[str, bytes]]:
        """What is to be sent now: robots and messages; `unsent` tells what could not be sent."""
        late, self._late_by = self._late_by, None
        names, self._to_tell = sorted(self._to_tell), set()
        lives = {name: message.life for name, message in self._last.items()}
        knows = {of: log.version for of, log in self._logs.items()}
        for name in names:
            who, said = (self._run, self.robot, self.life), self._agreement.said()
            self.sent += 1
            message = Message(*who, lives, knows, self._lacked_by(name), late=late, **said)
            yield name, msgspec.json.encode(message)

    def unsent(self, name: str) -> bool:
        """Tell that a message could not be sent; whether to send it again at once.

        A silent robot, which may have stopped for ever, gets the next beat.
        """
        if name not in self._silent:
            self._to_tell.add(name)
        return name not in self._silent

    # ---- its own events

    @property
    def _has_joined(self) -> bool:
        """Whether all have heard of this process, and it knows of itself what they know.

        But for those that were done, and have left as this one seemed lost.
        """
        return all(
            (
                self._has_heard_us(name)
                or (name in self._silent and self._logs[name].version.is_done)
            )
            and not self._own.version.lacks(self._version_by(name, self.robot))
            for name in self.others
        )

    def _advance(self, now: float) -> None:
        if self._agreement.advance():
            self._to_tell |= {*self.others}
        sentence = self._agreement.sentence
        if self._monitor is None and sentence is not None and self._has_joined:
            self._join_in(sentence, now)
        if self._monitor is not None:
            self._act(self._monitor, now)

    def _join_in(self, sentence: str, now: float) -> None:
        """Begin, or go on after a restart, with the choices under a sentence."""
        self._monitor = self._checked(self._monitor_of(sentence))
        self.lines.append({"sentence": sentence, "time": now})
        if self.underway is not None:  # before a restart; its end may be lost
            number, subaction = self.underway
            self.lines.append({"event": number, "underway": subaction, "time": now})

    def _act(self, monitor: EventMonitor, now: float) -> None:
        """Do all that can be done now."""
        while (
            self._heeds_wishes(monitor)
            or self._counts(monitor)
            or self._chooses(monitor)
            or self._begins(monitor)
        ):
            pass
        self._tells_driver(now)
        if self.is_done and not self._has_finished:
            self._has_finished = True
            self.lines.append({"finished": True, "time": now})

    def _checked(self, monitor: EventMonitor) -> EventMonitor:
        """The monitor; raises `Refuted` if it excludes what others know that this robot did."""
        try:
            at = reduce(EventMonitor.after, [event.name for event in self._own.events], monitor)
            if self.is_done and not at.finished:
                at.after(None)
        except MonitorError as error:
            what = f"others say that {self.robot} did what it may not do: {error}"
            raise Refuted(what, remedy="End all processes, and begin again.") from None
        return monitor

    def _heeds_wishes(self, monitor: EventMonitor) -> bool:
        """Promise what is wished, if its choices allow it, and no meeting is arranged."""
        if not self._wishes or self._started < len(self._own.events):
            return False
        wish = self._wishes.pop(0)
        try:
            answer = monitor.can(**wish)
            if answer:
                monitor.commit(**wish)
        except MonitorError as error:
            self._refuse(json.dumps({"wish": wish}), str(error))
        else:
            self.lines.append({"wish": wish, "granted": bool(answer), "subplans": answer.subplans})
        return True

    def _counts(self, monitor: EventMonitor) -> bool:
        """Tell the monitor what has started and ended; whether anything was new."""
        before = self._started, *self._counted.values()
        reasons = {name: self._counts_those_of(name, monitor) for name in self.others}
        own = self._own.version
        if self._started < own.begun and self._is_free(monitor, self._started):
            monitor.start(self._own.events[self._started].name)
            self._started += 1
        if (number := self._counted[self.robot]) < min(self._started, own.ended):
            monitor.did(self._own.events[number].name)
            self._counted[self.robot] += 1
        if (self._started, *self._counted.values()) != before:
            return True
        if self._started == own.begun:  # after a restart events may wait for own ones
            for name, reason in reasons.items():
                if reason is not None:
                    self._refuse("an event that ended", reason, {"from": name})
        return False

    def _counts_those_of(self, name: str, monitor: EventMonitor) -> str | None:
        """Tell the monitor what another robot has ended; why it takes no more, if so.

        Robots that meet start together, so the end of a meeting counts after its start, in whatever
        order messages come.
        """
        log = self._logs[name]
        while (number := self._counted[name]) < log.version.ended:
            event, met = log.events[number], len(self._own.meetings(name, self._started))
            if len(log.meetings(self.robot, number + 1)) > met:
                return None
            try:
                monitor.ended(name, event.subaction, number + 1)
            except NotPossible as error:
                return str(error)
            self._counted[name] += 1
        return None

    def _is_free(self, monitor: EventMonitor, number: int) -> bool:
        """Whether an own event (from 0) may start: nothing is missing, and its partners are ready.

        The n-th meeting with a robot is that robot's n-th one with this one.
        """
        event = self._own.events[number]
        for name in event.partners:
            met = len(self._own.meetings(name, number + 1))
            theirs = self._logs[name].meetings(self.robot)
            if len(theirs) < met:
                return False
            monitor.ready(name, theirs[met - 1].subaction)
        return not monitor.missing(event.name)

    def _chooses(self, monitor: EventMonitor) -> bool:
        """Choose the next event, or to do no more, when the last one has ended."""
        events = self._own.events
        if self.is_done or len(events) > self._counted[self.robot]:
            return False
        event = None
        if not monitor.finished:
            free = monitor.free()
            if not free:
                return False  # all that it may do waits for others
            event = self._choice(monitor, free)
            if event is None:
                monitor.did(None)
        if event is None:
            self._own.advance(is_done=True)
        else:
            events.append(Event(event, monitor.subaction(event), monitor.partners(event)))
            self._own.advance()
        if event is None or events[-1].partners:
            self._to_tell |= {*self.others}
        return True

    def _choice(self, monitor: EventMonitor, free: Sequence[str | None]) -> str | None:
        if self.random is not None:
            return drawn(monitor, self.random, free)
        if None in free:
            return None
        return max(
            (event for event in free if event is not None),
            key=lambda event: (not monitor.partners(event), monitor.after(event).remaining),
        )

    def _begins(self, monitor: EventMonitor) -> bool:
        version = self._own.version
        is_chosen = self._started == version.begun < len(self._own.events)
        if not is_chosen or self.holds_until > 0 or not self._is_free(monitor, version.begun):
            return False
        self._own.advance(begun=version.begun + 1)
        self._to_tell |= {*self.others}
        return True

    def _tells_driver(self, now: float) -> None:
        """Tell the driver what has begun, once another robot knows of it, if one is there."""
        version = self._own.version
        is_known = self._silent >= {*self.others} or any(
            self._version_by(name, self.robot).begun == version.begun for name in self.others
        )
        if version.told == version.begun or version.begun > self._started or not is_known:
            return
        event = self._own.events[version.begun - 1]
        line = {"event": version.begun, "start": event.subaction, "time": now}
        self.lines.append({**line, "with": list(event.partners)} if event.partners else line)
        self._own.advance(told=version.begun)


def _wish(wish: object) -> dict[str, Any]:
    """A wish as `EventMonitor.can` takes it; `ValueError` for anything else."""
    if not isinstance(wish, dict) or not wish or wish.keys() - _DETOURS:
        raise ValueError(f"a wish has some of {', '.join(sorted(_DETOURS))}")
    for texts in wish.values():
        several = texts if isinstance(texts, list) else [texts]
        if not all(isinstance(text, str) for text in several):
            raise ValueError("a wish holds texts such as (at r1 a)")
    return wish
