# SPDX-License-Identifier: GPL-3.0-or-later
"""Places that a robot comes to want on the way."""

from __future__ import annotations

from coordlang.simulation.record import EventRecord, RunRecord, WishRecord
from coordlang.simulation.simulator import Settings
from tests.support.simulation import runs


def detours(found: RunRecord) -> list[EventRecord]:
    return [event for event in found.events if event.kind == "detour"]


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
