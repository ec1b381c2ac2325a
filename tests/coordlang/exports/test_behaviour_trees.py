# SPDX-License-Identifier: GPL-3.0-or-later
"""Exported behaviour trees do exactly the robots' choices: every mixture is run with py_trees.

The XML of BehaviorTree.CPP 4 is read as its documentation describes the nodes that exports use: a
``Sequence`` and a ``Fallback`` go on with the child that was running.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from contextlib import nullcontext, suppress
from dataclasses import replace
from itertools import islice
from random import Random
from xml.etree import ElementTree as ET

import py_trees
import pytest
from py_trees.common import Status

import coordlang as door
from coordlang.execution.choices import choices
from coordlang.execution.task_language import TaskLanguage
from coordlang.exports.behaviour_tree import behaviour_trees
from coordlang.language.words import Partition
from planners.joint.model import IDLE, JointModel
from planners.search.plans import Plan
from planners.system.errors import UsageError
from tests.support import naive, thorough
from tests.support.asynchronous import Event, World, random_plans, texts
from tests.support.domains import files_of
from tests.support.naive_choices import listed
from tests.support.task_languages import in_words, random_task_languages, shipped
from tests.support.texts import parsed

#: Shipped problems: two and three robots, shared actions, conditional choices, joint-action PDDL.
WORLDS = [
    *("t-map/problem", "grid/corners-3x3", "grid-joint/three-cells", "flags/parade"),
    *("charger/three-robots", "handover/two-doors", "lock/both-in"),
]
#: Mixtures of one sentence that are run, and sentences of one task.
MOST, SENTENCES = 30, 3
#: The status of a condition that holds or not, and of an action that is done or not.
HOLDS, DONE = ({True: Status.SUCCESS, False: no} for no in (Status.FAILURE, Status.RUNNING))
#: What a leaf does: its ports by name -> its status.
Leaf = Callable[[Mapping[str, str]], Status]


class Node(py_trees.behaviour.Behaviour):
    """A leaf that asks a function for its status."""

    def __init__(self, name: str, ask: Callable[[], Status]) -> None:
        super().__init__(name)
        self.ask = ask

    def update(self) -> Status:
        return self.ask()


def read_tree(
    xml: str, model: JointModel, number: int, acts: Leaf, **leaves: Leaf
) -> py_trees.trees.BehaviourTree:
    """A robot's tree, with these in place of its actions and of its own other nodes, by their ID."""
    robot, root = model.robots[number], ET.fromstring(xml)
    leaves |= {text.strip("()").split()[0]: acts for text in model.labels[number][1:]}
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
        return Node("ScriptCondition", lambda: HOLDS[blackboard[name] == int(value)])
    assert element.tag in ("Action", "Condition")
    own = ports.pop("ID")
    assert set(ports) <= modelled[own], "the model of each leaf has its ports"
    return Node(own, lambda: leaves[own](ports))


class Team:
    """Robots whose trees are ticked in turn, joint step after joint step; an action takes two ticks."""

    def __init__(self, xml: str, model: JointModel) -> None:
        self.xml, self.model = xml, model
        self.step = 0
        self.wanted: list[str] = []
        self.begun: set[int] = set()
        self.done: dict[int, str] = {}
        self.true: frozenset[str] = frozenset()

    def tree(self, robot: int, fails: str = "") -> py_trees.trees.BehaviourTree:
        """That of one robot; its action ``fails`` if it is named."""

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

        leaves: dict[str, Leaf] = {
            "AwaitStep": lambda ports: DONE[int(ports["step"]) <= self.step],
            "Chooses": lambda ports: HOLDS[ports["subaction"] == self.wanted[robot]],
            "Holds": lambda ports: HOLDS[ports["fact"] in self.true],
        }
        return read_tree(self.xml, self.model, robot, acts, **leaves)

    def run(self, plan: Plan, states: list[frozenset[str]]) -> None:
        """Each robot wants its part of the plan, and does it."""
        robots = range(len(self.model.robots))
        trees = [self.tree(robot) for robot in robots]
        for self.step, step in enumerate(plan):
            self.wanted = [text or IDLE for text in self.model.texts(step)]
            self.true, self.begun, self.done = states[self.step], set(), {}
            for tree in trees:
                tree.tick()
                if tree.root.status == Status.RUNNING:
                    tree.tick()
                last = self.step == len(plan) - 1
                assert tree.root.status == (Status.SUCCESS if last else Status.RUNNING)
            assert [self.done.get(robot, IDLE) for robot in robots] == self.wanted


