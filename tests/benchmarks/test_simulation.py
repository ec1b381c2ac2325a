# SPDX-License-Identifier: GPL-3.0-or-later
"""Robots with wheels, counted: by hand, and against what the joint model says."""

from __future__ import annotations

from typing import Any

from benchmarks.paper.driving import counted, is_well
from benchmarks.paper.floors import FLOORS, tasks_of
from coordlang.simulation.record import EventRecord, RunRecord
from planners.search.plans import Plans
from tests.support import naive


def record(**changed: Any) -> RunRecord:
    """A run that ended well, but for what is changed."""
    usual: dict[str, Any] = {
        "seed": 0,
        "collisions": 0,
        "deadlock": False,
        "late": 0,
        "messages": 3,
        "seconds": 10.0,
        "arrived": True,
        "mixes": True,
        "subplans": {},
        "steps": [],
        "events": [
            EventRecord(9.0, "stopped", ["r1"]),
            EventRecord(10.0, "arrived", ["r1"], steps={"r1": 4}, places={"r1": ["c0-0", "c0-1"]}),
        ],
        "poses": {},
        "nearest": 0.7,
    }
    return RunRecord(**usual | changed)


def test_how_runs_end_is_counted() -> None:
    found = [
        record(),
        record(late=2, nearest=0.6),
        record(arrived=False, deadlock=True, mixes=False, seconds=20.0),
        record(arrived=False, collisions=2, nearest=0.38),
    ]
    assert [is_well(run) for run in found] == [True, False, False, False]
    once = dict.fromkeys(("well", "collisions", "deadlocks", "late"), 1)
    rest = {"late_steps": 2, "messages": 12, "seconds": 50.0, "nearest": 0.38}
    assert counted(found) == {"runs": 4, **once, **rest, "mixes": 3, "agree": 2}


def test_tasks_of_floors_require_coordination() -> None:
    language, tasks = tasks_of(FLOORS["T-map, 2 robots"], 0)
    assert (len(language.words), len(tasks)) == (3, 12)
    plans = [[*Plans.of(used.space, used.task)] for used in tasks]
    assert all(any(naive.failing(own, 2)) for own in plans)
