# SPDX-License-Identifier: GPL-3.0-or-later
"""Exported behaviour trees do exactly the robots' choices: every mixture is run with py_trees.

The XML of BehaviorTree.CPP 4 is read as its documentation describes the nodes that exports use: a
``Sequence`` and a ``Fallback`` go on with the child that was running.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import product
from xml.etree import ElementTree as ET

import py_trees
import pytest
from py_trees.common import Status

from coordlang.execution.choices import choices
from coordlang.execution.task_language import TaskLanguage
from coordlang.exports.behaviour_tree import behaviour_trees
from coordlang.language.sentences import task_sentences
from planners.joint.model import IDLE, JointModel
from planners.joint.tables import Rows
from tests.support import naive
from tests.support.task_languages import random_task_languages, shipped

#: Shipped problems: two and three robots, shared actions, conditional choices, joint-action PDDL.
WORLDS = [
    *("t-map/problem", "grid/corners-3x3", "grid-joint/three-cells", "flags/parade"),
    *("charger/three-robots", "handover/two-doors", "lock/both-in"),
]
#: Mixtures of one sentence that are run, and sentences of one task.
MOST, SENTENCES = 30, 3
#: What a leaf does: its ports by name -> its status.
Leaf = Callable[[Mapping[str, str]], Status]


class Node(py_trees.behaviour.Behaviour):
    """A leaf that asks a function for its status."""

    def __init__(self, name: str, ask: Callable[[], Status]) -> None:
        super().__init__(name)
        self.ask = ask

    def update(self) -> Status:
        return self.ask()


def read_tree(xml: str, robot: str, leaves: Mapping[str, Leaf]) -> py_trees.trees.BehaviourTree:
    """The tree of this name, with ``leaves`` in place of the robot's own nodes, by their ID."""
    root = ET.fromstring(xml)
    assert root.tag == "root"
    assert root.get("BTCPP_format") == "4"
    names = [tree.get("ID") for tree in root.iter("BehaviorTree")]
    assert root.get("main_tree_to_execute") in names
    assert len(set(names)) == len(names)
    modelled = {
        leaf.get("ID"): {p.get("name") for p in leaf} for leaf in root.find("TreeNodesModel") or ()
    }
    (tree,) = [tree for tree in root.iter("BehaviorTree") if tree.get("ID") == robot]
    (child,) = tree
    blackboard: dict[str, int] = {}
    return py_trees.trees.BehaviourTree(node_of(child, leaves, modelled, blackboard))


def node_of(
    element: ET.Element,
    leaves: Mapping[str, Leaf],
    modelled: Mapping[str | None, set[str | None]],
    blackboard: dict[str, int],
) -> py_trees.behaviour.Behaviour:
    if element.tag in ("Sequence", "Fallback"):
        kind = {"Sequence": py_trees.composites.Sequence, "Fallback": py_trees.composites.Selector}
        found = kind[element.tag](element.get("name", ""), memory=True)
        found.add_children([node_of(child, leaves, modelled, blackboard) for child in element])
        return found
    ports = dict(element.attrib)
    if element.tag == "Script":
        name, value = ports["code"].split(" := ")

        def assign() -> Status:
            blackboard[name] = int(value)
            return Status.SUCCESS

        return Node("Script", assign)
    if element.tag == "ScriptCondition":
        name, value = ports["code"].split(" == ")
        return Node("ScriptCondition", lambda: status(blackboard[name] == int(value)))
    assert element.tag in ("Action", "Condition")
    own = ports.pop("ID")
    assert set(ports) <= modelled[own], "the model of each leaf has its ports"
    return Node(own, lambda: leaves[own](ports))


def status(holds: bool) -> Status:
    return Status.SUCCESS if holds else Status.FAILURE


