# SPDX-License-Identifier: GPL-3.0-or-later
"""A robot's choices by definition: all combinations are optimal, no subplan is left out; their automata."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from itertools import accumulate, pairwise, product
from random import Random

import pytest

from benchmarks.paper.task_choices import languages_in_tasks
from coordlang.commands.building import build_language
from coordlang.execution.automaton import Automaton, determinise
from coordlang.execution.choices import SentenceChoices, choices, monitor, own_changes
from coordlang.execution.task_language import TaskLanguage
from coordlang.language.candidates import from_problems
from planners.pddl.lifted import TRUE
from planners.search.plans import Plans
from planners.system.errors import OutOfMemory
from tests.support import naive
from tests.support.domains import read
from tests.support.naive_choices import Listed, accepted, listed
from tests.support.random_spaces import layered_space
from tests.support.task_languages import (
    RUNS,
    in_built_languages,
    in_random_words,
    sentence_of,
    shipped,
    with_twins,
)


def moves(automaton: Automaton) -> list[dict[int, int]]:
    return [dict(own) for own in automaton.moves]


def check_automata(found: SentenceChoices, twin: Listed) -> None:
    """Each accepts just the robot's own parts, and is the least that knows what it knows."""
    facts = found.task_language.model.codec.facts.texts
    for automaton, parts in zip(found.robots, twin.own, strict=True):
        assert accepted(moves(automaton)) == parts
        assert automaton.count == len(parts)
        for state in range(len(automaton)):
            labels = list(automaton.moves[state])
            assert labels == sorted(set(labels))
        plain = determinise(found.fits, automaton.robot)
        assert accepted(moves(plain)) == parts
        assert len(plain) == twin.least(automaton.robot)
        if automaton.atoms == "exact":
            known = twin.knows(automaton.robot)
            assert len(automaton) == twin.least(automaton.robot, known)
        for part in parts:
            state = 0
            for step in range(len(part) + 1):
                assert state in automaton.layers[step]
                true, unknown = automaton.known[state]
                said = (
                    frozenset(f for n, f in enumerate(facts) if true >> n & 1),
                    frozenset(f for n, f in enumerate(facts) if not (true | unknown) >> n & 1),
                )
                if automaton.atoms == "exact":
                    assert said == known[part[:step]]
                if step < len(part):
                    state = automaton.moves[state][part[step]]


def check_combinations(found: SentenceChoices, twin: Listed) -> None:
    """Every combination, stepped through all monitors, is an optimal plan; no others go through."""
    labels = found.task_language.model.labels
    for chosen in product(*(accepted(moves(own)) for own in found.robots)):
        monitors = [monitor(found.fits, own, "") for own in found.robots]
        for step in zip(*chosen, strict=True):
            for number, (at, label) in enumerate(zip(monitors, step, strict=True)):
                text = labels[number][label] if label else None
                assert text in at.allowed()
                at.did(text)
        assert all(at.finished and at.allowed() == () for at in monitors)
        plan = tuple(zip(*chosen, strict=True))
        assert plan in twin.optimal, "a combination of choices is no optimal plan"


@pytest.mark.parametrize(("robots", "models"), RUNS)
def test_every_combination_is_optimal(robots: int, models: int) -> None:
    seen: Counter[str] = Counter()
    stepped: Counter[int] = Counter()
    for seed, task_language, words, twin in with_twins(in_built_languages, robots, models):
        found = choices(task_language, words)
        assert found.guaranteed
        assert found.mixtures is not None
        assert Plans.of(found.mixtures).count == twin.combinations
        assert all(own.atoms == "exact" for own in found.robots)
        check_automata(found, twin)
        seen["several for two"] += sum(len(own) > 1 for own in twin.own) > 1
        seen["several for all"] += all(len(own) > 1 for own in twin.own)
        seen["another sentence"] += twin.combinations > len(twin.plans)
        seen["knowledge splits"] += any(
            len(own) > len(determinise(found.fits, own.robot)) for own in found.robots
        )
        if twin.combinations > 1 and stepped[seed] < 200:
            check_combinations(found, twin)
            stepped[seed] += twin.combinations
            seen["stepped"] += twin.combinations
    assert seen["several for two"] >= models / 4, seen
    assert seen["several for all"] >= models // 20, seen
    assert seen["another sentence"] >= models // 50, seen
    assert seen["knowledge splits"] >= models / 10, seen