def run_every_mixture(used: TaskLanguage) -> int:
    """Of the first sentences; the largest number of mixtures of one of them."""
    most = 0
    for words, twin in islice(listed(used, 1000, 1000), SENTENCES):
        found = choices(used, words)
        if not found.guaranteed:  # random words: most sentences have plans that do not mix
            continue
        xml = behaviour_trees(found)
        for chosen, plan in islice(twin.mixed.items(), MOST):
            assert plan in twin.optimal
            Team(xml, used.model).run(plan, twin.facts[chosen])
        most = max(most, len(twin.mixed))
        # A tree is as large as the automaton: one that lists the subplans is larger.
        edges = sum(sum(map(len, own.moves)) for own in found.robots)
        scripts = [node.get("code", "") for node in ET.fromstring(xml).iter("Script")]
        assert sum(code.startswith("move") for code in scripts) == edges
    return most


@pytest.mark.parametrize("name", WORLDS)
def test_every_mixture_is_an_optimal_plan(name: str) -> None:
    assert run_every_mixture(shipped(name)[1]) >= 1


@pytest.mark.parametrize("robots", [2, 3])
def test_every_mixture_of_random_models(robots: int) -> None:
    several = 0
    for _, _, used in random_task_languages(robots, 12):
        with suppress(naive.TooLarge):
            several += run_every_mixture(used) > 1
    assert several >= 2


#: Other names in the three cells, and then the IDs of the trees and of the leaf; none: refused.
NAMES: list[tuple[dict[str, str], list[str]]] = [
    ({"w0": "a--b<&", "w1": "---"}, ["r1", "r2", "move"]),
    ({"w0": "-", "w1": "---", "w2": "w--"}, ["r1", "r2", "move"]),
    ({"w1": "a--b<&"}, ["r1", "r2", "move"]),
    ({"r1": "a.b", "r2": "a_b", "move": "a/b"}, ["a_b__", "a_b", "a_b_"]),
    ({"r1": "move", "r2": "root"}, ["move_", "root_", "move"]),
    ({"a": "{a}"}, []),
]


@pytest.mark.parametrize(("names", "ids"), NAMES)
def test_names_that_readers_would_misread(names: dict[str, str], ids: list[str]) -> None:
    """Two hyphens end a comment; IDs are of few characters, and apart; braces: a blackboard."""
    texts = (path.read_text() for path in files_of("three-cells"))
    files = parsed(*(re.sub(r"\w+", lambda m: names.get(m[0], m[0]), text) for text in texts))
    language = door.build(*files, method="greedy").language
    used: TaskLanguage = door.explain(language, *files).used
    words = tuple(names.get(word, word) for word in used.partition.words)
    used = replace(used, partition=replace(used.partition, words=words))
    found = choices(used, (1, 0))
    refused = pytest.raises(UsageError, match="an entry of a blackboard")
    with nullcontext() if ids else refused:
        root = ET.fromstring(behaviour_trees(found))
        assert [tree.get("ID") for tree in root.iter("BehaviorTree")] == ids[:2]
        assert root.get("main_tree_to_execute") == ids[0]
        assert {node.get("ID") for node in root.iter("Action")} == {"AwaitStep", ids[2]}


