# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs of a mission, one after another, as one record."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from coordlang.language.candidates import describe
from coordlang.simulation.floor import Floor, require_room
from coordlang.simulation.record import FORMAT, VERSION, RunRecord, SimulationRecord, WishRecord
from coordlang.simulation.run import run, ticks_of_interval
from coordlang.simulation.settings import Settings
from coordlang.simulation.simulator import require_simulator
from coordlang.simulation.team import Mission


def runs_of(
    mission: Mission,
    floor: Floor,
    settings: Settings,
    number: int,
    seed: int = 0,
    wishes: Sequence[WishRecord] = (),
) -> Iterator[RunRecord]:
    """Run a mission so many times, with the seeds ``seed``, ``seed + 1``, ..

    Raises
    ------
    UsageError
        If ir-sim is not installed, or the robots are too large for the floor.
    """
    require_room(floor, settings.radius)
    require_simulator()
    for further in range(number):
        yield run(mission, floor, settings, seed + further, wishes)


def record_of(
    mission: Mission,
    floor: Floor,
    settings: Settings,
    runs: Sequence[RunRecord],
    wishes: Sequence[WishRecord] = (),
) -> SimulationRecord:
    """Put runs together with what they were made with."""
    used = mission.task_language
    says = mission.agreement == "sentence"
    return SimulationRecord(
        format=FORMAT,
        version=VERSION,
        domain=dict(used.language.provenance.domain),
        task=describe(used.space, used.task),
        robots=list(mission.robots),
        agreement=mission.agreement,
        sentence=used.text(mission.sentence) if says else None,
        covered=used.covered,
        step=settings.step,  # type: ignore[arg-type]
        makespan=mission.steps,
        period=settings.period(floor.longest),
        interval=ticks_of_interval(settings) * settings.tick,
        cell=settings.cell,
        radius=settings.radius,
        noise=settings.noise,
        lidar=settings.lidar,
        human=settings.human,
        wishes=list(wishes),
        places={name: (round(x, 6), round(y, 6)) for name, (x, y) in sorted(floor.points.items())},
        walls=list(floor.walls),
        goals=dict(mission.goals),
        runs=list(runs),
    )
