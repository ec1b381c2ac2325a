# SPDX-License-Identifier: GPL-3.0-or-later
"""Monitors of robots that keep no common step: each chooses and starts by its own, at any times."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Callable, Iterator
from functools import partial
from random import Random

import pytest

from coordlang.execution.choices import SentenceChoices, to_bytes
from coordlang.execution.monitor import EventMonitor, MonitorError, NotAllowed, NotPossible
from tests.support import thorough
from tests.support.asynchronous import World, texts
from tests.support.events import (
    EITHER_WAY,
    LIFT,
    LIFT_TWICE,
    ONLY_R1,
    choices_in,
    random_choices,
    turning_round,
)

SEEDS = [(3, range(7)), *thorough((2, range(900)), (3, range(7, 500)), (4, range(60)))]


def monitors_of(found: SentenceChoices) -> list[EventMonitor]:
    """As robots read them."""
    data = json.loads(to_bytes(found))
    return [EventMonitor(data, name) for name in data["robots"]]


class Robots:
    """Robots that start and end their events at random times, by their monitors alone.

    ``running`` are the subactions under way, by robot; a robot that waits for a partner has chosen.
    """

    def __init__(self, found: SentenceChoices, world: World, random: Random) -> None:
        self.at, self.world, self.random = monitors_of(found), world, random
        self.names = world.model.robots
        self.running: dict[int, str] = {}
        self.chosen: dict[int, str] = {}
        self.did: list[list[str]] = [[] for _ in self.at]
        self.seen: Counter[str] = Counter()

    def label(self, robot: int, event: str) -> int:
        return self.world.model.labels[robot].index(self.at[robot].subaction(event))

    def run(self) -> tuple[tuple[str, ...], ...]:
        """Until nothing can be done any more: what each robot did."""
        while moves := [*self.moves()]:
            self.random.choice(moves)()
        assert not self.chosen, "somebody waits for ever"
        assert all(own.finished for own in self.at), "somebody waits for ever"
        return tuple(map(tuple, self.did))

    def moves(self) -> Iterator[Callable[[], None]]:
        for robot, own in enumerate(self.at):
            if robot in self.running:
                yield partial(self.end, robot)
            elif robot in self.chosen:
                partners = map(self.names.index, own.partners(self.chosen[robot]))
                block = robot, *partners
                if all(r in self.chosen and not self.at[r].missing(self.chosen[r]) for r in block):
                    yield partial(self.start, block)
            elif not own.finished:
                for event in own.allowed():
                    if event not in own.free():
                        self.refuse(own, event)
                    elif event is None:
                        yield partial(own.did, None)
                    else:
                        yield partial(self.choose, robot, event)

    def refuse(self, own: EventMonitor, event: str | None) -> None:
        """What waits for an event can neither start nor have ended."""
        assert event is not None
        assert event not in own.may_start()
        with pytest.raises(NotPossible, match="it waits for"):
            own.start(event)
        with pytest.raises(NotPossible, match="not started"):
            own.did(event)
        self.seen["waits"] += 1

    def choose(self, robot: int, event: str) -> None:
        """Start at once, or tell the partners of the meeting."""
        self.chosen[robot] = event
        own = self.at[robot]
        assert (event in own.may_start()) == (not own.missing(event))
        for name in own.partners(event):
            self.seen["meets"] += 1
            self.at[self.names.index(name)].ready(own.robot, own.subaction(event))

    def start(self, block: tuple[int, ...]) -> None:
        for robot in block:
            event = self.chosen.pop(robot)
            for other, its in self.running.items():
                if other not in block:
                    assert not self.world.interfere(
                        robot, self.label(robot, event), other, self.label(other, its)
                    ), "they overlap"
            self.at[robot].start(event)
            assert self.at[robot].allowed() == self.at[robot].may_start() == (event,)
            self.running[robot] = event

    def end(self, robot: int) -> None:
        event, own = self.running.pop(robot), self.at[robot]
        own.did(event)
        self.did[robot].append(event)
        told = own.robot, own.subaction(event), len(self.did[robot])
        for at in self.at:
            if at is not own:
                before = at.copy()
                at.ended(*told)
                before.ended(*told)  # which has not heard of it
                with pytest.raises(NotPossible, match="told before"):
                    at.ended(*told)


@pytest.mark.parametrize(("robots", "seeds"), SEEDS)
def test_robots_arrive_whatever_they_choose_and_whenever_they_start(
    robots: int, seeds: range
) -> None:
    """What all did together is an optimal plan, and what each may do are its parts of plans."""
    seen: Counter[str] = Counter()
    for world, plans, group, found, random in random_choices(robots, seeds):
        optimal = {texts(world.model, parts) for parts in plans.states}
        parts = [{*own} for own in zip(*(texts(world.model, p) for p in group), strict=True)]
        for at, mine in zip(monitors_of(found), parts, strict=True):
            assert at.remaining == len(mine)
        mixed = {mix for mix, _ in plans.mixtures_of(group)}
        assert found.guaranteed == (mixed <= plans.states.keys())
        if not found.guaranteed:
            seen["no language"] += 1
            continue
        for _ in range(min(len(mixed), 4)):
            team = Robots(found, world, random)
            did = team.run()
            assert did in optimal
            assert all(own in mine for own, mine in zip(did, parts, strict=True))
            seen += team.seen
            seen["runs"] += 1
            seen["several parts"] += max(map(len, parts)) > 1
    assert min(seen[k] for k in ("runs", "no language", "waits", "several parts")) >= 5, seen


def test_what_cannot_have_happened_is_refused() -> None:
    r1, r2 = monitors_of(turning_round())
    (first,), (second,) = r1.allowed(), r2.allowed()
    assert first
    assert second
    r1.start(first)
    r1.did(first)
    (further,) = r1.allowed()
    assert further
    assert (r1.missing(further), r1.may_start(), r1.late()) == ({"r2": 1}, (), ("r2",))
    with pytest.raises(NotPossible, match="it waits for 1 more of r2"):
        r1.start(further)
    with pytest.raises(MonitorError, match="no robot r3"):
        r1.ended("r3", second, 1)
    with pytest.raises(NotPossible, match=r"that is \(move r2"):
        r1.ended("r2", "(move r2 c0-0 c0-0)", 1)
    with pytest.raises(NotPossible, match="0 of 2 were told before"):
        r1.ended("r2", second, 3)
    with pytest.raises(NotAllowed, match=r"may not do \(move r1 c0-0 c0-0\)"):
        r1.did("(move r1 c0-0 c0-0)")
    r1.ended("r2", second, 1)
    assert (r1.may_start(), r1.late()) == ((further,), ())
    # r2 hears that r1 has come to where it still is: r1 would have waited for it.
    with pytest.raises(NotPossible, match="it waits for r2"):
        r2.ended("r1", r1.subaction(further), 2)
    r1.start(further)
    r1.did(further)
    assert (r1.finished, r1.late()) == (True, ())


def test_while_an_event_is_under_way_it_is_all_that_may_end() -> None:
    r1, _ = monitors_of(choices_in(EITHER_WAY, ONLY_R1))
    one, other = r1.allowed()
    assert one is not None
    with pytest.raises(NotPossible, match="it has not started it"):
        r1.did("( GO r1  a )")
    r1.start(one)
    for did in (other, None):
        with pytest.raises(NotAllowed, match="it may do"):
            r1.did(did)
    with pytest.raises(NotPossible, match="no subplan left"):
        r1.commit(do=other)
    assert (r1.remaining, r1.known("(there r1)")) == (1, None)
    r1.did(one)
    assert (r1.finished, r1.known("(there r1)")) == (True, True)


def test_who_was_ready_for_a_meeting_is_not_ready_for_the_next_one() -> None:
    """r1 and r3 hold what r2 lifts: they do not interfere, and r1 waits for no end of r3."""
    r1, _, _ = monitors_of(choices_in(LIFT, LIFT_TWICE))
    r1.ready("r2", "(lift r2)")
    r1.ready("r3", "(hold r3)")
    (event,) = r1.may_start()
    assert event is not None
    r1.start(event)
    r1.did(event)
    r1.ended("r2", "(lift r2)", 1)
    r1.ready("r2", "(lift r2)")
    (event,) = r1.allowed()
    assert r1.missing(event) == {"r3": "(hold r3)"}
    r1.ready("r3", "(hold r3)", 2)
    r1.ended("r3", "(hold r3)", 1)  # is heard of late
    assert r1.may_start() == (event,)


JOINT = """(define (domain together) (:predicates (p) (q))
 (:action first :parameters ()
  ; subaction r1 idle
  ; subaction r2 (a)
  :precondition (not (p)) :effect (p))
 (:action second :parameters ()
  ; subaction r1 (b)
  ; subaction r2 idle
  :precondition (p) :effect (q)))"""


def test_what_others_do_while_a_robot_idles_is_not_known_to_it() -> None:
    """Nobody tells it when that happens: idling is no event."""
    found = choices_in(JOINT, "(define (problem p) (:domain together) (:init) (:goal (q)))")
    r1, r2 = monitors_of(found)
    assert (r1.known("(p)"), r1.known("(q)")) == (None, False)
    assert (r2.known("(p)"), r2.known("(q)")) == (False, None)


def test_what_is_told_in_no_way_that_can_be_read() -> None:
    r1, _ = monitors_of(turning_round())
    for number in (1.0, True, "1", None):
        with pytest.raises(MonitorError, match="numbered from 1"):
            r1.ended("r2", "(move r2 c0-0 c0-1)", number)  # type: ignore[arg-type]
    for ask in (r1.subaction, r1.partners, r1.concerns):
        with pytest.raises(MonitorError, match="no event of r1"):
            ask("(move r1 c9 c9)")
    with pytest.raises(NotAllowed, match=r"r1 may not do .*after-1 r2"):
        r1.did(next(text for text in r1._events if "after" in text))


def test_an_event_that_waits_for_a_robot_that_there_is_not_is_refused() -> None:
    data = json.loads(to_bytes(turning_round()))
    for event in data["choices"][0]["passings"]["events"].values():
        event["after"] = {"r3": 1}
    with pytest.raises(MonitorError, match="waits for r3: no such robot"):
        EventMonitor(data, "r1")
