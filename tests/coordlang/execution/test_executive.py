# SPDX-License-Identifier: GPL-3.0-or-later
"""Executives of robots over a network that delays, drops, doubles and reorders what they say.

Time is a number here: nothing waits.  Whatever happens, events that interfere do not overlap, what
all did together is an optimal plan, and all end.
"""

from __future__ import annotations

import json
import re
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from heapq import heappop, heappush
from itertools import count
from random import Random
from types import MappingProxyType
from typing import Any
from unittest.mock import Mock

import pytest
from msgspec.json import encode

from coordlang.execution.choices import SentenceChoices, to_bytes
from coordlang.execution.executive import Executive
from coordlang.execution.fleet_log import (
    Agreement,
    Contradiction,
    Event,
    LogPart,
    Message,
    RobotLog,
    Version,
)
from coordlang.execution.monitor import EventMonitor
from planners.system.errors import Refuted
from tests.support import thorough
from tests.support.asynchronous import World, texts
from tests.support.events import (
    EITHER_WAY,
    EITHER_WAY_BOTH,
    LIFT,
    LIFT_TWICE,
    ONLY_R1,
    choices_in,
    random_choices,
    turning_round,
)

SILENT_AFTER = 5.0


def executive(data: dict[str, Any], name: str, life: int) -> Executive:
    """That of a robot with these choices, whose sentence is given."""
    others = [one["robot"] for one in data["choices"] if one["robot"] != name]
    words = data["sentence"]
    agreement = Agreement(name, others, words, (), lambda _: words, lambda *_: True)
    own = Executive("run", agreement, lambda _: EventMonitor(data, name), SILENT_AFTER)
    own.life = life
    return own


class Fleet:
    """Executives, their drivers, and what is on its way between them.

    ``running`` is the event under way of each robot, as its driver sees it, ``did`` are all that
    its driver has done.  With ``kills`` one executive after another is lost at some time, with
    all that it has not said, and comes back later.
    """

    def __init__(
        self, found: SentenceChoices, world: World, random: Random, faults: float, kills: int
    ) -> None:
        self.data, self.world = json.loads(to_bytes(found)), world
        self.random, self.faults = random, faults
        self.names: Sequence[str] = world.model.robots
        self.now, self.order = 0.0, count()
        self.queue: list[tuple[float, int, Callable[[], None]]] = []
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
            self.at[name] = executive(self.data, name, self.random.getrandbits(40))
            self.at[name].random = self.random
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
        self.seen["meets"] += "with" in line
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
        return self.world.model.labels[robot].index(subaction)

    def ender(self, name: str, number: int, subaction: str) -> Callable[[], None]:
        """The driver ends the event, and says so as soon as its executive is there."""

        def end() -> None:
            if name in self.running and number == len(self.did[name]) + 1:
                self.did[name].append(self.running.pop(name))
            if name in self.left:
                return
            own = self.at.get(name)
            if own is not None and own.underway == (number, subaction):
                done = json.dumps({"event": number, "done": subaction.upper().replace("(", " ( ")})
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


SEEDS = [(3, range(14)), *thorough((2, range(400)), (3, range(14, 200)), (4, range(40)))]


@pytest.mark.parametrize(("robots", "seeds"), SEEDS)
def test_all_arrive_whatever_the_network_does_and_whoever_is_killed(
    robots: int, seeds: range
) -> None:
    seen: Counter[str] = Counter()
    for world, plans, _, found, random in random_choices(robots, seeds):
        optimal = {texts(world.model, parts) for parts in plans.states}
        if not found.guaranteed:
            continue
        faults, kills = random.choice([0.0, 0.2]), random.randrange(5)
        fleet = Fleet(found, world, random, faults, kills)
        assert fleet.run() in optimal
        seen += fleet.seen
        seen["runs"] += 1
    assert min(seen[k] for k in ("runs", "killed", "lost", "silent", "heard")) >= 5, seen


def test_robots_that_meet_start_together_and_more_than_once() -> None:
    found = choices_in(LIFT, LIFT_TWICE)
    world = World(found.task_language.model)
    for seed in range(40):
        fleet = Fleet(found, world, Random(seed), 0.2 * (seed % 2), seed % 3)
        assert [len(did) for did in fleet.run()] == [2, 2, 2]
        assert fleet.seen["meets"] >= 6


