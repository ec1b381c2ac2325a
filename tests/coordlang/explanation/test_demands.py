# SPDX-License-Identifier: GPL-3.0-or-later
"""What a sentence asks, against a list of its plans."""

from __future__ import annotations

import json
from collections import Counter
from itertools import product
from random import Random

import numpy as np
import pytest

from benchmarks.paper.task_choices import languages_in_tasks
from coordlang.execution.best_sentence import leading_sentences
from coordlang.execution.task_language import TaskLanguage
from coordlang.explanation.demands import RobotPart, SentenceDemands, meaning, sentence_demands
from coordlang.explanation.text import demands_text
from coordlang.explanation.words import all_covers, mapped_states
from coordlang.language.candidates import from_problems
from coordlang.language.sentences import task_sentences
from planners.search.plan_space import PlanSpace
from planners.search.plans import Plan, Plans
from tests.support import naive, thorough
from tests.support.candidates import random_candidates
from tests.support.command import Command
from tests.support.domains import T_MAP, all_tasks
from tests.support.task_languages import built_for, language_of, random_language
from tests.support.texts import parsed


def check(
    task_language: TaskLanguage,
    words: tuple[int, ...],
    plans: list[Plan],
    found: SentenceDemands,
    few: int,
) -> None:
    model = task_language.model
    assert found.sentence == tuple(task_language.partition.words[w] for w in words)
    assert (found.plans, found.steps) == (len(plans), len(plans[0]))
    for robot, part in enumerate(found.parts):
        # The texts here still have the robot's name and the parentheses.
        texts = {tuple(model.texts(step)[robot] for step in plan) for plan in plans}
        assert part.subplans == len(texts)
        assert len(part.listed) == (len(texts) if len(texts) <= few else 0)
        short = {tuple(t and own_text(t, model.robots[robot]) for t in text) for text in texts}
        assert len(texts) > few or set(map(tuple, part.listed)) == short
        assert [set(own) for own in part.by_step] == [
            set(step) for step in zip(*short, strict=True)
        ]
    assert [(c.before, c.after) for c in found.changes] == list(
        zip(found.sentence, found.sentence[1:], strict=False)
    )
    space = task_language.space
    word = task_language.partition.word_of(space.rows)
    steps: list[set[int]] = [set() for _ in found.changes]
    for plan in plans:
        said = [int(word[s]) for s in naive.states(space, task_language.task, plan)]
        for number, step in enumerate(k for k in range(1, len(said)) if said[k] != said[k - 1]):
            steps[number].add(step)
    assert [(c.earliest, c.latest) for c in found.changes] == [(min(s), max(s)) for s in steps]
    assert [set().union(*(way.steps for way in c.ways)) for c in found.changes] == steps


def own_text(label: str, robot: str) -> str:
    return label.strip("()").replace(f" {robot} ", " ").removesuffix(f" {robot}")


@pytest.mark.parametrize("robots", [2, *thorough(3)])
def test_against_listed_plans(robots: int, monkeypatch: pytest.MonkeyPatch) -> None:
    few = 2
    monkeypatch.setattr("coordlang.explanation.demands.FEW", few)
    monkeypatch.setattr("coordlang.explanation.demands._STATES", 1)
    seen: Counter[str] = Counter()
    for seed, candidates in random_candidates(range(20), robots, 300):
        # A coordination language or not: what is asked is about listed plans.
        language = random_language(Random(seed), candidates)
        formulas = all_covers(mapped_states(language.partition(candidates.model), candidates.model))
        for task_language in list(languages_in_tasks(language, candidates))[:40]:
            try:
                groups = naive.numbered_sentences(task_language, 60)
            except naive.TooLarge:
                continue
            for words, plans in groups.items():
                fits = task_language.plans_with(words)
                found = sentence_demands(fits, task_language.partition, formulas)
                check(task_language, words, plans, found, few)
                assert demands_text(found)
                seen["changes"] += len(found.changes) > 0
                seen["many subplans"] += any(p.subplans > few for p in found.parts)
                for number, change in enumerate(found.changes):
                    before = states_before(fits, task_language, number)
                    own = [task_language.model.robots.index(r) for r in change.robots]
                    assert settled(task_language, before, words[number + 1], own)
                    seen[f"{len(change.robots)} decide"] += 1
    assert all(seen[case] for case in ("changes", "many subplans", "1 decide", "2 decide")), seen


@pytest.mark.parametrize(
    ("folder", "stem", "every"), [("t-map", "problem", 3), ("grid", "gw2-2x3", 100)]
)
def test_who_decides_a_change(folder: str, stem: str, every: int) -> None:
    """Before the change these robots' subactions always settle it; no smaller set of robots does."""
    candidates, language = all_tasks(folder, stem), built_for(folder, stem, "greedy").language
    formulas = all_covers(mapped_states(language.partition(candidates.model), candidates.model))
    sizes: Counter[int] = Counter()
    for task_language in list(languages_in_tasks(language, candidates))[::every]:
        for words in naive.numbered_sentences(task_language, 1000):
            fits = task_language.plans_with(words)
            found = sentence_demands(fits, task_language.partition, formulas)
            for number, change in enumerate(found.changes):
                before = states_before(fits, task_language, number)
                robots = [task_language.model.robots.index(r) for r in change.robots]
                assert settled(task_language, before, words[number + 1], robots)
                for left_out in robots:
                    fewer = [robot for robot in robots if robot != left_out]
                    assert not settled(task_language, before, words[number + 1], fewer)
                sizes[len(robots)] += 1
    assert sizes[1], sizes
    assert sizes[2], sizes


