# SPDX-License-Identifier: GPL-3.0-or-later
"""One run: the robots' own logics, the simulator, and the messages between them, tick by tick."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations
from random import Random

from coordlang.simulation.floor import Floor
from coordlang.simulation.human import Human
from coordlang.simulation.pace import Message, pace_of
from coordlang.simulation.record import EventRecord, RunRecord, StepRecord, WishRecord
from coordlang.simulation.robot import Act, Body, OwnStep, Robot, Sensed
from coordlang.simulation.settings import POSITION_NOISE, Settings
from coordlang.simulation.simulator import Simulator
from coordlang.simulation.team import Mission
from coordlang.simulation.tracking import Pose
from coordlang.sites.coordinates import Point

#: A run ends when no step has begun or ended for so many periods: nobody will move any more.
PATIENCE = 4
#: And with somebody walking about for so many.
WITH_WALKER = 12
#: Seconds between two poses of the record.
INTERVAL = 0.2


def ticks_of_interval(settings: Settings) -> int:
    """How many ticks there are from one pose of the record to the next."""
    return max(1, round(INTERVAL / settings.tick))


def run(
    mission: Mission,
    floor: Floor,
    settings: Settings,
    seed: int,
    wishes: Sequence[WishRecord] = (),
) -> RunRecord:
    """Let the robots do a task once.

    The same seed gives the same run.  O(robots * ticks).

    Parameters
    ----------
    mission
        What each robot is given.
    floor
        The places of the mission's world.
    settings
        How robots are built and keep step.
    seed
        Of every choice and of all noise.
    wishes
        What robots come to want on the way.
    """
    going = _Going.of(mission, floor, settings, seed)
    going.wishes = tuple(wishes)
    while not going.has_ended:
        going.tick()
    return going.record()


@dataclass(slots=True)
class _Going:
    """A run that is going on."""

    mission: Mission
    settings: Settings
    seed: int
    period: float
    robots: Mapping[str, Robot]
    simulator: Simulator
    sensing: Mapping[str, Random]
    human: Human | None
    wishes: tuple[WishRecord, ...] = ()
    wished: set[WishRecord] = field(default_factory=set)
    asked: dict[str, int] = field(default_factory=dict)
    human_at: list[Point] = field(default_factory=list)
    ticks: int = 0
    heard: tuple[Message, ...] = ()
    messages: int = 0
    touching: set[tuple[str, str]] = field(default_factory=set)
    collided: set[str] = field(default_factory=set)
    collisions: int = 0
    nearest: float = math.inf
    stopped: dict[str, int] = field(default_factory=dict)
    missed: dict[str, int] = field(default_factory=dict)
    last_change: float = 0.0
    steps_known: int = 0
    events: list[EventRecord] = field(default_factory=list)
    poses: dict[str, list[Pose]] = field(default_factory=dict)

    @classmethod
    def of(cls, mission: Mission, floor: Floor, settings: Settings, seed: int) -> _Going:
        period = settings.period(floor.longest)
        robots = {
            name: Robot(
                name,
                given.monitor,
                Body(
                    settings.drive,
                    floor.points,
                    mission.leads[name],
                    settings.cell,
                    settings.clearance,
                    settings.reaction,
                ),
                pace_of(settings.step, mission.robots, period),
                period,
                Random(f"{seed} choices {name}"),
                given.words,
            )
            for name, given in mission.team(seed).items()
        }
        poses = {
            name: (
                *floor.points[place],
                Random(f"{seed} heading {name}").uniform(-math.pi, math.pi),
            )
            for name, place in mission.starts.items()
        }
        sensing = {name: Random(f"{seed} sensors {name}") for name in robots}
        human = None
        if settings.human is not None:
            human = Human.of(
                settings.human,
                floor,
                list(mission.starts.values()),
                list(mission.goals.values()),
                settings.cell,
                Random(f"{seed} human"),
            )
        standing = floor.points[human.place] if human is not None else None
        simulator = Simulator(floor, poses, settings, seed, standing)
        return cls(mission, settings, seed, period, robots, simulator, sensing, human)

    @property
    def time(self) -> float:
        """Seconds since the start."""
        return round(self.ticks * self.settings.tick, 6)

    @property
    def has_arrived(self) -> bool:
        """Whether all robots have done all their steps."""
        return all(robot.finished for robot in self.robots.values())

    @property
    def has_ended(self) -> bool:
        """Whether all are there, or nobody will move any more."""
        return self.has_arrived or self.time - self.last_change > self.patience

    @property
    def patience(self) -> float:
        """Seconds without a step after which nobody will move any more."""
        walks = self.human is not None and self.human.walks
        return (WITH_WALKER if walks else PATIENCE) * self.period

    def tick(self) -> None:
        """Let a tick pass: sense, choose, tell, move."""
        self._keep_poses()
        heard, self.heard = self.heard, ()
        velocities = {}
        for name, robot in self.robots.items():
            act = robot.act(self._sensed(name, robot, heard))
            velocities[name] = act.velocity
            self._take(name, robot, act)
        changes = sum(len(robot.steps) + robot.done for robot in self.robots.values())
        if changes > self.steps_known:
            self.steps_known, self.last_change = changes, self.time
        self.simulator.tick(velocities, self._walk())
        self.ticks += 1
        self._see_collisions()
        self._see_distances()

    def record(self) -> RunRecord:
        """Return the record of the run that has ended."""
        self._keep_poses()
        has_arrived, is_stuck = self.has_arrived, not self.has_arrived and not self.collided
        seconds = self._seconds()
        if has_arrived or is_stuck:
            self._event("arrived" if has_arrived else "deadlock", list(self.robots))
        subplans = {name: robot.subplan() for name, robot in self.robots.items()}
        steps = math.ceil(seconds / self.period - 1e-6)
        return RunRecord(
            seed=self.seed,
            collisions=self.collisions,
            deadlock=is_stuck,
            late=max(0, steps - self.mission.steps) if has_arrived else 0,
            messages=self.messages,
            seconds=seconds,
            arrived=has_arrived,
            mixes=self.mission.mixes(subplans),
            nearest=None if math.isinf(self.nearest) else round(self.nearest, 3),
            subplans=subplans,
            steps=[_step(name, step) for name, step in self._steps()],
            events=self.events,
            human=self.human_at,
            poses={name: [_rounded(pose) for pose in poses] for name, poses in self.poses.items()},
        )

    def _seconds(self) -> float:
        """Seconds until the last robot was there, or until nobody moved any more."""
        if not self.has_arrived:
            return self.time
        ends = [step.end for _, step in self._steps() if step.end is not None]
        return max(ends, default=0.0)

    def _steps(self) -> list[tuple[str, OwnStep]]:
        every = [(name, step) for name, robot in self.robots.items() for step in robot.steps]
        return sorted(every, key=lambda pair: pair[1].begin)

    def _sensed(self, name: str, robot: Robot, heard: tuple[Message, ...]) -> Sensed:
        x, y, heading = self.simulator.pose(name)
        spread = POSITION_NOISE * self.settings.noise
        random = self.sensing[name]
        pose = (
            x + random.gauss(0, spread),
            y + random.gauss(0, spread),
            heading + random.gauss(0, spread),
        )
        ahead: float | None = math.inf
        if self.settings.lidar:
            ahead = self.simulator.ahead(name) if robot.looks_ahead else None
        strangers: tuple[tuple[float, float], ...] = ()
        if self.human is not None and robot.looks_around:
            strangers = self.simulator.strangers(name)
        return Sensed(self.time, pose, ahead, heard, strangers, self._wanted(name, robot))

    def _wanted(self, name: str, robot: Robot) -> tuple[str, ...]:
        """What a robot comes to want now."""
        if not robot.looks_around:
            return ()
        now = [
            wish
            for wish in self.wishes
            if wish.robot == name and wish.step <= robot.done and wish not in self.wished
        ]
        self.wished.update(now)
        return tuple(wish.visit for wish in now)

    def _walk(self) -> tuple[float, float]:
        """How the human walks."""
        if self.human is None or not self.human.walks:
            return 0.0, 0.0
        robots = [self.simulator.pose(name)[:2] for name in self.robots]
        return self.human.velocity(
            self.simulator.human(), robots, 2 * self.settings.radius + 0.3 * self.settings.cell
        )

    def _take(self, name: str, robot: Robot, act: Act) -> None:
        """Take in what a robot does: its messages, and what is worth an event."""
        self.heard += act.messages
        self.messages += len(act.messages)
        for message in act.messages:
            if message.kind == "word":
                self._event("word", [name])
        for detour in robot.detours[self.asked.get(name, 0) :]:
            self._event(
                "detour", [name], visit=detour.visit, avoid=detour.avoid, granted=detour.granted
            )
        self.asked[name] = len(robot.detours)
        if act.is_stopped and self.stopped.get(name) != robot.done:
            self.stopped[name] = robot.done  # once in a step
            self._event("stopped", [name])
        if self.settings.step == "clock" and robot.steps:
            step = robot.steps[-1]
            missed = round(step.begin / self.period) - step.number
            if missed > self.missed.get(name, 0):
                self._event("missed", [name])
            self.missed[name] = missed

    def _see_collisions(self) -> None:
        touching = self.simulator.touching()
        for pair in sorted(touching - self.touching):
            self.collisions += 1
            robots = [name for name in pair if name in self.robots]
            others = [name.removeprefix("the ") for name in pair if name not in self.robots]
            self.collided.update(robots)
            self._event("collision", robots, touched=others[0] if others else None)
        self.touching = touching

    def _see_distances(self) -> None:
        middles = [self.simulator.pose(name)[:2] for name in self.robots]
        for one, other in combinations(middles, 2):
            self.nearest = min(self.nearest, math.dist(one, other))

    def _keep_poses(self) -> None:
        if self.ticks % ticks_of_interval(self.settings) == 0:
            for name in self.robots:
                self.poses.setdefault(name, []).append(self.simulator.pose(name))
            if self.human is not None:
                x, y = self.simulator.human()
                self.human_at.append((round(x, 3), round(y, 3)))

    def _event(self, kind: str, robots: list[str], **further: object) -> None:
        self.events.append(
            EventRecord(
                time=self.time,
                kind=kind,  # type: ignore[arg-type]
                robots=robots,
                steps={name: robot.done for name, robot in self.robots.items()},
                words={name: robot.words for name, robot in self.robots.items()}
                if self.mission.agreement != "nothing"
                else {},
                places={name: self._places(name) for name in self.robots},
                **further,  # type: ignore[arg-type]
            )
        )

    def _places(self, name: str) -> list[str]:
        """The place of a robot; under way the place that it leaves and the one ahead."""
        been = [self.mission.starts[name]]
        underway: list[str] = []
        for step in self.robots[name].steps:
            if step.place is not None:
                (been if step.end is not None else underway).append(step.place)
        return [been[-1], *underway]


def _step(robot: str, step: OwnStep) -> StepRecord:
    return StepRecord(
        robot, step.number, step.subaction, step.place, step.begin, step.end, step.words
    )


def _rounded(pose: Pose) -> Pose:
    x, y, heading = pose
    return round(x, 3), round(y, 3), round(heading, 3)
