# SPDX-License-Identifier: GPL-3.0-or-later
"""Executives of robots over a network that delays, drops, doubles and reorders what they say.

Time is a number here: nothing waits.  Whatever happens, events that interfere do not overlap, what
all did together is an optimal plan, and all end.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Callable, Sequence
from heapq import heappop, heappush
from itertools import count
from random import Random
from typing import Any

import pytest

from coordlang.execution.agreement import Agreement
from coordlang.execution.choices import SentenceChoices, choices, to_bytes
from coordlang.execution.executive import Executive
from coordlang.execution.fleet_log import Contradiction, Event, LogPart, RobotLog, Version
from coordlang.execution.monitor import EventMonitor
from coordlang.language.partition import Partition
from tests.coordlang.execution.test_event_monitor import LIFT, turning_round
from tests.support.asynchronous import World, random_plans, texts
from tests.support.task_languages import in_words

SILENT_AFTER = 5.0


class Fleet:
    """Executives, their drivers, and what is on its way between them.

    ``running`` is the event under way of each robot, as its driver sees it, ``did`` are all that
    its driver has done.  With ``kills`` one executive after another is lost at some time, with
    all that it has not said, and comes back later.
    """

    def __init__(
        self, found: SentenceChoices, world: World, random: Random, faults: float, kills: int
    ) -> None:
        self.data, self.world, self.random, self.faults = (
            json.loads(to_bytes(found)),
            world,
            random,
            faults,
        )
        self.names: Sequence[str] = world.model.robots
        self.now, self.order, self.queue = (
            0.0,
            count(),
            list[tuple[float, int, Callable[[], None]]](),
        )
        self.at: dict[str, Executive] = {}
        self.wakes: dict[str, float] = {}
        self.logs: dict[str, tuple[str, ...]] = {}
        self.left: set[str] = set()
        self.running: dict[str, str] = {}
        self.did: dict[str, list[str]] = {name: [] for name in self.names}
        self.seen: Counter[str] = Counter()
        for name in self.names:
            self.later(random.random(), self.starter(name))
        for _ in range(kills):
            self.later(random.uniform(0.5, 6), self.kill)

    def later(self, delay: float, do: Callable[[], None]) -> None:
        heappush(self.queue, (self.now + delay, next(self.order), do))

    def starter(self, name: str) -> Callable[[], None]:
        def start() -> None:
            others = [other for other in self.names if other != name]
            words = self.data["sentence"]
            self.at[name] = Executive(
                name,
                others,
                "this run",
                Agreement(name, others, words, (), lambda _: words, lambda *_: True),
                lambda _: EventMonitor(self.data, name),
                SILENT_AFTER,
            )
            self.at[name].life, self.at[name].random = self.random.getrandbits(40), self.random
            self.after(name, lambda own: own.tick(self.now))

        return start

    def kill(self) -> None:
        """Unless another one is not back yet, or all are done: then nobody would tell it later."""
        if len(self.at) < len(self.names) or any(o._monitor is None for o in self.at.values()):
            return
        if all(own.is_done for own in self.at.values()):
            return
        name = self.random.choice(sorted(self.at))
        del self.at[name]
        self.seen["killed"] += 1
        self.later(self.random.uniform(0, 2 * SILENT_AFTER), self.starter(name))

    def after(self, name: str, do: Callable[[Executive], None]) -> None:
        """What an executive does, then its lines, then its messages, as the loop does it."""
        own = self.at.get(name)
        if own is None:
            return
        do(own)
        lines, own.lines = own.lines, []
        for line in lines:
            self.line(name, line)
        for to, data in own.messages():
            self.send(name, to, data)
        self.logs[name] = tuple(event.name for event in own._own.events)
        if own.may_leave(self.now):
            del self.at[name]
            self.left.add(name)
        else:
            wake = max(own.due(), self.now + 0.01)
            if not self.now < self.wakes.get(name, 0.0) <= wake:
                self.wakes[name] = wake
                self.later(wake - self.now, lambda: self.after(name, lambda o: o.tick(self.now)))

    def send(self, name: str, to: str, data: bytes) -> None:
        self.seen["messages"] += 1
        if self.random.random() < self.faults:
            self.seen["lost"] += 1
            if self.random.random() < 0.5:
                self.at[name].unsent(to)
            return
        for _ in range(1 + (self.random.random() < self.faults)):
            delay = self.random.expovariate(20)
            self.later(delay, lambda: self.after(to, lambda own: own.hears(data, self.now)))

    def line(self, name: str, line: dict[str, Any]) -> None:
        assert "refused" not in line, line
        self.seen.update(line.keys() & {"silent", "heard", "finished"})
        again = line.get("underway", line.get("start"))
        if again and line["event"] == len(self.did[name]):  # what its driver said was lost with it
            assert again == self.did[name][-1]
            self.later(0.01, self.ender(name, line["event"], again))
            self.seen["end told again"] += 1
            return
        if "start" not in line:
            return
        subaction = line["start"]
        if name in self.running:  # told again after a restart
            assert (line["event"], subaction) == (len(self.did[name]) + 1, self.running[name])
            self.seen["told again"] += 1
            return
        assert line["event"] == len(self.did[name]) + 1
        robot = self.names.index(name)
        met = line.get("with", ())
        for other, its in self.running.items():
            if other not in met:
                at = self.names.index(other)
                assert not self.world.interfere(
                    robot, self.label(robot, subaction), at, self.label(at, its)
                ), "they overlap"
        self.running[name] = subaction
        self.later(self.random.expovariate(1), self.ender(name, line["event"], subaction))

    def label(self, robot: int, subaction: str) -> int:
        model = self.world.model
        return next(
            n
            for n in range(len(model.labels[robot]))
            if model.subaction_text(robot, n) == subaction
        )

    def ender(self, name: str, number: int, subaction: str) -> Callable[[], None]:
        """The driver ends the event, and says so as soon as its executive is there."""

        def end() -> None:
            if name in self.running and number == len(self.did[name]) + 1:
                self.did[name].append(self.running.pop(name))
            if name in self.left:
                return
            own = self.at.get(name)
            if own is not None and own.underway == (number, subaction):
                done = json.dumps({"event": number, "done": subaction})
                self.after(name, lambda own: own.reads(done, self.now))
            elif own is None or own._monitor is None:
                self.later(0.5, end)

        return end

    def run(self) -> tuple[tuple[str, ...], ...]:
        """Until all have left: the names of the events that each robot did, as it knows them."""
        for _ in range(40_000):
            if len(self.left) == len(self.names) or not self.queue:
                break
            self.now, _, do = heappop(self.queue)
            do()
        waiting = {
            name: (own._own.version, own._monitor is not None, own.underway, self.did[name])
            for name, own in self.at.items()
        }
        assert self.left == {*self.names}, f"at {self.now} somebody waits for ever: {waiting}"
        assert not self.running
        return tuple(self.logs[name] for name in self.names)


RUNS = [(2, range(40)), (3, range(10))]
THOROUGH = [(2, range(40, 400)), (3, range(10, 200)), (4, range(40))]
SEEDS = [*RUNS, *(pytest.param(*run, marks=pytest.mark.thorough) for run in THOROUGH)]


@pytest.mark.parametrize(("robots", "seeds"), SEEDS)
def test_all_arrive_whatever_the_network_does_and_whoever_is_killed(
    robots: int, seeds: range
) -> None:
    seen: Counter[str] = Counter()
    for world, space, plans, made, random in random_plans(robots, seeds, 40):
        word = {state: random.randrange(2) for state in range(len(space.rows))}
        table = Partition.of_states(space.rows, word)
        word = dict(enumerate(table.word_of(space.rows).tolist()))
        own = in_words(None, table, made, 0)
        optimal = {texts(world.model, parts) for parts in plans.states}
        for words in plans.by_sentence(word):
            found = choices(own, words)
            if not found.guaranteed:
                continue
            faults, kills = random.choice([0.0, 0.2]), random.randrange(5)
            fleet = Fleet(found, world, random, faults, kills)
            assert fleet.run() in optimal
            seen += fleet.seen
            seen["runs"] += 1
    print(f"{robots} robots: {dict(seen)}")
    assert min(seen["runs"], seen["killed"], seen["lost"], seen["silent"], seen["heard"]) >= 5
