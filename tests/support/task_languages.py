# SPDX-License-Identifier: GPL-3.0-or-later
"""Languages in tasks, shipped or random, and what a naive twin lists of each of their sentences."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import replace
from functools import cache, lru_cache
from itertools import combinations, count
from random import Random

import numpy as np
import pytest

from benchmarks.paper.task_choices import languages_in_tasks
from coordlang.commands.building import Built, build_language
from coordlang.execution.task_language import TaskLanguage
from coordlang.language.candidates import Candidates, all_pairs, from_listed, from_problems
from coordlang.language.listed import ListedTask
from coordlang.language.words import Language, Partition
from coordlang.required.miscoordination import Inseparable
from coordlang.verification.by_definition import verify
from planners.pddl.model_options import ModelOptions
from planners.search.plan_space import PlanSpace
from planners.search.plans import Plans
from planners.system.errors import ProvedImpossible
from tests.support import naive, slow, thorough
from tests.support.domains import DOMAINS, all_tasks, own_task
from tests.support.naive_choices import Listed, listed
from tests.support.random_models import random_chores, random_model

#: (robots, random models): some always, more of them in CI.
RANDOM = [(2, 8), (3, 6), *thorough((2, 120), (3, 120))]
#: The same for comparisons with what a twin lists, most of them with ``-m slow``.
RUNS = [(3, 8), *thorough((2, 20), (3, 16)), *slow((2, 400), (3, 250))]
#: Robots -> (plans of one task, combinations of one sentence) that the twin lists at most.
SIZES = {2: (200, 400), 3: (120, 400)}
#: Every shipped domain; of the many maps that differ in size only, some, the largest ones last.
SHIPPED = [
    f"{path.parent.name}/{path.stem}"
    for path in sorted(DOMAINS.glob("*/*.pddl"), key=lambda p: (p.parent, "4x4" in p.stem, p.stem))
    if path.name != "domain.pddl"
    and (
        path.parent.name not in ("grid", "grid-joint")
        or path.stem in ("corners-4x4", "gw2-2x3", "gwb5-3x3", "three-cells")
    )
] + ["grid/three-robots-3x3"]
#: The same as parameters: one problem of each folder always, all others at night.
EACH_FOLDER = [
    pytest.param(
        name, marks=[pytest.mark.thorough] * (name.split("/")[0] == SHIPPED[n - 1].split("/")[0])
    )
    for n, name in enumerate(SHIPPED)
]


def in_words(
    language: Language | None, table: Partition, space: PlanSpace, task: int
) -> TaskLanguage:
    word = table.word_of(space.rows)[space.state]
    known = language or language_of({}, table.words)
    return TaskLanguage(known, table, space, task, word, True, None)  # type: ignore[arg-type]


def language_of(words: dict[str, str], names: tuple[str, ...]) -> Language:
    return Language(names, words, names[0])


def random_language(random: Random, candidates: Candidates) -> Language:
    """Some of the states, each with a random word of a few: no coordination language, mostly."""
    names = tuple(f"w{n}" for n in range(random.randint(1, 4)))
    keys = [candidates.model.codec.key(row) for row in candidates.rows]
    mapped = random.sample(keys, random.randint(1, len(keys)))
    return language_of({key: random.choice(names) for key in sorted(mapped)}, names)


@cache
def built_for(folder: str, stem: str = "problem", method: str = "minimal") -> Built:
    """A language for all pairs of states of a shipped problem, built once in a process."""
    return build_language(all_tasks(folder, stem), method)


@cache
def shipped(name: str) -> tuple[Candidates, TaskLanguage]:
    """A shipped task and its greedy language; remembers actions if plans are inseparable."""
    folder, _, stem = name.partition("/")
    for remember in (False, True):
        candidates = own_task(folder, stem, ModelOptions(remember_actions=remember))
        try:
            language = build_language(candidates, "greedy").language
        except Inseparable:
            continue
        return candidates, next(languages_in_tasks(language, candidates))
    raise AssertionError(name)


@cache
def random_task_languages(
    robots: int, number: int
) -> tuple[tuple[int, Candidates, TaskLanguage], ...]:
    """So many random models by their seeds, each made once in a process."""
    found: list[tuple[int, Candidates, TaskLanguage]] = []
    for seed in count():
        if (made := random_task_language(seed, robots)) is not None:
            found.append((seed, *made))
        if len(found) == number:
            return tuple(found)
    raise AssertionError("seeds do not end")


def random_task_language(seed: int, robots: int) -> tuple[Candidates, TaskLanguage] | None:
    """The task of a random model with most choices, under a random partition; some states are left
    to the default; None without a task of few plans.

    No coordination language, mostly: saying and understanding, searching and wishing do not depend
    on it.
    """
    random, candidates = Random(seed), candidates_of(seed, robots)
    if candidates is None or candidates.loaded.options.remember_actions:
        return None
    space, task = tasks_of(candidates, seed)[0]
    if not candidates.listed:  # all pairs of states: one of them, or some literals of its goal
        codec, goal = candidates.model.codec, space.goals[space.goal[space.starts[task]]]
        true = {codec.facts.texts[fact] for fact in goal.facts}
        literals = [fact if fact in true else f"(not {fact})" for fact in codec.facts.texts]
        if random.random() < 0.3:
            literals = random.sample(literals, random.randint(1, len(literals)))
        init = codec.decode(space.rows[space.state[space.starts[task]]])
        listed = ListedTask(tuple(init), tuple(literals))
        loaded = candidates.loaded
        candidates = from_listed(loaded.domain, loaded.problems, [listed], loaded.options)
    if not 1 < Plans.of(candidates.spaces[0]).count <= 300:
        return None
    size = random.choice([1, 2, 2, 3, 3, 4, 5])
    used = sorted(set(candidates.spaces[0].state.tolist()))
    mapped = [n for n in used if random.random() < 0.9] or used[:1]
    partition = {n: random.randrange(size) for n in mapped}
    language = Language.of(Partition.of_states(candidates.rows, partition), candidates.model)
    return candidates, next(languages_in_tasks(language, candidates))


@lru_cache(500)
def candidates_of(seed: int, robots: int) -> Candidates | None:
    """A random model with all pairs of states, or one partial goal; half of them chores."""
    chores = seed % 2 == 0
    domain, problem, options = (random_chores if chores else random_model)(seed, robots)
    if seed % 5 == 0:
        options = replace(options, remember_actions=True)
    make = all_pairs if seed % 3 and not chores else from_problems
    try:
        found = make(domain, [problem], options)
    except ProvedImpossible:
        return None
    if not 0 < found.count <= 120 or max(map(len, found.spaces)) > (1000 if robots == 2 else 60):
        return None
    return found


def tasks_of(candidates: Candidates, seed: int) -> list[tuple[PlanSpace, int]]:
    """Eight of the candidate tasks, those with most choices first."""
    tasks = [(space, task) for space in candidates.spaces for task in range(len(space.starts))]
    Random(seed).shuffle(tasks)
    return sorted(tasks, key=lambda t: -int(t[0].layer[t[0].starts[t[1]]]))[:8]


@lru_cache(100)
def in_built_languages(seed: int, robots: int) -> list[TaskLanguage]:
    """A verified language in some of its tasks; most have as few words as merging gives."""
    candidates = candidates_of(seed, robots)
    if candidates is None:
        return []
    small = len(candidates.rows) <= 8
    method = ["greedy", "minimal", "exhaustive"][seed // 7 % 3] if small else "greedy"
    try:
        language = build_language(candidates, method).language
    except Inseparable:
        return []
    table = language.partition(candidates.model)
    if seed // 11 % 4:
        table = merged(table, candidates, seed)
    return [in_words(language, table, *task) for task in tasks_of(candidates, seed)]


def merged(table: Partition, candidates: Candidates, seed: int) -> Partition:
    """Words merged at random while it stays a language: sentences leave more open, and mix."""
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


@lru_cache(100)
def in_random_words(seed: int, robots: int) -> list[TaskLanguage]:
    """A partition at random, which may be no language, in some candidate tasks."""
    candidates = candidates_of(seed, robots)
    if candidates is None:
        return []
    random = Random(seed)
    size = random.randint(1, 3)
    word = np.array([random.randrange(size) for _ in candidates.rows])
    table = Partition(tuple(f"w{n}" for n in range(size)), candidates.rows, word, 0)
    return [in_words(None, table, *task) for task in tasks_of(candidates, seed)]


def with_twins(
    make: Callable[[int, int], list[TaskLanguage]], robots: int, models: int
) -> Iterator[tuple[int, TaskLanguage, tuple[int, ...], Listed]]:
    """(seed, task, sentence, what is listed of it) over many random models."""
    for seed in range(models):
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
