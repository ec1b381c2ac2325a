# SPDX-License-Identifier: GPL-3.0-or-later
"""What nobody knew of before: a human on the floor, and places that a robot comes to want."""

from __future__ import annotations

import math
from random import Random

import pytest

from coordlang.simulation.floor import Human
from coordlang.simulation.record import EventRecord, RunRecord, WishRecord
from coordlang.simulation.simulator import Settings
from planners.system.errors import UsageError
from tests.support.simulation import floor_for, mission_of, runs


def detours(found: RunRecord) -> list[EventRecord]:
    return [event for event in found.events if event.kind == "detour"]


def test_who_has_a_choice_goes_round_the_human() -> None:
    """Corners of an open grid: under the sentence robots may keep out of the middle."""
    settings = Settings(step="barrier", human="c1-1")
    for found in runs("grid", "sentence", settings, 2, stem="corners-3x3"):
        assert found.arrived
        assert found.collisions == 0
        assert all(event.granted for event in detours(found))
        assert "c1-1" not in {step.place for step in found.steps}


def test_who_has_none_stops_before_the_human() -> None:
    for found in runs("t-map", "plan", Settings(human="c1-1"), 2):
        assert found.deadlock
        assert found.collisions == 0
        assert not any(event.granted for event in detours(found))
        assert "stopped" in {event.kind for event in found.events}
        assert found.human == [found.human[0]] * len(found.human)


def test_a_detour_that_own_choices_allow_is_made() -> None:
    wish = WishRecord("r2", 2, "(at r2 c0-4)")
    for found in runs("corridor", "sentence", Settings(), 2, wish):
        (event,) = detours(found)
        assert (event.visit, event.steps["r2"]) == ("(at r2 c0-4)", 2)
        places = {step.place for step in found.steps if step.robot == "r2"}
        assert event.granted == ("c0-4" in places)
        assert found.arrived
        assert found.late == 0


def test_under_a_whole_plan_a_detour_can_be_had_only_if_it_is_on_it() -> None:
    wish = WishRecord("r2", 2, "(at r2 c0-4)")
    granted = set()
    for found in runs("corridor", "plan", Settings(), 4, wish):
        (event,) = detours(found)
        granted.add(event.granted)
        assert event.granted == ("(move r2 c1-4 c0-4)" in found.subplans["r2"])
    assert granted == {True, False}


def test_a_walker_goes_along_links_and_turns_back_before_robots() -> None:
    floor = floor_for(mission_of("corridor"))
    human = Human("walking", floor, (), (), 1.0, Random(4))
    at = floor.points[human.place]
    seen = set()
    for _ in range(2000):
        x, y = human.velocity(at, (), 0.7)
        assert math.hypot(x, y) <= 0.5 + 1e-9
        at = at[0] + x / 10, at[1] + y / 10
        seen.add(human.place)
        (one, other) = floor.points[human.before], floor.points[human.place]
        assert math.dist(one, at) + math.dist(at, other) < 1.1, "between two linked places"
    assert len(seen) > 5
    towards = floor.points[human.place]
    before = human.place
    x, y = human.velocity(at, [towards], 10.0)
    assert human.place != before or (x, y) == (0.0, 0.0)


def test_a_human_needs_a_place_that_there_is_and_that_is_free() -> None:
    floor = floor_for(mission_of("t-map"))
    every = sorted(floor.points)
    assert Human("random", floor, every[1:], (), 1.0, Random(0)).place == "c0-1"
    for place, starts, goals, said in (
        ("nowhere", [], [], "there is no such place"),
        ("c9-9", [], [], "there is no such place"),
        ("random", ["c1-1"], every, "no place for a human"),
        ("c1-1", ["c1-1"], [], "a robot starts in this place"),
    ):
        with pytest.raises(UsageError, match=said):
            Human(place, floor, starts, goals, 1.0, Random(0))
