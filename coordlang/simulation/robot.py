# SPDX-License-Identifier: GPL-3.0-or-later
"""A robot's own logic: which subaction it chooses, when it begins a step, how it drives.

It knows the map, its own choices under the sentence (a monitor), where its own subactions lead,
and what its sensors and the other robots' messages tell it.  It never sees the plan of another
robot, nor the simulator: this module and those that it imports need the standard library and the
monitor only.  Numbers and texts are all that goes in and out, and what its lidar is asked for.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from random import Random
from typing import Literal

from coordlang.execution.monitor import EventMonitor, Monitor, NotPossible, drawn

Kind = Literal["step", "word", "ended", "ready"]

#: Ways in which all robots turn in the same time before they drive, and idle without time.
_COMMON = ("clock", "barrier")
#: Seconds by which times may differ that are the same: sums of ticks.
_SAME = 1e-6


@dataclass(frozen=True, slots=True)
class Notice:
    """What a robot tells all others: that it has done so many steps, or come to this word.

    ``number`` counts steps from 1 (``step``), or is the index of a word in the sentence (``word``).
    Without steps that its event with this number has ended, or is ready for its partners, and which
    ``subaction`` it is.
    """

    sender: str
    kind: Kind
    number: int
    subaction: str = ""


#: How many words of the sentence are passed at most after own subactions, whatever others choose.
OwnWords = Callable[[Sequence[str | None]], int]
#: Metres x, metres y, heading in radians (0: to the right, counterclockwise).
Pose = tuple[float, float, float]
#: Metres a second ahead, radians a second to the left.
Velocity = tuple[float, float]

#: Metres from a robot's middle to the first thing in its way; infinite where there is none.
Look = Callable[[], float]

#: What is worth recording: the kind of a `coordlang.simulation.record.EventRecord`, and further
#: fields of it.
Event = tuple[str, Mapping[str, object]]

STANDING: Velocity = (0.0, 0.0)

#: The greatest of a robot's wheels: metres a second ahead, radians a second on the spot.
SPEED, TURN = 1.0, 3.0
#: Seconds between two looks at sensors and commands to wheels.
TICK = 0.1
#: A robot drives so slowly that it would come too near to something only after three ticks: two
#: robots that come head on take at most two thirds of what is between them in a tick, and so never
#: touch.
_REACTION = 3 * TICK
#: Gains in 1/s: velocity per metre or radian that is left.
_GAIN = 4.0
#: Headings are right within this, in radians, and places are reached within this share of the cell.
_ALIGNED, _ARRIVED = 0.06, 0.05
#: What turning and driving take longer than at full speed, in seconds: slowing down, and noise.
_SLACK = 0.8
#: The time in which every turn on the spot is done: half a turn, and some slack.
_TURNING = math.pi / TURN + _SLACK


def period(longest: float) -> float:
    """The time of a joint step whose longest way has this length, in whole ticks."""
    return round(math.ceil((_TURNING + (longest / SPEED + _SLACK)) / TICK) * TICK, 6)


@dataclass(frozen=True, slots=True)
class OwnStep:
    """A robot's step or event: its number from 0, the subaction (None: idle), times in seconds.

    ``place`` is where it leads, None for a step in which the robot stays; ``end`` is None while it
    is under way.  ``words`` of the sentence are passed then, at most; None without a sentence.
    """

    number: int
    subaction: str | None
    place: str | None
    begin: float
    end: float | None = None
    words: int | None = None


@dataclass(slots=True)
class Robot:
    """One robot, which keeps step with all others in a ``way``, as ``--step`` has it.

    - ``clock``: step k begins k periods after the start, by a clock that all robots have.
    - ``barrier``: step k begins when every robot has told that it has done k steps.
    - ``word``: a robot goes on as soon as it has done a step.  Only where the next word may have
      begun it tells so, and waits until every robot has.
    - ``passings``: there are no steps.  A robot starts an event when those of others that it waits
      for have ended, which they tell if it matters to somebody, and so that they are ready for a
      meeting.

    A ``period`` is in seconds; ``heard`` is how far each robot has told to be, 0 at the start.
    ``radius`` is its own, in metres.  It follows ``monitor``, its choices, and draws among them
    with ``random``.  ``points`` are the places in metres, ``leads`` the place that each own
    subaction leads to, if it leads anywhere.  ``own_words`` says how far in the sentence own
    subactions may lead; None where no sentence is agreed.  ``wishes`` are the atoms that it comes
    to want to visit when it has done so many steps.  It has ``done`` so many ``steps``, and passed
    so many ``words`` of the sentence at most, by its own account.  ``messages`` are for all robots,
    ``events`` worth recording; whoever reads them takes them away.
    """

    name: str
    radius: float
    points: Mapping[str, tuple[float, float]]
    leads: Mapping[str, str]
    monitor: Monitor
    own_words: OwnWords | None
    way: str
    period: float
    heard: dict[str, int]
    random: Random
    wishes: dict[int, list[str]]
    steps: list[OwnStep] = field(default_factory=list)
    done: int = 0
    words: int = 0
    _is_turning: bool = False
    messages: list[Notice] = field(default_factory=list)
    events: list[Event] = field(default_factory=list)
    #: The event that it has chosen and not started, where there are no steps.
    _chosen: str | None = None
    #: Beginnings missed, the step in which it was stopped.
    _missed: int = 0
    _stopped_in: int = -1

    def subplan(self) -> list[str | None]:
        """What it chose, and would choose in the steps that it has not begun."""
        ahead, random = self.monitor.copy(), Random()
        random.setstate(self.random.getstate())
        chosen = [step.subaction for step in self.steps]
        if self._is_underway:
            ahead.did(chosen[-1])
        if self._chosen is not None:
            chosen.append(self._chosen)
            ahead = ahead.after(self._chosen)
        while not ahead.finished:
            chosen.append(drawn(ahead, random, ahead.allowed()))
            ahead = ahead.after(chosen[-1])
        return chosen

    def act(self, time: float, pose: Pose, look: Look | None, heard: Sequence[Notice]) -> Velocity:
        """Take a tick: hear, go on with the step under way or begin the next one, and drive.

        ``time`` are seconds since the start, ``pose`` is where it believes to be; it has a lidar to
        ``look`` ahead with, or none.  ``heard`` are the messages of the tick before.
        """
        for notice in heard:
            self._hears(notice)
        if not self._is_underway:
            self._heed_wishes()
            if not self._begins(time):
                return STANDING
        step = self.steps[-1]
        if step.place is None:
            has_ended = self.way in _COMMON or time >= step.begin + self.period
        else:
            has_ended = math.dist(pose[:2], self.points[step.place]) < _ARRIVED
        if has_ended:
            self._finish(step, time)
        if has_ended or step.place is None:
            return STANDING
        return self._driven(self.points[step.place], time - step.begin, pose, look)

    def _begins(self, time: float) -> bool:
        """Begin the next step now, if there is one and nothing keeps it back."""
        if self.monitor.finished or not self._may_begin(time):
            return False
        if isinstance(self.monitor, EventMonitor):
            chosen = self._started(self.monitor)
            if chosen is None:
                return False
        else:
            chosen = drawn(self.monitor, self.random, self.monitor.allowed())
        place = self.leads.get(chosen) if chosen is not None else None
        self.steps.append(OwnStep(self.done, chosen, place, time))
        self._is_turning = place is not None
        missed = round(time / self.period) - self.done if self.way == "clock" else 0
        if missed > self._missed:
            self.events.append(("missed", {}))
        self._missed = missed
        return True

    def _may_begin(self, time: float) -> bool:
        """Whether a step may begin.  By the clock, who is late misses a beginning."""
        if self.way == "clock":
            begun = self.steps[-1].begin if self.steps else -1.0
            return abs(math.remainder(time, self.period)) < _SAME and begun < time
        own = {"barrier": self.done, "word": self.words}.get(self.way, 0)
        return all(heard >= own for heard in self.heard.values())

    def _heed_wishes(self) -> None:
        """Commit to what is wanted from now on, where its choices allow it."""
        for atom in () if self.monitor.finished else self.wishes.pop(self.done, ()):
            granted = bool(self.monitor.can(visit=atom))
            if granted:
                self.monitor.commit(visit=atom)
            self.events.append(("detour", {"visit": atom, "granted": granted}))

    @property
    def _is_underway(self) -> bool:
        return bool(self.steps) and self.steps[-1].end is None

    def _hears(self, notice: Notice) -> None:
        name, monitor = notice.sender, self.monitor
        self.heard[name] = max(self.heard[name], notice.number)
        if not isinstance(monitor, EventMonitor) or name == self.name:
            return
        try:
            if notice.kind == "ended":
                monitor.ended(name, notice.subaction, notice.number)
            else:
                monitor.ready(name, notice.subaction, notice.number)
        except NotPossible:  # they have agreed on nothing
            self.events.append(("contradicted", {}))

    def _started(self, monitor: EventMonitor) -> str | None:
        """The event that starts now, of those that are free; None: there is none, or it waits."""
        if self._chosen is None and (free := monitor.free()):
            self._chosen = drawn(monitor, self.random, free)
            if self._chosen is None:
                monitor.did(None)
            elif monitor.partners(self._chosen):
                self._tell("ready", self.done + 1, monitor.subaction(self._chosen))
        if self._chosen is None or monitor.missing(self._chosen):
            return None
        event, self._chosen = self._chosen, None
        monitor.start(event)
        return event

    def _tell(self, kind: Kind, number: int, subaction: str = "") -> None:
        self.messages.append(Notice(self.name, kind, number, subaction))

    def _finish(self, step: OwnStep, time: float) -> None:
        before, words = self.words, None
        if self.own_words is not None:
            words = self.own_words([own.subaction for own in self.steps])
            self.words = words = max(before, words)
        self.steps[-1] = replace(step, end=time, words=words)
        self.done += 1
        self.monitor.did(step.subaction)
        if isinstance(self.monitor, EventMonitor):
            if step.subaction and self.monitor.concerns(step.subaction):
                self._tell("ended", self.done, self.monitor.subaction(step.subaction))
        elif self.way == "barrier":
            self._tell("step", self.done)
        elif self.way == "word" and self.words > before:
            self._tell("word", self.words)
            self.events.append(("word", {}))

    def _driven(
        self, target: tuple[float, float], since: float, pose: Pose, look: Look | None
    ) -> Velocity:
        """Turn on the spot, then drive, steering; slower where it is near or not straight ahead.

        Where all begin together, all drive off together, so many seconds ``since`` they began.
        """
        x, y, heading = pose
        angle = math.remainder(math.atan2(target[1] - y, target[0] - x) - heading, 2 * math.pi)
        turn = max(-TURN, min(TURN, _GAIN * angle))
        if self._is_turning:
            waits = self.way in _COMMON and since < _TURNING
            if waits or abs(angle) >= _ALIGNED:
                return 0.0, turn
            self._is_turning = False
            if look is not None:  # it looks while it drives
                return STANDING
        room = ((look() if look else math.inf) - (self.radius + 0.03)) / _REACTION
        if room <= 0 and self._stopped_in != self.done:
            self._stopped_in = self.done
            self.events.append(("stopped", {}))
        ahead = _GAIN * math.dist((x, y), target) * max(0.0, math.cos(angle))
        return max(0.0, min(ahead, SPEED, room)), turn
