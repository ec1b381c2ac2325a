# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs: the robots' own logics, the simulator, and the messages between them, tick by tick."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import asdict, astuple, dataclass
from functools import partial
from itertools import combinations
from random import Random
from typing import Any

from coordlang.language.candidates import describe
from coordlang.simulation.record import (
    SIMULATION,
    EventRecord,
    RunRecord,
    SimulationRecord,
    StepRecord,
    WishRecord,
)
from coordlang.simulation.robot import TICK, Notice, Pose, Robot, period
from coordlang.simulation.simulator import POSITION_NOISE, WALL, Floor, Settings, Simulator
from coordlang.simulation.team import Mission

#: A run ends when no step has begun or ended for so many periods: nobody will move any more.
_PATIENCE = 4
#: Ticks from one pose of the record to the next.
_INTERVAL = 2


@dataclass(frozen=True, slots=True)
class Simulation:
    """A mission, a floor with the places of its world, and what robots come to want on the way."""

    mission: Mission
    floor: Floor
    settings: Settings
    wishes: Sequence[WishRecord] = ()

    def runs(self, number: int, seed: int = 0) -> Iterator[RunRecord]:
        """Run the mission so many times, with the seeds ``seed``, ``seed + 1``, ..

        The same seed gives the same run; O(robots * ticks).  Raises `UsageError` if ir-sim is not
        installed, or the robots are too large for the floor.
        """
        self.floor.require_room(self.settings.radius)
        for further in range(number):
            going = _Going(self, seed + further)
            while not going.has_ended:
                going.tick()
            yield going.record()

    def record(self, runs: Sequence[RunRecord]) -> SimulationRecord:
        """Put runs together with what they were made with."""
        mission, used, points = self.mission, self.mission.task_language, self.floor.points
        return SimulationRecord(
            format=str(SIMULATION.format),
            version=SIMULATION.version,
            domain=dict(used.language.provenance.domain),
            task=describe(used.space, used.task),
            robots=list(mission.robots),
            agreement=mission.agreement,
            sentence=used.text(mission.sentence) if mission.agreement == "sentence" else None,
            covered=used.covered,
            makespan=mission.steps,
            period=period(self.floor.longest),
            interval=_INTERVAL * TICK,
            cell=1.0,
            **asdict(self.settings),
            wishes=list(self.wishes),
            places={name: (round(x, 6), round(y, 6)) for name, (x, y) in sorted(points.items())},
            walls=list(self.floor.walls),
            goals=dict(mission.goals),
            runs=list(runs),
        )