class Pair:
    """Robots, two if nothing else is said, that hear each other at once, but for those ``apart``."""

    def __init__(self, found: SentenceChoices, *there: str) -> None:
        self.data = json.loads(to_bytes(found))
        self.at: dict[str, Executive] = {}
        self.apart: set[str] = set()
        for name in there:
            self.join(name, 1)

    def join(self, name: str, life: int) -> None:
        self.at[name] = executive(self.data, name, life)

    def tick(self, now: float) -> None:
        """All tick, and hear each other until nobody says anything."""
        for own in self.at.values():
            own.tick(now)
        while sent := [(by, *sent) for by, own in self.at.items() for sent in own.messages()]:
            for by, to, data in sent:
                if to in self.at and {by, to} != self.apart:
                    self.at[to].hears(data, now)

    def lines(self, name: str, key: str) -> list[Any]:
        """What its lines say under a key; they are taken away."""
        own = self.at[name]
        found = [line[key] for line in own.lines if key in line]
        own.lines = [line for line in own.lines if key not in line]
        return found

    def does(self, name: str, now: float) -> None:
        """The driver does what it was told last."""
        own = self.at[name]
        assert own.underway is not None
        own.reads(json.dumps({"event": own.underway[0], "done": own.underway[1]}), now)
        self.tick(now)


def test_nobody_starts_alone_and_a_silent_robot_is_named() -> None:
    pair = Pair(turning_round(), "r1")
    pair.tick(0)
    pair.tick(SILENT_AFTER)
    assert (pair.lines("r1", "start"), pair.lines("r1", "silent")) == ([], ["r2"])
    pair.join("r2", 1)
    pair.tick(SILENT_AFTER + 1)
    assert pair.lines("r1", "heard") == ["r2"]
    (first,) = pair.lines("r1", "start")
    pair.does("r1", 7)
    # r2 is killed in its first event: r1 waits, however long, and does not move into its way.
    (its,) = pair.lines("r2", "start")
    del pair.at["r2"]
    for now in range(8, 200, 2):
        pair.tick(now)
    assert (pair.lines("r1", "start"), pair.lines("r1", "silent")) == ([], ["r2"])
    assert not pair.at["r1"].may_leave(200)
    # It comes back, knows what is under way, and goes on with the next number.
    pair.join("r2", 2)
    pair.tick(201)
    assert (pair.lines("r2", "start"), pair.lines("r2", "underway")) == ([], [its])
    pair.does("r2", 202)
    assert [line["event"] for line in pair.at["r1"].lines if "start" in line] == [2]
    assert pair.lines("r1", "start") != [first]
    for name in ("r1", "r2"):
        pair.does(name, 203)
    assert pair.lines("r1", "finished") == pair.lines("r2", "finished") == [True]
    assert all(own.may_leave(203) for own in pair.at.values())


def test_who_is_done_stays_for_a_robot_that_is_not_and_leaves_if_it_does_not_come_back() -> None:
    pair = Pair(choices_in(EITHER_WAY, ONLY_R1), "r1", "r2")
    pair.tick(0)
    assert pair.at["r2"].is_done
    assert not pair.at["r2"].may_leave(0)
    del pair.at["r1"]
    pair.tick(SILENT_AFTER)
    assert pair.lines("r2", "silent") == ["r1"]
    assert not pair.at["r2"].unsent("r1")  # one that has stopped for ever holds nobody back
    assert not pair.at["r2"].may_leave(5 * SILENT_AFTER)
    assert pair.at["r2"].may_leave(6 * SILENT_AFTER)


def test_a_robot_that_comes_back_asks_who_is_done_too() -> None:
    """Perhaps nobody else knows what it has begun."""
    three = EITHER_WAY_BOTH.replace("r1 r2", "r1 r2 r3").replace("(there r2)", "(there r3)")
    fleet = Pair(choices_in(EITHER_WAY, three), "r1", "r2", "r3")
    fleet.at["r1"].holds_until = 1
    fleet.tick(0)
    fleet.apart = {"r1", "r3"}
    fleet.tick(1)
    assert fleet.lines("r1", "event") == [1]
    fleet.join("r1", 2)
    fleet.apart = {"r1", "r2"}
    fleet.tick(2)
    assert fleet.at["r1"]._logs["r2"].version.is_done
    assert fleet.lines("r1", "sentence") == []
    fleet.apart = set()
    fleet.tick(4)
    assert fleet.lines("r1", "event") == [1]
    # Who was done and has left is not waited for.
    fleet.join("r1", 3)
    fleet.apart = {"r1", "r2"}
    fleet.tick(5)
    fleet.tick(5 + SILENT_AFTER)
    assert fleet.lines("r1", "event") == [1]