@pytest.mark.parametrize(("robots", "models"), RUNS)
def test_a_broken_language_is_found_out(robots: int, models: int) -> None:
    """Under any partition the walk agrees with the list; if it says no, the above fails."""
    seen: Counter[bool] = Counter()
    for _, task_language, words, twin in with_twins(in_random_words, robots, models):
        found = choices(task_language, words)
        assert found.walked is not None
        assert (found.witness is None) == found.guaranteed == twin.mixes
        seen[twin.mixes] += 1
        if not twin.mixes:
            assert all(own.atoms == "own" for own in found.robots)
            check_violation(found, twin)
            check_automata(found, twin)
            with pytest.raises(AssertionError, match="no optimal plan"):
                check_combinations(found, twin)
    assert min(seen[True], seen[False]) >= models / 4, seen


def check_violation(found: SentenceChoices, twin: Listed) -> None:
    """The plans shown have the sentence, and their mixture breaks where it says."""
    shown = found.witness
    assert shown is not None
    model = found.task_language.model
    followed = tuple(
        tuple(naive.known(model.numbers(step)) for step in plan) for plan in shown.plans
    )
    assert set(followed) <= set(twin.plans)
    mixed = naive.mixture(followed)
    assert mixed not in twin.optimal
    steps = tuple(naive.known(model.numbers(step)) for step in shown.mixture)
    assert steps == mixed[: len(steps)]
    assert not any(plan[: len(steps)] == steps for plan in twin.optimal)
    assert any(plan[: len(steps) - 1] == steps[:-1] for plan in twin.optimal)


@pytest.mark.parametrize(("robots", "models"), RUNS)
def test_own_atoms_are_known(robots: int, models: int) -> None:
    """What the own subactions say is true in every mixture, and nothing else is said."""
    seen: Counter[str] = Counter()
    for _, task_language, words, twin in with_twins(in_random_words, robots, models):
        if not twin.mixes:
            continue
        found = choices(task_language, words, most=0)
        if len(found.robots[0].layers) > 1:
            assert found.walked is None
            check_automata(found, twin)
            for own in found.robots:
                check_own_atoms(task_language, own, twin, seen)
    assert min(seen["true"], seen["false"], seen["unknown"]) >= 100, seen


def check_own_atoms(
    task_language: TaskLanguage, own: Automaton, twin: Listed, seen: Counter[str]
) -> None:
    assert own.atoms == "own"
    known = twin.knows(own.robot)
    mask, _ = own_changes(task_language.model, own.robot)
    facts = task_language.model.codec.facts.texts
    for part in twin.own[own.robot]:
        state = 0
        for step, label in enumerate((*part, None)):
            true, unknown = own.known[state]
            for number, fact in enumerate(facts):
                says = ("false", "true", "unknown")[(true >> number & 1) - (unknown >> number & 1)]
                seen[says] += 1
                assert (says == "unknown") == (not mask >> number & 1)
                assert says == "unknown" or fact in known[part[:step]][says == "false"]
            if label is not None:
                state = own.moves[state][label]


WORLDS = "handover/three-rooms", "two-arms/exchange", "lock/three-robots", "elevator/same-floor"


@pytest.mark.parametrize("name", WORLDS)
def test_shipped_domains(name: str) -> None:
    """With subactions that are shared, and what random models lack."""
    task_language = shipped(name)[1]
    try:
        twins = list(listed(task_language, 2000, 3000))
    except naive.TooLarge:
        words = task_language.words_of(sentence_of(task_language))
        assert choices(task_language, words).guaranteed
        return
    for words, twin in twins[:12]:
        for own in choices(task_language, words, most=0).robots:
            check_own_atoms(task_language, own, twin, Counter())
        found = choices(task_language, words)
        assert found.guaranteed
        check_automata(found, twin)
        if twin.combinations <= 200:
            check_combinations(found, twin)