def states_before(fits: object, task_language: TaskLanguage, number: int) -> set[int]:
    """The states just before a plan's change of word ``number``, by following all plans."""
    found = set()
    word = task_language.partition.word_of(task_language.space.rows)
    plans = Plans.of(fits)  # type: ignore[arg-type]
    for plan in plans:
        states = plans.states(plan)
        changes = [k for k in range(1, len(states)) if word[states[k]] != word[states[k - 1]]]
        found.add(states[changes[number] - 1])
    return found


def settled(task_language: TaskLanguage, states: set[int], after: int, robots: list[int]) -> bool:
    codec, rows = task_language.model.codec, task_language.space.rows
    mapped = {*task_language.language.states, *map(codec.key, rows)}
    for state in states:
        answer: dict[tuple[int, ...], bool] = {}
        steps = task_language.model.successors(rows[[state]])
        for labels, result in zip(steps.labels.tolist(), steps.result, strict=True):
            if codec.key(result) not in mapped:
                continue
            own = tuple(labels[r] for r in robots)
            makes = int(task_language.partition.word_of(np.array([result]))[0]) == after
            if answer.setdefault(own, makes) != makes:
                return False
    return True


@pytest.mark.parametrize(
    ("number", "said"),
    [
        (18, "r1 has 18 ways, any combination of:\n    step 1: wait or (wait)\n"),
        (15, "r1 has 15 ways, not every combination of these (choices lists them):"),
    ],
)
def test_many_ways_in_plain_sentences(number: int, said: str) -> None:
    """Few ways stand in docs/tutorial.md."""
    part = RobotPart("r1", number, [], [[None, "wait"], ["c", "d", "e"], ["f", "g", "h"]])
    assert said in demands_text(SentenceDemands(("w0",), 5, 3, [part], []))


def test_json(coordlang: Command, language: object) -> None:
    data = json.loads(coordlang("explain", language, *T_MAP, "--task", "--json").out)
    assert data["told"]["rules"][-1]["text"] is None
    assert {word: formula["states"] for word, formula in data["formulas"].items()} == data["words"]
    assert data["formulas"]["w0"]["pddl"] == "(and (not (at r1 c1-1)) (not (at r2 c1-1)))"
    assert sum(s["plans"] for s in data["sentences"]) == 2
    refused = coordlang("explain", language, *T_MAP, "--task", "--sentence", "w3 w0")
    assert (refused.code, "no optimal plan has the sentence" in refused.err) == (1, True)
    for said in data["sentences"]:
        words = [said["changes"][0]["from"], *(change["to"] for change in said["changes"])]
        assert said["sentence"].split() == words
        assert [len(robot["listed"][0]) for robot in said["robots"]] == [said["steps"]] * 2


def first_users(space: PlanSpace, name: str) -> set[tuple[str, ...]]:
    """Who uses an object first, mixture by mixture."""
    found = set()
    plans = [zip(*map(space.model.texts, plan), strict=True) for plan in Plans.of(space, 0)]
    for mixture in product(*map(set, zip(*plans, strict=True))):
        users: tuple[str, ...] = ()
        for step in zip(*mixture, strict=True):
            texts = zip(space.model.robots, step, strict=True)
            users = tuple(r for r, text in texts if name in (text or "").strip("()").split()[1:])
            if users:
                break
        found.add(users)
    return found


def test_which_sentences_lead_and_what_they_mean_against_listed_plans() -> None:
    seen: Counter[bool] = Counter()
    for seed, candidates in random_candidates(range(60), 2, 300):
        language = random_language(Random(seed), candidates)
        for used in list(languages_in_tasks(language, candidates))[:20]:
            said = leading_sentences(used, 4)
            every = task_sentences(used.space, used.task, used.partition, used.plans_with)
            assert said == [(used.words_of(one.words), one.plans) for one in every[:4]]
            if len(said) < 2:
                continue
            spaces = [used.plans_with(words) for words, _ in said]
            names = candidates.loaded.problems[0].objects.keys() - {*used.model.robots}
            answers = {name: [first_users(space, name) for space in spaces] for name in names}
            meant = {
                name: [*map(min, own)]
                for name, own in answers.items()
                if all(len(one) == 1 for one in own) and len({*map(min, own)}) == len(own)
            }
            found = meaning(spaces)
            assert (found is not None) == bool(meant)
            assert found is None or meant[found[0]] == found[1]
            seen[found is not None] += 1
    assert seen[True] > 2
    assert seen[False] > 1


def test_mixtures_agree_about_what_sentences_mean() -> None:
    """In each plan of w1 both use x at once; in mixtures of these plans one of them is first."""
    domain, problem = parsed(
        """(define (domain use) (:types robot thing) (:predicates (used ?r - robot ?x - thing))
        (:action use :parameters (?r - robot ?x - thing)
         :precondition (not (used ?r ?x)) :effect (used ?r ?x)))""",
        """(define (problem both) (:domain use) (:objects r1 r2 - robot x y - thing) (:init)
        (:goal (and (used r1 x) (used r1 y) (used r2 x) (used r2 y))))""",
    )
    middle = {"(used r1 x) (used r2 x)": "w1", "(used r1 y) (used r2 y)": "w1"}
    language = language_of({**middle, "(used r1 x) (used r2 y)": "w2"}, ("w0", "w1", "w2"))
    used = next(iter(languages_in_tasks(language, from_problems(domain, [problem]))))
    together, r1_first, r2_first = map(used.plans_with, ((0, 1, 0), (0, 2, 0), (0,)))
    assert meaning([r1_first, r2_first]) == ("x", [("r1",), ("r2",)])
    assert meaning([together, r1_first, r2_first]) is None
