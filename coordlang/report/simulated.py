# SPDX-License-Identifier: GPL-3.0-or-later
"""A record of simulated runs, as a page plays it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from coordlang.language.provenance import domain_sha256
from coordlang.simulation.record import RunRecord, SimulationRecord, StepRecord, event_text
from planners.joint.model import own_text
from planners.pddl.lifted import Domain
from planners.system.errors import BadInput, Position

#: Poses of all robots in all runs that a page holds; at least one run is in it.
MOST_POSES = 20_000


def require_of(record: SimulationRecord, domain: Domain, position: Position) -> None:
    """Raise `BadInput` if runs are of another domain, or if there are none."""
    wrong, remedy = None, "Give the domain that `coordlang simulate` was given."
    if record.domain.get("sha256") != domain_sha256(domain):
        wrong = "these runs are of another domain"
    elif not record.runs:
        wrong, remedy = "there is no run in this record", "Make one with `coordlang simulate`."
    if wrong:
        raise BadInput(wrong, position=position, remedy=remedy)


def simulated_data(record: SimulationRecord) -> dict[str, Any]:
    """Return the runs of a record as JSON data, as many as there is room for.

    Of a run: ``poses`` by robot, ``steps`` by robot (begin, end, text), ``events`` (time, text,
    whether it is a bad one).
    """
    shown: list[dict[str, Any]] = []
    poses = 0
    for found in record.runs:
        poses += sum(map(len, found.poses.values()))
        if shown and poses > MOST_POSES:
            break
        shown.append(_run(found, record.robots))
    floor = ["robots", "makespan", "interval", "cell", "radius", "places", "walls", "goals"]
    return {**{name: getattr(record, name) for name in floor}, "runs": shown}


def _run(found: RunRecord, robots: Sequence[str]) -> dict[str, Any]:
    return {
        "seed": found.seed,
        "arrived": found.arrived,
        "late": found.late,
        "collisions": found.collisions,
        "end": found.seconds,
        "poses": [
            [[round(x, 2), round(y, 2), round(heading, 2)] for x, y, heading in found.poses[robot]]
            for robot in robots
        ],
        "steps": [
            [[step.begin, step.end, _does(step)] for step in found.steps if step.robot == robot]
            for robot in robots
        ],
        "events": [
            [event.time, event_text(event), event.kind in ("collision", "deadlock", "missed")]
            for event in found.events
        ],
    }


def _does(step: StepRecord) -> str:
    return own_text(step.subaction, step.robot) if step.subaction else "idles"
