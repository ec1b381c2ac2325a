# SPDX-License-Identifier: GPL-3.0-or-later
"""Exported behaviour trees drive the same robots on wheels, by py_trees."""

from __future__ import annotations

from collections.abc import Mapping
from random import Random

import py_trees
import pytest
from py_trees.common import Status

from coordlang.execution.choices import choices
from coordlang.exports.behaviour_tree import behaviour_trees
from coordlang.simulation.robot import ARRIVED, STANDING, Velocity, distance, driven, turned
from coordlang.simulation.simulator import Settings, Simulator
from coordlang.simulation.team import Mission
from tests.support.behaviour_trees import Leaf, read_tree
from tests.support.simulation import floor_for, mission_of


class Robots:
    """Robots whose trees are ticked; a step begins when all have done the one before."""

    def __init__(self, mission: Mission, seed: int) -> None:
        self.mission, self.settings = mission, Settings()
        self.floor = floor_for(mission)
        poses = {name: (*self.floor.points[place], 0.0) for name, place in mission.starts.items()}
        self.simulator = Simulator(self.floor, poses, self.settings, seed)
        self.random = Random(seed)
        self.places = dict(mission.starts)
        self.subplans: dict[str, list[str | None]] = {name: [] for name in mission.robots}
        self.velocity: dict[str, Velocity] = {}
        self.step = self.ticks = 0

    def leaves(self, name: str) -> dict[str, Leaf]:
        def awaits(ports: Mapping[str, str]) -> Status:
            if int(ports["step"]) > self.step:
                return Status.RUNNING
            del self.subplans[name][self.step :]
            self.subplans[name].append(None)  # idle, unless an action is done
            return Status.SUCCESS

        def chooses(ports: Mapping[str, str]) -> Status:
            return Status.SUCCESS if self.random.random() < 0.5 else Status.FAILURE

        def holds(ports: Mapping[str, str]) -> Status:
            true = {self.mission.atom_at(robot, place) for robot, place in self.places.items()}
            return Status.SUCCESS if ports["fact"] in true else Status.FAILURE

        def moves(ports: Mapping[str, str]) -> Status:
            self.subplans[name][self.step] = ports["subaction"]
            pose, target = self.simulator.pose(name), self.floor.points[ports["arg2"]]
            if distance(pose, target) < ARRIVED:
                return Status.SUCCESS
            is_turning = self.ticks * self.settings.tick < self.settings.drive.turning
            steer = turned if is_turning else driven
            self.velocity[name] = steer(pose, target, self.settings.drive)
            return Status.RUNNING

        return {"AwaitStep": awaits, "Chooses": chooses, "Holds": holds, "move": moves}

    def run(self, xml: str) -> None:
        """Tick all trees until they have succeeded."""
        trees = {name: read_tree(xml, name, self.leaves(name)) for name in self.mission.robots}
        while any(tree.root.status != Status.SUCCESS for tree in trees.values()):
            self.velocity = dict.fromkeys(trees, STANDING)
            for tree in trees.values():
                if tree.root.status != Status.SUCCESS:
                    tree.tick()
                assert tree.root.status != Status.FAILURE
            self.simulator.tick(self.velocity, (0.0, 0.0))
            assert not self.simulator.touching()
            self.ticks += 1
            if all(self.has_done(tree) for tree in trees.values()):
                self.step, self.ticks = self.step + 1, 0
                for name, subplan in self.subplans.items():
                    place = self.mission.leads[name].get(subplan[-1] or "", self.places[name])
                    assert distance(self.simulator.pose(name), self.floor.points[place]) < 0.1
                    self.places[name] = place

    def has_done(self, tree: py_trees.trees.BehaviourTree) -> bool:
        """Whether a tree waits for the next step, or has ended."""
        tip = tree.root.tip()
        return tree.root.status == Status.SUCCESS or (tip is not None and tip.name == "AwaitStep")


@pytest.mark.thorough
@pytest.mark.parametrize("folder", ["t-map", "corridor"])
def test_trees_drive_the_robots_to_their_goals(folder: str) -> None:
    mission = mission_of(folder)
    xml = behaviour_trees(choices(mission.task_language, mission.sentence))
    drawn = set()
    for seed in range(2):
        robots = Robots(mission, seed)
        robots.run(xml)
        assert robots.places == mission.goals
        assert mission.mixes(robots.subplans)
        drawn.add(str(robots.subplans))
    assert folder == "t-map" or len(drawn) == 2, "trees choose by themselves"
