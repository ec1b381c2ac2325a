# SPDX-License-Identifier: GPL-3.0-or-later
"""The run-time monitor and its files, against own subplans and mixtures, all listed."""

from __future__ import annotations

import json
from collections import Counter
from random import Random
from typing import Any

import pytest

from coordlang.execution.choices import SentenceChoices, choices, to_bytes
from coordlang.execution.monitor import EventMonitor, Monitor, MonitorError, NotAllowed, NotPossible
from coordlang.execution.task_language import TaskLanguage
from tests.support.naive_choices import Detour, Known, Listed, Own
from tests.support.task_languages import RUNS, in_built_languages, shipped, with_twins


@pytest.fixture(scope="module")
def three_cells() -> SentenceChoices:
    task_language = shipped("three-cells/problem")[1]
    return choices(task_language, task_language.words_of("w1 w0"))


def monitor_of(found: SentenceChoices, robot: str) -> Monitor:
    return Monitor(json.loads(to_bytes(found)), robot)


def texts(task_language: TaskLanguage, robot: int, own: Own) -> list[str | None]:
    return [task_language.model.labels[robot][label] if label else None for label in own]


def random_detour(
    random: Random, task_language: TaskLanguage, robot: int, left: set[Own], known: dict[Own, Known]
) -> Detour:
    """What tells two subplans apart, or anything; of each kind none, one or two."""
    one, other = random.choice(sorted(left)), random.choice(sorted(left))

    def some(of: set[str], elsewhere: set[str]) -> tuple[str, ...]:
        telling = sorted(of - elsewhere if random.random() < 0.7 else of | elsewhere)
        return tuple(random.sample(telling, min(len(telling), random.choice([0, 0, 0, 1, 1, 2]))))

    def done(own: Own) -> set[str]:
        found = {text or "idle" for text in texts(task_language, robot, own)}
        return found | (
            {f"{text.rsplit(' ', 1)[0]} *)" for text in found if " " in text}
            if random.random() < 0.3
            else set()
        )

    def along(own: Own, value: int) -> list[frozenset[str]]:
        return [known[own[:step]][value] for step in range(len(own) + 1)]

    def visited(own: Own) -> set[str]:
        return set().union(*along(own, 0))

    def avoided(own: Own) -> set[str]:
        return set(task_language.model.codec.facts.texts).intersection(*along(own, 1))

    anything = set(task_language.model.codec.facts.texts)
    if random.random() < 0.3:  # also what is never known
        return Detour(some(anything, set()), some(anything, set()))
    return Detour(
        some(visited(one), visited(other)),
        some(avoided(one), avoided(other)),
        some(done(one), done(other)),
        some(done(other), done(one)),
    )


def subplans(at: Monitor) -> set[tuple[str | None, ...]]:
    """All that a monitor allows from where it is, found by stepping copies of it through."""
    if at.finished:
        return {()}
    return {(text, *rest) for text in at.allowed() for rest in subplans(stepped(at, text))}


def stepped(at: Monitor, text: str | None) -> Monitor:
    after = at.copy()
    after.did(text)
    return after


@pytest.mark.parametrize(("robots", "models"), RUNS)
def test_detours_against_the_definition(robots: int, models: int) -> None:
    """After a random beginning, two detours in turn: asked, then promised, then walked."""
    seen: Counter[str] = Counter()
    for seed, task_language, words, twin in with_twins(in_built_languages, robots, models):
        random = Random(seed)
        data = json.loads(to_bytes(choices(task_language, words)))
        for robot, name in enumerate(task_language.model.robots):
            known = twin.knows(robot)
            for _ in range(8 if len(twin.own[robot]) > 1 else 1):
                check_detours(random, task_language, twin, Monitor(data, name), robot, known, seen)
    assert min(seen["possible"], seen["impossible"], seen["less is left"]) >= models, seen


def check_detours(
    random: Random,
    task_language: TaskLanguage,
    twin: Listed,
    at: Monitor,
    robot: int,
    known: dict[Own, Known],
    seen: Counter[str],
) -> None:
    """Promise, step, promise again: answers, witnesses, counts, choices are by definition."""
    left = set(twin.own[robot])
    here = 0
    for _ in range(2):
        chosen = random.choice(sorted(left))
        stop = random.choice([here, random.randint(here, len(chosen))])
        for label in chosen[here:stop]:
            at.did(task_language.model.labels[robot][label] if label else None)
        here = stop
        left = {own for own in left if own[:here] == chosen[:here]}
        true, false = known[chosen[:here]]
        for fact in task_language.model.codec.facts.texts:
            said = at.known(fact)
            assert (said is True, said is False) == (fact in true, fact in false), fact
        detour = random_detour(random, task_language, robot, left, known)
        expected = twin.fulfilling(robot, chosen[:here], detour, known) & left
        answer = at.can(**detour._asdict())
        assert bool(answer) == bool(expected)
        assert answer.subplans == len(expected)
        seen["possible" if expected else "impossible"] += 1
        before = (at.allowed(), at.remaining, at.step)
        if not expected:
            assert answer.subplan is None
            with pytest.raises(NotPossible):
                at.commit(**detour._asdict())
            assert (at.allowed(), at.remaining, at.step) == before
            continue
        assert answer.subplan in {
            tuple(texts(task_language, robot, own[here:])) for own in expected
        }
        at.commit(**detour._asdict())
        assert at.remaining == len(expected)
        assert subplans(at) == {tuple(texts(task_language, robot, own[here:])) for own in expected}
        seen["less is left"] += len(expected) < len(left)
        left = expected