@pytest.mark.parametrize("again", [["r1"], ["r1", "r2"]])  # then r2 has not heard of it before
def test_what_a_former_process_said_comes_too_late(again: Sequence[str]) -> None:
    pair = Pair(choices_in(EITHER_WAY, EITHER_WAY_BOTH), "r1", "r2")

    def chosen(now: float) -> bytes:
        """What r1 says as soon as it has chosen an event."""
        r1, r2 = pair.at.values()
        r1.tick(now)
        while not r1._own.version.begun:
            for by, to in ((r1, r2), (r2, r1)):
                for _, data in by.messages():
                    to.hears(data, now)
        return next(data for _, data in r1.messages())

    late = chosen(0)
    assert b"(go r1 a)" in late
    for name in again:
        pair.join(name, 2)
    pair.at["r1"].random = Mock(randrange=lambda number: number - 1)
    assert b"(go r1 b)" in chosen(1)
    pair.at["r2"].hears(late, 2)
    pair.tick(SILENT_AFTER)
    pair.does("r1", SILENT_AFTER + 1)
    assert [event.name for event in pair.at["r2"]._logs["r1"].events] == ["(go r1 b)"]
    assert pair.lines("r1", "refused") == pair.lines("r2", "refused") == []


def test_what_a_driver_may_not_say_is_refused_and_changes_nothing() -> None:
    pair = Pair(turning_round(), "r1", "r2")
    pair.tick(0)
    own = pair.at["r1"]
    number, text = own.underway or pytest.fail("nothing began")
    cases = {
        "{": "Expecting",
        "[1]": "expected an object",
        '{"event": 1}': "expected done, wish or late",
        '{"event": 2, "done": true}': "event 1 is under way",
        '{"done": "(move r1 c9 c9)"}': f"event 1 is {re.escape(text)}",
        '{"late": "soon"}': "expected a number",
        '{"late": 1' + "0" * 400 + "}": "expected a number",
        '{"late": Infinity}': "expected a number",
        '{"wish": {"go": "(at r1 a)"}}': "a wish has some of avoid, do, never, visit",
        '{"wish": {"visit": 3}}': "holds texts",
        '{"wish": {"visit": "(at r1 c9)"}}': "is no atom that can change",
        "[" * 100_000: "recursion|nested|Expecting",
    }
    for line, why in cases.items():
        own.reads(line, 1)
        (said,) = pair.lines("r1", "why")
        assert re.search(why, said), (line, said)
    assert own.underway == (number, text)
    own.reads('{"event": 1, "done": true}', 1)
    own.reads('{"event": 1, "done": true}', 1)  # it has ended
    assert pair.lines("r1", "why") == ["no event is under way"]


def test_a_wish_is_promised_and_being_late_is_told() -> None:
    pair = Pair(choices_in(EITHER_WAY, EITHER_WAY_BOTH), "r1", "r2")
    pair.at["r1"].reads('{"wish": {"do": "(go r1 b)"}}', 0)  # before anything is agreed
    pair.tick(0)
    assert pair.lines("r1", "granted") == [True]
    assert pair.lines("r1", "start") == ["(go r1 b)"]
    pair.at["r1"].reads('{"wish": {"do": "(go r1 a)"}}', 0)
    assert pair.lines("r1", "granted") == [False]
    pair.at["r1"].reads('{"late": 2.5}', 1)
    pair.tick(1)
    late = [line for line in pair.at["r2"].lines if "late" in line]
    assert late == [{"late": "r1", "seconds": 2.5, "waiting": False}]


GO = Event("(go r1 a)", "(go r1 a)")
ENDED = LogPart(Version(1, 1, 1, 1), 0, (GO,))
WRONG, DONE = LogPart(Version(0, 1)), Version(is_done=True)


@pytest.mark.parametrize(
    ("parts", "is_refused"),
    [
        ([ENDED, LogPart(Version(1, 1, 1, 0), 0, (GO,))], False),
        ([LogPart(Version(2, 1, 1, 1), 1, (GO,))], False),
        # What comes after an event does not count without it: it may be another one.
        ([LogPart(Version(1), 0, (GO,)), LogPart(Version(1, 1, 1, 1), 1)], False),
        ([ENDED, LogPart(Version(1), 0, (Event("x", "x"),))], True),
        ([LogPart(Version(1, 0, 0, 1), 0, (GO,))], True),
        ([LogPart(Version(2, 2, 2, 0), 0, (GO, GO))], True),
        ([LogPart(Version(1, 1, 1, 0, True), 0, (GO,))], True),
        ([LogPart(Version(1, 1, 1, 1), 0, (GO, GO))], True),
    ],
)
def test_logs_only_grow(parts: Sequence[LogPart], is_refused: bool) -> None:
    log = RobotLog()
    for part in parts[:-1]:
        assert log.join(part)
    before = log.version, list(log.events)
    if is_refused:
        with pytest.raises(Contradiction):
            log.join(parts[-1])
    else:
        assert not log.join(parts[-1])
    assert (log.version, log.events) == before


