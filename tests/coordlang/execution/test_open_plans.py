# SPDX-License-Identifier: GPL-3.0-or-later
"""The plans that a sentence leaves open, counted, and listed, against the list of all plans."""

from __future__ import annotations

from collections import Counter
from random import Random

import pytest

from coordlang.execution.open_plans import PlanDag, plan_dag
from coordlang.execution.task_language import NoPlanFits, TaskLanguage
from planners.search.plan_file import texts
from planners.search.plans import Plan, Plans
from tests.support.naive import plans_by_sentence
from tests.support.task_languages import RANDOM, SHIPPED, random_task_languages, shipped


def check(task_language: TaskLanguage, seed: int) -> None:
    """Every sentence of the task, and sentences near them."""
    groups = plans_by_sentence(task_language)
    for words, plans in list(groups.items())[:40]:
        said = task_language.words_of(words)
        fits = task_language.plans_with(said)
        assert Plans.of(fits).count == len(plans)
        assert set(Plans.of(fits)) == plans
        check_dag(task_language, plan_dag(task_language, said, fits), plans)
    random = Random(seed)
    for _ in range(8):
        check_broken(task_language, near(task_language, random, list(groups)), groups)


def check_dag(task_language: TaskLanguage, graph: PlanDag, plans: set[Plan]) -> None:
    """Its paths are the plans, its nodes have the right words and counts."""
    check_paths(task_language, graph, plans)
    assert all(graph.sentence[node.words - 1] == node.word for node in graph.nodes)


def check_paths(task_language: TaskLanguage, graph: PlanDag, plans: set[Plan]) -> None:
    through: Counter[int] = Counter()
    found = set()
    out: dict[int, list[tuple[int, tuple[str | None, ...]]]] = {}
    for edge in graph.edges:
        out.setdefault(edge.source, []).extend((edge.target, action) for action in edge.actions)
    stack: list[tuple[list[int], list[tuple[str | None, ...]]]] = [([0], [])]
    while stack:
        path, actions = stack.pop()
        if path[-1] not in out:
            found.add(tuple(actions))
            through.update(path)
        stack += [([*path, target], [*actions, action]) for target, action in out.get(path[-1], [])]
    assert found == {texts(task_language.model, plan) for plan in plans}
    for number, node in enumerate(graph.nodes):
        assert node.word == task_language.language.states.get(
            node.key, task_language.language.default
        )
        assert node.plans == through[number]


def near(
    task_language: TaskLanguage, random: Random, sentences: list[tuple[str, ...]]
) -> tuple[str, ...]:
    """A sentence with a word changed, left out or put in."""
    words = list(random.choice(sentences))
    at = random.randrange(len(words) + 1)
    words[at : at + random.randint(0, 1)] = random.choices(
        task_language.language.words, k=random.randint(0, 1)
    )
    return tuple(w for n, w in enumerate(words) if n == 0 or w != words[n - 1])


def check_broken(
    task_language: TaskLanguage, words: tuple[str, ...], groups: dict[tuple[str, ...], set[Plan]]
) -> None:
    if not words or words in groups:
        return
    with pytest.raises(NoPlanFits) as refused:
        task_language.plans_with(task_language.words_of(words))
    longest = max(k for k in range(len(words) + 1) if any(said[:k] == words[:k] for said in groups))
    assert refused.value.fitting == task_language.words_of(words)[:longest]
    following = {
        said[longest] if len(said) > longest else None
        for said in groups
        if said[:longest] == words[:longest]
    }
    assert {
        task_language.language.words[w] if w is not None else None for w in refused.value.next_words
    } == following


@pytest.mark.parametrize("name", SHIPPED)
def test_every_sentence_of_a_shipped_domain(name: str) -> None:
    check(shipped(name)[1], 0)


@pytest.mark.parametrize(("robots", "number"), RANDOM)
def test_every_sentence_of_a_random_model(robots: int, number: int) -> None:
    for seed, _, task_language in random_task_languages(robots, number):
        check(task_language, seed)