def test_monitor_by_hand(three_cells: SentenceChoices) -> None:
    at = monitor_of(three_cells, "r2")
    assert (at.robot, at.sentence, at.atoms) == ("r2", "w1 w0", "exact")
    assert (at.step, at.remaining, at.finished) == (0, 2, False)
    assert at.allowed() == (None, "(move r2 b a)")
    assert at.known("(at r2 b)") is True
    assert not at.can(never=None)
    assert at.can(do=["idle", "(move r2 * a)"]).subplans == 2
    with pytest.raises(
        NotAllowed,
        match=r"step 1: r2 may not do \(move r2 b c\); it may do idle or \(move r2 b a\)",
    ) as caught:
        at.did("(move r2 b c)")
    assert (caught.value.step, caught.value.allowed) == (0, (None, "(move r2 b a)"))
    assert (at.step, at.remaining) == (0, 2)
    at.did(" ( MOVE r2  b a )")
    assert (at.step, at.remaining) == (1, 1)
    assert at.known("(at r2 a)") is True
    assert at.known("(at r1 c)") is True
    assert at.allowed() == (None,)
    with pytest.raises(NotAllowed, match=r"step 2: r2 may not do \(move r2 a b\); it may do idle"):
        at.did("(move r2 a b)")
    at.did("idle")
    assert at.finished
    assert at.allowed() == ()
    with pytest.raises(NotAllowed, match="step 3: r2 may not do idle; all its steps are done"):
        at.did(None)


def test_messages(three_cells: SentenceChoices) -> None:
    at = monitor_of(three_cells, "r1")
    for ask, said in (
        (lambda: at.can(visit="(at r9 a)"), r"\(at r9 a\) is no atom .*: there are \(at r1 a\), "),
        (lambda: at.commit(never="(move r1 a c)"), "step 1: r1 has no subplan left for this$"),
        (
            lambda: Monitor(json.loads(to_bytes(three_cells)), "r7"),
            "no choices of r7; it has those of r1, r2",
        ),
        (lambda: Monitor(json.loads(to_bytes(three_cells))), "whose choices"),
        (lambda: EventMonitor(json.loads(to_bytes(three_cells)), "r1"), "are for a Monitor"),
    ):
        with pytest.raises(MonitorError, match=said):
            ask()
    with pytest.raises(TypeError, match="seen"):
        at.can(seen="(at r1 a)")  # type: ignore[call-arg]
    at.commit(do="(move r1 a c)")
    with pytest.raises(NotPossible, match="together with what was promised before"):
        at.commit(never="(move *)")


def crossings(number: int) -> dict[str, Any]:
    """So many steps, in each of which the robot goes left or right; atoms say where it went."""
    facts = [f"(at{step} {side})" for step in range(number) for side in ("left", "right")]
    states: list[dict[str, Any]] = [{"step": 0, "left": 2**number, "true": [], "unknown": []}]
    for step in range(number):
        states += [
            {"step": step + 1, "left": 2 ** (number - step - 1), "true": [fact], "unknown": []}
            for fact in (2 * step, 2 * step + 1)
        ]
    for state in states:
        first = 2 * state["step"] + 1
        sides = enumerate(("(go left)", "(go right)"), first)
        state["next"] = {text: to for to, text in sides if to < len(states)}
    entry = {"robot": "r", "atoms": "exact", "facts": facts, "others": [], "states": states}
    return {"format": "coordlang/choices", "version": 1, "sentence": "w0", "choices": [entry]}


def test_detours_with_too_many_visits_are_refused_and_change_nothing() -> None:
    """Every set of the visits may be made at a time: twice as many with each further visit."""
    few = [f"(at{step} left)" for step in range(9)]
    assert Monitor(crossings(9)).can(visit=few).subplans == 1
    robot = Monitor(crossings(20))
    assert robot.can(visit=20 * few).subplans == 2**11
    many = [f"(at{step} left)" for step in range(20)]
    with pytest.raises(MonitorError, match=r"20 visits and dos at once .* more than 262,144"):
        robot.commit(visit=many)
    assert robot.remaining == 2**20
    for atom in many:  # one after the other they are kept
        robot.commit(visit=atom)
    assert robot.remaining == 1