def test_a_long_log_comes_in_parts() -> None:
    whole, log = RobotLog(), RobotLog()
    whole.events = [Event(f"(go r1 {n})", f"(go r1 {n})") for n in range(200)]
    whole.advance(begun=200, told=200, ended=199)
    rounds = 0
    while log.version != whole.version:
        assert log.join(whole.part(log.version))
        assert log.version.ended <= len(log.events)
        rounds += 1
    assert (log.events, rounds) == (whole.events, 13)


def test_messages_that_are_none_are_refused_once() -> None:
    pair = Pair(turning_round(), "r1", "r2")
    pair.tick(0)
    own = pair.at["r1"]
    good = encode(Message("run", "r2", 1))
    cases = {
        b"\xff": "no message of a robot",
        b'{"run": "run", "by": 3}': "no message of a robot",
        b"[" * 100_000: "no message of a robot",
        good.replace(b'"r2"', b'"r9"'): "not one of ours",
        good.replace(b'"run":"run"', b'"run":"another"'): "another task, or with other words",
        encode(Message("run", "r2", 1, knows={"r9": Version()})): "a robot that there is not: r9",
        encode(Message("run", "r2", 1, sentence="w9")): 'r2 follows "w9", r1 "w',
        encode(Message("run", "r2", 1, logs={"r2": WRONG})): "no robot can be",
        encode(Message("run", "r2", 1, logs={"r1": LogPart(DONE)})): "more than r1 has done",
        encode(Message("run", "r2", 1, late=-1.0)): "Expected `float` >= 0.0",
    }
    for data, why in cases.items():
        own.hears(data, 1)
        own.hears(data, 1)
        (said,) = pair.lines("r1", "why")
        assert why in said
    # An event that waits for an own one cannot have ended.
    its = pair.data["choices"][1]["passings"]["events"].items()
    events = tuple(Event(text, event["subaction"]) for text, event in its)
    part = LogPart(Version(2, 2, 2, 2), 0, events)
    own.hears(encode(Message("run", "r2", 1, logs={"r2": part})), 2)
    (said,) = pair.lines("r1", "why")
    assert "it waits for r1" in said
    assert pair.lines("r1", "from") == []
    # Of a robot that begins others may know what it did, if it is one of its choices.
    for log in (LogPart(Version(1), 0, (GO,)), LogPart(DONE)):
        with pytest.raises(Refuted, match="did what it may not do: event 1"):
            Pair(turning_round(), "r1").at["r1"].hears(
                encode(Message("run", "r2", 1, {"r1": 1}, logs={"r1": log})), 1
            )


def test_a_refused_message_decides_no_sentence() -> None:
    agreement = Agreement("r1", ["r2"], None, (), lambda _: "w0", lambda *_: True)
    own = Executive("run", agreement, pytest.fail, 5.0)
    own.hears(encode(Message("run", "r2", 1, sentence="w9", logs={"r2": WRONG})), 1)
    own.tick(2)
    assert agreement.sentence is None


# ---- agreeing


def talk(
    wishes: dict[str, tuple[str, ...]], given: Mapping[str, str] = MappingProxyType({})
) -> dict[str, str | None]:
    """What robots agree on; sentences are tuples of wishes, and grant those that they hold."""
    agreements = {
        name: Agreement(
            name,
            [other for other in wishes if other != name],
            given.get(name),
            own,
            lambda wished: " ".join(wished) or "any",
            lambda sentence, wished: {*wished} <= {*sentence.split()},
        )
        for name, own in wishes.items()
    }
    for _ in range(4):
        said = {name: Message("run", name, 1, **own.said()) for name, own in agreements.items()}
        for name, own in agreements.items():
            for other, message in said.items():
                if other != name:
                    own.check(message)
                    own.hears(message)
            own.advance()
    return {name: own.sentence for name, own in agreements.items()}


def test_robots_agree_in_three_messages() -> None:
    nobody: dict[str, tuple[str, ...]] = {"r1": (), "r2": (), "r3": ()}
    assert {*talk(nobody).values()} == {"any"}
    assert {*talk({**nobody, "r2": ("a",)}).values()} == {"a"}  # who has wishes speaks
    both = {**nobody, "r3": ("a", "b"), "r2": ("a",)}  # the least name proposes
    assert {*talk(both).values()} == {"a a b"}
    assert {*talk({**nobody, "r2": ("a", "b"), "r3": ("b",)}).values()} == {"a b"}
    assert {*talk(nobody, {"r3": "c"}).values()} == {"c"}  # from outside
    with pytest.raises(Refuted, match='r2 follows "d", r1 "c"'):
        talk(nobody, {"r1": "c", "r2": "d"})
