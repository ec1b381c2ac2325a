# SPDX-License-Identifier: GPL-3.0-or-later
"""Exported behaviour trees do exactly the robots' choices: every mixture is run with py_trees."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import product
from xml.etree import ElementTree as ET

import pytest
from py_trees.common import Status

from coordlang.execution.choices import choices
from coordlang.execution.task_language import TaskLanguage
from coordlang.exports.behaviour_tree import behaviour_trees
from coordlang.language.sentences import task_sentences
from planners.joint.model import IDLE, JointModel
from planners.joint.tables import Rows
from tests.support import naive
from tests.support.behaviour_trees import Leaf, read_tree
from tests.support.task_languages import random_task_languages, shipped

#: Shipped problems: two and three robots, shared actions, conditional choices, joint-action PDDL.
WORLDS = [
    *("t-map/problem", "grid/corners-4x4", "grid-joint/three-cells", "flags/parade"),
    *("charger/three-robots", "handover/exchange", "lock/both-in"),
]
#: Mixtures of one sentence that are run, and sentences of one task.
MOST, SENTENCES = 30, 3


class Team:
    """Robots whose trees are ticked in turn, joint step after joint step."""

    def __init__(self, xml: str, model: JointModel, row: Rows) -> None:
        self.xml, self.model, self.row = xml, model, row
        self.step = 0
        self.wanted: list[str] = []
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
            self.done = {}
            for tree in trees:
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


def status(holds: bool) -> Status:
    return Status.SUCCESS if holds else Status.FAILURE


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
    for _, _, used in random_task_languages(robots, 25):
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