class Team:
    """Robots whose trees are ticked in turn, joint step after joint step; an action takes two ticks."""

    def __init__(self, xml: str, model: JointModel, row: Rows) -> None:
        self.xml, self.model, self.row = xml, model, row
        self.step = 0
        self.wanted: list[str] = []
        self.begun: set[int] = set()
        self.done: dict[int, str] = {}
        self.false: set[str] = set()

    def leaves(self, robot: int, fails: str = "") -> dict[str, Leaf]:
        """The leaves of one robot; its action ``fails`` if it is named."""

        def awaits(ports: Mapping[str, str]) -> Status:
            return Status.SUCCESS if int(ports["step"]) <= self.step else Status.RUNNING

        def chooses(ports: Mapping[str, str]) -> Status:
            return status(ports["subaction"] == self.wanted[robot])

        def holds(ports: Mapping[str, str]) -> Status:
            true = self.model.state_text(self.row).replace(") (", ")\n(").split("\n")
            return status(ports["fact"] in true and ports["fact"] not in self.false)

        def acts(ports: Mapping[str, str]) -> Status:
            _, *arguments = ports["subaction"].strip("()").split()
            assert [ports[f"arg{n}"] for n in range(len(arguments))] == arguments
            if ports["subaction"] == fails:
                return Status.FAILURE
            assert robot not in self.done, "one subaction in a step"
            if robot not in self.begun:
                self.begun.add(robot)
                return Status.RUNNING
            self.done[robot] = ports["subaction"]
            return Status.SUCCESS

        actions = {text.strip("()").split()[0] for text in self.model.labels[robot][1:]}
        own: dict[str, Callable[[Mapping[str, str]], Status]] = dict.fromkeys(actions, acts)
        return own | {"AwaitStep": awaits, "Chooses": chooses, "Holds": holds}

    def run(self, subplans: Sequence[Sequence[str | None]]) -> list[tuple[str | None, ...]]:
        """What the robots do if each of them wants its subplan."""
        robots = range(len(self.model.robots))
        trees = [read_tree(self.xml, self.model.robots[r], self.leaves(r)) for r in robots]
        plan = []
        for self.step in range(len(subplans[0])):
            self.wanted = [own[self.step] or IDLE for own in subplans]
            self.begun, self.done = set(), {}
            for tree in trees:
                tree.tick()
                if tree.root.status == Status.RUNNING:
                    tree.tick()
                last = self.step == len(subplans[0]) - 1
                assert tree.root.status == (Status.SUCCESS if last else Status.RUNNING)
            plan.append(tuple(self.done.get(r) for r in robots))
            numbers = self.model.numbers(plan[-1])
            steps = self.model.successors(self.row[None, :])
            found = [
                n for n, labels in enumerate(steps.labels.tolist()) if tuple(labels) == numbers
            ]
            if not found:
                raise AssertionError(f"no joint step: {plan[-1]}")
            self.row = steps.result[found[0]]
        return plan


def own_subplans(
    task_language: TaskLanguage, words: tuple[int, ...]
) -> list[list[tuple[str | None, ...]]]:
    """Each robot's subplans, read off the listed plans that fit."""
    fits = task_language.plans_with(words)
    plans = [[fits.model.texts(step) for step in plan] for plan in naive.listed(fits, 0, 100_000)]
    return [
        sorted({tuple(step[r] for step in plan) for plan in plans}, key=str)
        for r in range(len(fits.model.robots))
    ]


def check_every_mixture(task_language: TaskLanguage, words: tuple[int, ...], xml: str) -> int:
    """Run all combinations of subplans; each robot does what it wants, and it is a plan that fits."""
    optimal = {
        tuple(task_language.model.texts(step) for step in plan)
        for plan in naive.listed(task_language.space, task_language.task, 100_000)
    }
    own = own_subplans(task_language, words)
    number = 0
    start = task_language.space.rows[task_language.space.state[task_language.start]]
    for mixture in product(*own):
        if number == MOST:
            break
        plan = Team(xml, task_language.model, start).run(mixture)
        assert [tuple(step[r] for step in plan) for r in range(len(own))] == list(mixture)
        assert tuple(plan) in optimal
        number += 1
    return number


def trees(task_language: TaskLanguage, words: tuple[int, ...]) -> str:
    return behaviour_trees(choices(task_language, words))


@pytest.mark.parametrize("name", WORLDS)
def test_every_mixture_is_an_optimal_plan(name: str) -> None:
    _, used = shipped(name)
    mixtures = 0
    for sentence in task_sentences(used.space, used.task, used.partition)[:SENTENCES]:
        words = used.words_of(sentence.words)
        mixtures += check_every_mixture(used, words, trees(used, words))
    assert mixtures >= 1


@pytest.mark.parametrize("robots", [2, 3])
def test_every_mixture_of_random_models(robots: int) -> None:
    several = 0
    for _, _, used in random_task_languages(robots, 12):
        for sentence in task_sentences(used.space, used.task, used.partition)[:SENTENCES]:
            words = used.words_of(sentence.words)
            found = choices(used, words)
            if found.guaranteed:  # random words: most sentences have plans that do not mix
                several += check_every_mixture(used, words, behaviour_trees(found)) > 1
    assert several >= 3


@pytest.mark.parametrize("fails", [False, True])
def test_a_robot_that_cannot_act_does_nothing_else(fails: bool) -> None:
    """A guard says that it is elsewhere, or its action fails: its tree fails, with nothing done."""
    _, used = shipped("three-cells/problem")
    model, start = used.model, used.space.rows[used.space.state[used.start]]
    team = Team(trees(used, used.words_of("w1 w0")), model, start)
    robot, name, action = (1, "r2", "(move r2 b a)") if fails else (0, "r1", "")
    team.wanted, team.false = [IDLE, action or IDLE], set() if fails else {"(at r1 a)"}
    tree = read_tree(team.xml, name, team.leaves(robot, fails=action))
    tree.tick()
    assert tree.root.status == Status.FAILURE
    assert not team.done


def test_the_tree_is_as_large_as_the_automaton() -> None:
    """The robot of the corners of 4x4 that has most subplans; a tree of all of them is larger."""
    _, used = shipped("grid/corners-4x4")
    sentence = task_sentences(used.space, used.task, used.partition)[0]
    words = used.words_of(sentence.words)
    found = choices(used, words)
    xml = ET.fromstring(behaviour_trees(found))
    edges = sum(int(own.automaton.out_degrees.sum()) for own in found.robots)
    scripts = [node for node in xml.iter("Script") if node.get("code", "").startswith("move")]
    assert len(scripts) == edges
