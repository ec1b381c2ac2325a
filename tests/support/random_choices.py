# SPDX-License-Identifier: GPL-3.0-or-later
"""Random tasks under a language, and what a naive twin lists of each of their sentences."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import replace
from itertools import combinations
from random import Random

import numpy as np
import pytest

from coordlang.commands.building import build_language
from coordlang.execution.task_language import TaskLanguage
from coordlang.language.candidates import Candidates, all_pairs, from_problems
from coordlang.language.partition import Partition
from coordlang.required.miscoordination import Inseparable
from coordlang.verification.by_definition import verify
from planners.search.plan_space import PlanSpace
from planners.search.plans import Plans
from planners.system.errors import ProvedImpossible
from tests.support import naive
from tests.support.naive_choices import Listed, listed
from tests.support.random_chores import random_chores
from tests.support.random_models import random_model

#: Robots -> (plans of one task, combinations of one sentence) that the twin lists at most.
SIZES = {2: (200, 400), 3: (120, 400)}


#: (robots, random models): a few always, many with ``-m slow``.
RUNS = [
    (2, 20),
    (3, 16),
    pytest.param(2, 400, marks=pytest.mark.slow),
    pytest.param(3, 250, marks=pytest.mark.slow),
]


class Unsuitable(Exception):
    """A random model without a solvable task, without a language, or too large to list."""


#: Tasks of one model that are looked at.
_TASKS = 8


def candidates_of(seed: int, robots: int) -> Candidates:
    """A random model with all pairs of its states, or with one task and a partial goal; half of
    them chores.
    """
    chores = seed % 2 == 0
    domain, problem, options = (random_chores if chores else random_model)(seed, robots)
    if seed % 5 == 0:
        options = replace(options, remember_actions=True)
    make = all_pairs if seed % 3 and not chores else from_problems
    try:
        found = make(domain, [problem], options)
    except ProvedImpossible:
        raise Unsuitable from None
    if not 0 < found.count <= 120 or max(map(len, found.spaces)) > (1000 if robots == 2 else 60):
        raise Unsuitable
    return found


def tasks_of(candidates: Candidates, seed: int) -> list[tuple[PlanSpace, int]]:
    """Some of the candidate tasks, those with most choices first."""
    tasks = [(space, task) for space in candidates.spaces for task in range(len(space.starts))]
    Random(seed).shuffle(tasks)
    return sorted(tasks, key=lambda t: -int(t[0].layer[t[0].starts[t[1]]]))[:_TASKS]


def in_built_languages(seed: int, robots: int) -> Iterator[TaskLanguage]:
    """A built and verified language in some of its candidate tasks; most of them with as few words
    as merging gives.
    """
    candidates = candidates_of(seed, robots)
    small = len(candidates.rows) <= 8
    method = ["greedy", "minimal" if small else "greedy", "exhaustive" if small else "greedy"][
        seed // 7 % 3
    ]
    try:
        language = build_language(candidates, method).language
    except Inseparable:
        raise Unsuitable from None
    table = language.partition(candidates.model)
    if seed // 11 % 4:
        table = merged(table, candidates, seed)
    for space, task in tasks_of(candidates, seed):
        yield TaskLanguage(
            language, table, space, task, table.word_of(space.rows)[space.state], True
        )


def merged(table: Partition, candidates: Candidates, seed: int) -> Partition:
    """Words merged at random as long as it stays a language: sentences then leave more open, and
    mix more.
    """
    words = list(range(len(table.words)))
    pairs = list(combinations(words, 2))
    Random(seed).shuffle(pairs)
    for a, b in pairs[: 40 if len(candidates.model.robots) == 2 else 12]:
        coarser = replace(
            table,
            word=np.where(table.word == b, a, table.word),
            default=a if table.default == b else table.default,
        )
        if verify(coarser, candidates.spaces).holds:
            table = coarser
    return table


def in_random_words(seed: int, robots: int) -> Iterator[TaskLanguage]:
    """A partition at random, which may be no language, in some candidate tasks."""
    candidates = candidates_of(seed, robots)
    random = Random(seed)
    size = random.randint(1, 3)
    word = np.array([random.randrange(size) for _ in candidates.rows])
    table = Partition(tuple(f"w{n}" for n in range(size)), candidates.rows, word, 0)
    for space, task in tasks_of(candidates, seed):
        yield TaskLanguage(None, table, space, task, word[space.state], True)  # type: ignore[arg-type]


def with_twins(
    make: Callable[[int, int], Iterator[TaskLanguage]], robots: int, models: int
) -> Iterator[tuple[int, TaskLanguage, tuple[int, ...], Listed]]:
    """(seed, task, sentence, what is listed of it) over many random models."""
    for seed in range(models):
        with suppress(Unsuitable):
            for task_language in make(seed, robots):
                with suppress(naive.TooLarge):
                    for words, twin in list(listed(task_language, *SIZES[robots])):
                        yield seed, task_language, words, twin


def sentence_of(task_language: TaskLanguage) -> str:
    plan = next(iter(Plans.of(task_language.space, task_language.task)))
    states = Plans(task_language.space, task_language.start, []).states(plan)
    return task_language.text(
        naive.sentence(task_language.partition.word_of(task_language.space.rows[states]).tolist())
    )