def test_too_many_are_refused() -> None:
    task_language = shipped("grid/corners-4x4")[1]
    words = task_language.words_of(sentence_of(task_language))
    fits = task_language.plans_with(words)
    with pytest.raises(OutOfMemory, match=r"Reached: 0 different histories"):
        determinise(fits, 0, most=0)
    assert choices(task_language, words, most=0).walked is None
    assert choices(task_language, words, most=0).guaranteed


def test_a_task_that_starts_at_its_goal() -> None:
    domain, problem = read("t-map", "problem")
    candidates = from_problems(domain, [replace(problem, goal=TRUE)])
    (task_language,) = languages_in_tasks(build_language(candidates, "greedy").language, candidates)
    found = choices(task_language, (int(task_language.word[task_language.start]),))
    for own in found.robots:
        assert len(own) == own.count == 1
        at = monitor(found.fits, own, "")
        assert at.finished
        assert (at.step, at.remaining, at.allowed()) == (0, 1, ())
        assert at.can(never="(move *)")
        assert not at.can(do="(move *)")


def random_edges(random: Random) -> tuple[list[int], list[list[tuple[int, int]]]]:
    """The sizes of layers, the goal's first, and the edges (label, target) of each node."""
    sizes = [*(random.randint(1, 4) for _ in range(random.randint(1, 4))), 1]
    edges: list[list[tuple[int, int]]] = [[] for _ in range(sizes[0])]
    for below, here in pairwise(sizes):
        after = range(len(edges) - below, len(edges))
        edges += [
            sorted({(random.randrange(2), random.choice(after)) for _ in range(4)})
            for _ in range(here)
        ]
    return sizes, edges


def futures(
    edges: list[list[tuple[int, int]]], nodes: frozenset[int]
) -> frozenset[tuple[int, ...]]:
    """What may follow from some nodes."""
    found = {
        (label, *rest)
        for node in nodes
        for label, target in edges[node]
        for rest in futures(edges, frozenset({target}))
    }
    return frozenset(found or {()})


def test_least_automaton_of_any_graph() -> None:
    merged = 0
    for seed in range(300):
        sizes, edges = random_edges(Random(seed))
        start = frozenset({len(edges) - 1})
        subsets = layer = {start}
        while any(edges[node] for nodes in layer for node in nodes):
            layer = {
                frozenset(to for node in nodes for own, to in edges[node] if own == label)
                for nodes in layer
                for label in {own for node in nodes for own, _ in edges[node]}
            }
            subsets = subsets | layer
        automaton = determinise(layered_space(sizes, edges), 0)
        assert accepted([dict(own) for own in automaton.moves]) == futures(edges, start)
        assert automaton.count == len(futures(edges, start))
        least = len({futures(edges, nodes) for nodes in subsets})
        assert len(automaton) == least
        merged += len(subsets) > least
    assert merged >= 30


def test_nodes_that_behave_alike_are_one_in_subsets() -> None:
    """By each label there are two ways on, to nodes of which all have both labels."""
    random, width, steps = Random(1), 300, 10
    sizes = [1, *([width] * steps), 1]
    starts = [0, *accumulate(sizes)]
    edges: list[list[tuple[int, int]]] = [[]]
    for layer, size in enumerate(sizes[1:]):
        below = range(starts[layer], starts[layer + 1])
        for _ in range(size):
            ways = [sorted(random.sample(below, min(2, len(below)))) for _ in range(2)]
            edges.append([(label, to) for label, own in enumerate(ways) for to in own])
    automaton = determinise(layered_space(sizes, edges), 0, most=sum(sizes))
    assert (len(automaton), automaton.count) == (steps + 2, 2 ** (steps + 1))
