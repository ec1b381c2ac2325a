# SPDX-License-Identifier: GPL-3.0-or-later
"""Robots with wheels do tasks: runs, and how they ended beside what the joint model says."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from benchmarks.paper.task_choices import sentence_of
from coordlang.execution.task_language import TaskLanguage
from coordlang.simulation.record import RunRecord, WishRecord
from coordlang.simulation.run import Simulation
from coordlang.simulation.simulator import Floor, Settings
from coordlang.simulation.team import Agreement, Mission
from coordlang.sites.coordinates import Point
from planners.search.plans import Plan


def mission_of(used: TaskLanguage, plan: Plan, agreement: Agreement) -> Mission:
    """Return the mission of robots that agree on a plan's sentence, on any plan, or on nothing."""
    return Mission(used, agreement, sentence_of(used, plan) if agreement == "sentence" else ())


def drive(
    prepared: Mission,
    how: Settings,
    seed: int,
    known: Mapping[str, Point] | None = None,
    wishes: Sequence[WishRecord] = (),
) -> RunRecord:
    """Let robots do a mission once; ``known`` are coordinates that names do not say."""
    floor = Floor(prepared.world, known or {})
    return next(Simulation(prepared, floor, how, wishes).runs(1, seed))


def is_well(found: RunRecord) -> bool:
    """Say whether all arrived in time and nobody touched anything."""
    return found.arrived and not found.late and not found.collisions


def counted(found: Sequence[RunRecord]) -> dict[str, Any]:
    """Count how runs ended, and how often the joint model says the same of the robots' choices.

    ``well``, ``collisions``, ``deadlocks``, ``late``: runs; ``late_steps``,
    ``messages``, ``seconds`` (simulated): sums; ``nearest``: the least distance of two robots, in
    metres; ``mixes``: runs in which the robots' own subplans, done in step, are an optimal plan;
    ``agree``: runs that ended well iff they are.
    """
    distances = [record.nearest for record in found if record.nearest is not None]
    return {
        "runs": len(found),
        "well": sum(map(is_well, found)),
        "collisions": sum(record.collisions > 0 for record in found),
        "deadlocks": sum(record.deadlock for record in found),
        "late": sum(record.late > 0 for record in found),
        "late_steps": sum(record.late for record in found),
        "messages": sum(record.messages for record in found),
        "seconds": round(sum(record.seconds for record in found), 1),
        "nearest": min(distances, default=None),
        "mixes": sum(record.mixes for record in found),
        "agree": sum(is_well(record) == record.mixes for record in found),
    }