class _Going:
    def __init__(self, simulation: Simulation, seed: int) -> None:
        mission, floor, settings = simulation.mission, simulation.floor, simulation.settings
        self.mission, self.settings, self.seed = mission, settings, seed
        self.period = period(floor.longest)
        wished: dict[str, dict[int, list[str]]] = {name: {} for name in mission.robots}
        for wish in simulation.wishes:
            wished[wish.robot].setdefault(wish.step, []).append(wish.visit)
        self.robots = {
            name: Robot(
                name,
                settings.radius,
                floor.points,
                mission.leads[name],
                *given,
                settings.step,
                self.period,
                dict.fromkeys(mission.robots, 0),
                Random(f"{seed} choices {name}"),
                wished[name],
            )
            for name, given in mission.team(seed).items()
        }
        self.sensing = {name: Random(f"{seed} sensors {name}") for name in self.robots}
        poses = {}
        for name, place in mission.starts.items():
            heading = Random(f"{seed} heading {name}").uniform(-math.pi, math.pi)
            poses[name] = (*floor.points[place], heading)
        self.simulator = Simulator(floor, poses, settings, seed)
        self.ticks = self.messages = self.collisions = 0
        self.nearest = math.inf
        self.heard: tuple[Notice, ...] = ()
        self.touching: set[tuple[str, str]] = set()
        self.events: list[EventRecord] = []
        self.poses: dict[str, list[Pose]] = {name: [] for name in self.robots}

    @property
    def time(self) -> float:
        return round(self.ticks * TICK, 6)

    @property
    def has_arrived(self) -> bool:
        return all(robot.monitor.finished for robot in self.robots.values())

    @property
    def has_ended(self) -> bool:
        last = [step for robot in self.robots.values() for step in robot.steps[-1:]]
        changes = (step.begin if step.end is None else step.end for step in last)
        waited = self.time - max(changes, default=0.0)
        return self.has_arrived or waited > _PATIENCE * self.period

    def tick(self) -> None:
        """Let a tick pass: sense, choose, tell, move."""
        self._keep_poses()
        heard, self.heard = self.heard, ()
        velocities = {}
        for name, robot in self.robots.items():
            look = partial(self.simulator.ahead, name) if self.settings.lidar else None
            velocities[name] = robot.act(self.time, self._believed(name), look, heard)
            self.heard += (*robot.messages,)
            self.messages += len(robot.messages)
            for kind, further in robot.events:
                self._event(kind, [name], **further)
            robot.messages, robot.events = [], []
        self.simulator.tick(velocities)
        self.ticks += 1
        self._see_collisions()
        middles = [self.simulator.pose(name)[:2] for name in self.robots]
        apart = (math.dist(one, other) for one, other in combinations(middles, 2))
        self.nearest = min(self.nearest, *apart, math.inf)

    def record(self) -> RunRecord:
        self._keep_poses()
        steps = [
            StepRecord(name, *astuple(one))
            for name, robot in self.robots.items()
            for one in robot.steps
        ]
        has_arrived, is_stuck = self.has_arrived, not self.has_arrived and not self.collisions
        seconds, late = self.time, 0
        if has_arrived:
            self._event("arrived", list(self.robots))
            seconds = max((step.end for step in steps if step.end is not None), default=0.0)
            late = max(0, math.ceil(seconds / self.period - 1e-6) - self.mission.steps)
        elif is_stuck:
            self._event("deadlock", list(self.robots))
        subplans = {name: robot.subplan() for name, robot in self.robots.items()}
        return RunRecord(
            seed=self.seed,
            collisions=self.collisions,
            deadlock=is_stuck,
            late=late,
            messages=self.messages,
            seconds=seconds,
            arrived=has_arrived,
            mixes=self.mission.mixes(subplans),
            nearest=None if math.isinf(self.nearest) else round(self.nearest, 3),
            subplans=subplans,
            steps=sorted(steps, key=lambda step: step.begin),
            events=self.events,
            poses=self.poses,
        )

    def _believed(self, name: str) -> Pose:
        spread, random = POSITION_NOISE * self.settings.noise, self.sensing[name]
        x, y, heading = (value + random.gauss(0, spread) for value in self.simulator.pose(name))
        return x, y, heading

    def _see_collisions(self) -> None:
        touching = self.simulator.touching()
        for pair in sorted(touching - self.touching):
            self.collisions += 1
            robots = [name for name in pair if name in self.robots]
            self._event("collision", robots, touched="wall" if WALL in pair else None)
        self.touching = touching

    def _keep_poses(self) -> None:
        if self.ticks % _INTERVAL == 0:
            for name, poses in self.poses.items():
                x, y, heading = self.simulator.pose(name)
                poses.append((round(x, 3), round(y, 3), round(heading, 3)))

    def _event(self, kind: Any, robots: list[str], **further: Any) -> None:
        knows_words = self.mission.agreement != "nothing"
        self.events.append(
            EventRecord(
                time=self.time,
                kind=kind,
                robots=robots,
                steps={name: robot.done for name, robot in self.robots.items()},
                words={n: robot.words for n, robot in self.robots.items()} if knows_words else {},
                places={name: self._places(name) for name in self.robots},
                **further,
            )
        )

    def _places(self, name: str) -> list[str]:
        """The place of a robot; under way the place that it leaves and the one ahead."""
        places = [self.mission.starts[name]]
        for step in self.robots[name].steps:
            if step.place is not None:
                places = [places[-1], step.place] if step.end is None else [step.place]
        return places