@pytest.mark.parametrize("fails", [False, True])
def test_a_robot_that_cannot_act_does_nothing_else(fails: bool) -> None:
    """A guard says that it is elsewhere, or its action fails: its tree fails, with nothing done."""
    _, used = shipped("three-cells/problem")
    team = Team(behaviour_trees(choices(used, used.words_of("w1 w0"))), used.model)
    robot, action = (1, "(move r2 b a)") if fails else (0, "")
    start = used.space.rows[used.space.state[used.start]]
    team.true = frozenset(used.model.codec.decode(start)) - ({"(at r1 a)"} if not fails else set())
    team.wanted = [IDLE, action or IDLE]
    tree = team.tree(robot, fails=action)
    tree.tick()
    assert tree.root.status == Status.FAILURE
    assert not team.done


class FreeTeam:
    """Robots without a common step: their trees are ticked in any order; an action takes two ticks."""

    def __init__(self, xml: str, world: World, wanted: Sequence[Sequence[Event]]) -> None:
        self.xml, self.world, self.wanted = xml, world, wanted
        self.model = world.model
        self.texts = texts(self.model, tuple(map(tuple, wanted)))
        self.done: list[list[str]] = [[] for _ in wanted]
        self.begun: set[int] = set()
        self.ready: dict[int, tuple[int, str]] = {}

    def label(self, robot: int, text: str) -> int:
        return self.model.labels[robot].index(text)

    def tree(self, robot: int) -> py_trees.trees.BehaviourTree:
        names = self.model.robots

        def chooses(ports: Mapping[str, str]) -> Status:
            own, k = self.texts[robot], len(self.done[robot])
            return HOLDS[ports["subaction"] == (own[k] if k < len(own) else IDLE)]

        def ended(ports: Mapping[str, str]) -> Status:
            other, own = names.index(ports["robot"]), self.label(robot, ports["subaction"])
            met = sum(
                self.world.interfere(robot, own, other, self.label(other, text))
                for text in self.done[other]
            )
            return DONE[met >= int(ports["count"])]

        def partner(ports: Mapping[str, str]) -> Status:
            other = names.index(ports["robot"])
            self.ready[robot] = len(self.done[robot]), ports["subaction"]
            number, does = self.ready.get(other, (-1, ""))
            is_ready = does == ports["does"] and number >= len(self.done[other]) - 1
            return DONE[is_ready]

        def acts(ports: Mapping[str, str]) -> Status:
            if robot not in self.begun:
                self.begun.add(robot)
                return Status.RUNNING
            self.begun.remove(robot)
            self.done[robot].append(ports["subaction"])
            return Status.SUCCESS

        leaves: dict[str, Leaf] = {"AwaitEnded": ended, "AwaitPartner": partner}
        leaves |= {"Chooses": chooses, "Holds": lambda _: Status.SUCCESS}
        return read_tree(self.xml, self.model, robot, acts, **leaves)

    def run(self, random: Random) -> None:
        trees = [self.tree(robot) for robot in self.world.robots]
        for _ in range(200 * len(trees)):
            tree = random.choice(trees)
            if tree.root.status != Status.SUCCESS:
                tree.tick()
            assert tree.root.status != Status.FAILURE
        assert all(tree.root.status == Status.SUCCESS for tree in trees), "somebody waits for ever"
        assert self.done == [
            [self.model.labels[robot][event.label] for event in own]
            for robot, own in enumerate(self.wanted)
        ]


@pytest.mark.parametrize(
    ("robots", "seeds"), [(2, range(20)), (3, range(8)), *thorough((2, range(20, 80)))]
)
def test_trees_without_a_common_step_do_every_mixture(robots: int, seeds: range) -> None:
    several = 0
    for world, space, plans, made, random in random_plans(robots, seeds, 30):
        table = Partition.of_states(space.rows, dict.fromkeys(range(len(space.rows)), 0))
        found = choices(in_words(None, table, made, 0), (0,))
        if not found.guaranteed:
            continue
        xml = behaviour_trees(found)
        for parts, _ in islice(plans.mixtures_of([*plans.states]), 3):
            FreeTeam(xml, world, parts).run(random)
            several += len(plans.states) > 1
    assert several >= 3
