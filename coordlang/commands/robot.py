# SPDX-License-Identifier: GPL-3.0-or-later
"""``coordlang robot``: one robot's executive, a process of its own."""

from __future__ import annotations

import json
import math
import os
import sys
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from hashlib import sha256
from random import Random
from select import select  # which takes files, too
from time import monotonic, time
from typing import Any, NoReturn

from coordlang.commands.inputs import Arguments, coordinates_of, public, wishes_in
from coordlang.commands.records import RobotOptions
from coordlang.commands.terminal import echo
from coordlang.execution.best_sentence import Preference, best_sentence, grants, read_preference
from coordlang.execution.bus import Bus, opened
from coordlang.execution.choices import choices, monitor
from coordlang.execution.executive import Executive
from coordlang.execution.fleet_log import Agreement
from coordlang.execution.monitor import EventMonitor
from coordlang.execution.task_language import InTask, TaskLanguage
from coordlang.language.file import to_data
from coordlang.language.provenance import domain_sha256
from coordlang.sites.coordinates import Point
from planners.system.errors import BadInput, Refuted, UsageError

#: Seconds until what could not be sent is sent again.
_AGAIN = 0.005
#: How fast a robot is played, in metres a second.
SPEED = 10.0
#: Bytes that are read of the driver at once.
_CHUNK = 1 << 16
#: A played event takes up to this part less or more than its way needs, and now and then so many
#: times that long; before the next one the robot rests for this part of a metre's time.
_UNEVEN, _LATE, _REST = 0.5, 5.0, 0.3
_HOW_OFTEN_LATE = 0.1


@dataclass(frozen=True, slots=True, repr=False)
class RobotInTask(InTask):
    """One robot in a task under a language, ready to act: ``executive`` says what it may start.

    ``run`` names what robots must have alike to hear each other, ``points`` are where places lie.
    """

    used: TaskLanguage
    executive: Executive
    run: str
    points: Mapping[str, Point]
    shown = ("run",)

    def act(
        self,
        options: RobotOptions,
        write: Callable[[Mapping[str, Any]], None],
        speed: float = SPEED,
    ) -> None:
        """Act until its part is done and nobody needs it; ``write`` is given each line.

        One that is played moves with ``speed``, in metres a second.  Raises `UsageError` if the bus
        cannot be opened, and `BadInput` if stdin, which says what is done, ends too early.
        """
        own, robots = self.executive, self.used.model.robots
        own.life = int(time() * 1e6)
        player = None
        if options.play is not None:
            own.random = Random(f"{options.play} {own.robot}")
            player = Player(own.random, self.points, speed)
        with closing(opened(options.bus, self.run, own.robot, robots)) as bus:
            stdin = [] if sys.stdin is None or sys.stdin.closed else [sys.stdin.fileno()]
            _Loop(own, bus, player, write, stdin).run()


@public(RobotOptions)
def robot(files: Arguments, options: RobotOptions) -> RobotInTask:
    """Prepare one robot's executive in a task.

    Raises `UsageError` for a robot that there is not, for words in step, and for a sentence and
    wishes at once; `Refuted` where the language guarantees nothing; `NoPlanFits` and `BadInput` for
    a sentence that is none.
    """
    sentence = files.values.get("SENTENCE")
    if sentence is not None and options.prefer:
        raise UsageError("--prefer: the sentence is given", remedy="Leave out one of the two.")
    used = files.task(options.coordinates)
    robots = used.model.robots
    number = used.robot_number(options.robot)
    if not used.model.is_asynchronous:
        raise UsageError(
            "the words are for joint steps, and a process keeps no common step",
            remedy="Build with --asynchronous.",
        )
    if not used.guaranteed:
        raise Refuted("the language guarantees nothing in this task", remedy="Build one for it.")
    if sentence is not None:
        words = used.words_of(sentence)
        used.plans_with(words)
        sentence = used.text(words)
    wishes = wishes_in(options.prefer)

    def wanted(wished: Sequence[str]) -> list[Preference]:
        return [read_preference(used, wish) for wish in wished]

    def best(wished: Sequence[str]) -> str:
        return used.text(best_sentence(used, wanted(wished or ("most-plans",))).words)

    def accepts(proposed: str, wished: Sequence[str]) -> bool:
        return grants(used, used.words_of(proposed), wanted(wished))

    def monitor_of(agreed: str) -> EventMonitor:
        found = choices(used, used.words_of(agreed))
        own = monitor(found.fits, found.robots[number], agreed)
        assert isinstance(own, EventMonitor)
        return own

    wanted(wishes)  # what is wrong with them is said now
    run = _run_of(used, options.run)
    others = robots[:number] + robots[number + 1 :]
    agreement = Agreement(options.robot, others, sentence, wishes, best, accepts)
    executive = Executive(run, agreement, monitor_of, options.silent_after)
    points = coordinates_of(options.coordinates, used.declared[1])
    return RobotInTask(used, executive, run, points)


def _run_of(used: TaskLanguage, name: str | None) -> str:
    """A name of what all robots must have alike: domain, problem, language, and any given name."""
    data = {key: value for key, value in to_data(used.language).items() if key != "producer"}
    (domain, problem), any_name = used.declared, [] if name is None else [name]
    same = [domain_sha256(domain), problem.source.sha256, data, *any_name]
    return sha256(json.dumps(same, sort_keys=True).encode()).hexdigest()[:16]


def show_robot(found: RobotInTask, options: RobotOptions) -> NoReturn:
    """Act, and print each line at once; then end the process."""
    found.act(options, lambda line: echo(json.dumps(line)))
    # At once: nobody is left to ask for one that is killed while Python tidies up.
    os._exit(0)


@dataclass(slots=True)
class _Loop:
    """Carries lines and messages between an executive, its driver, its bus, and the time.

    ``stdin`` has the file number of stdin until that has ended, ``unread`` what it has begun.
    """

    own: Executive
    bus: Bus
    player: Player | None
    write: Callable[[Mapping[str, Any]], None]
    stdin: list[int]
    unread: bytes = b""
    # The greatest: between the two calls this process may have had to wait for milliseconds.
    since: float = field(default_factory=lambda: max(time() - monotonic() for _ in range(5)))

    @property
    def _now(self) -> float:
        """Seconds since the epoch, that never go back."""
        return self.since + monotonic()

    def run(self) -> None:
        """Until nobody needs the robot any more, and all that it had to say is sent."""
        is_sent = False
        while not (is_sent and self.own.may_leave(self._now)):
            due = min(self.own.due(), math.inf if self.player is None else self.player.due)
            wait = max(0.0, due - self._now)
            self._hears(wait if is_sent else _AGAIN)
            self.own.tick(self._now)
            if self.player is not None:
                self.player.act(self.own, self._now)
            is_sent = self._tells()
            if not self.stdin and self.player is None and not self.own.is_done:
                raise BadInput(
                    "stdin ended before the robot's part was done",
                    remedy='It says what is done: {"event": 1, "done": true}; or use --play.',
                )

    def _hears(self, wait: float) -> None:
        """Hear the driver and the other robots, as soon as one says something, or after a while."""
        ready, _, _ = select([self.bus.fileno(), *self.stdin], [], [], wait)
        for file in {*ready} & {*self.stdin}:
            self._hears_driver(file)
        try:
            for data in self.bus.receive():
                self.own.hears(data, self._now)
        except Refuted:
            self._tells()  # so that others end, too
            raise

    def _tells(self) -> bool:
        """Write lines, then messages: what others know of was told to the driver before."""
        lines, self.own.lines = self.own.lines, []
        for line in lines:
            self.write(line)
        unsent = [to for to, data in self.own.messages() if not self.bus.send(to, data)]
        return not [to for to in unsent if self.own.unsent(to)]

    def _hears_driver(self, file: int) -> None:
        try:
            read = os.read(file, _CHUNK)
        except OSError:  # it cannot be read, or its terminal is closed
            read = b""
        if not read:
            self.stdin = []
            read = b"\n"  # that its last line may lack
        *lines, rest = (self.unread + read).split(b"\n")
        self.unread = rest[:_CHUNK]  # nothing so long can be true
        for line in lines:
            if line.strip():
                self.own.reads(line.decode(errors="replace"), self._now)


class Player:
    """Plays a robot: an event takes as long as its way at some speed, and random delays.

    ``points`` are the places in metres; what leads nowhere counts as one metre.
    """

    def __init__(self, random: Random, points: Mapping[str, Point], speed: float) -> None:
        self._random, self._points, self._speed = random, points, speed
        self._number = 0
        #: When it has something to do.
        self.due = math.inf

    def act(self, own: Executive, now: float) -> None:
        """Begin or end the event that is under way, if it is time."""
        if own.underway is None:
            return
        number, subaction = own.underway
        if number != self._number:
            self._number, self.due = number, now + self._seconds(subaction)
        if now < self.due:
            return
        self.due = math.inf
        own.lines.append({"event": number, "done": subaction, "time": now})
        own.holds_until = now + self._random.expovariate(1 / (_REST / self._speed))
        own.reads(json.dumps({"event": number, "done": subaction}), now)

    def _seconds(self, subaction: str) -> float:
        names = subaction.strip("()").split()
        places = [self._points[name] for name in names if name in self._points]
        metres = math.dist(places[0], places[-1]) if len(places) > 1 else 1.0
        times = self._random.uniform(1 - _UNEVEN, 1 + _UNEVEN)
        if self._random.random() < _HOW_OFTEN_LATE:
            times *= _LATE
        return metres * times / self._speed
