# SPDX-License-Identifier: GPL-3.0-or-later
"""Languages in tasks: of shipped worlds, built or the paper's own, and of random models."""

from __future__ import annotations

from contextlib import suppress
from functools import cache
from itertools import count
from random import Random

import pytest

from coordlang.commands.building import build_language
from coordlang.execution.task_language import TaskLanguage, languages_in_tasks
from coordlang.language.candidates import Candidates, from_listed, from_problems
from coordlang.language.listed import ListedTask
from coordlang.language.partition import Partition
from coordlang.language.words import Language
from coordlang.required.miscoordination import Inseparable
from planners.loading import build
from planners.pddl.lifted import Domain, Problem
from planners.pddl.model_options import ModelOptions
from planners.search.plans import Plans
from planners.search.reachable import explore
from planners.system.errors import ProvedImpossible
from tests.support.domains import DOMAINS, all_tasks, own_task
from tests.support.random_chores import random_chores
from tests.support.random_models import graph_text, random_model
from tests.support.texts import parsed

#: Every shipped domain; of the many maps that differ in size only, some.
SHIPPED = [
    f"{path.parent.name}/{path.stem}"
    for path in sorted(DOMAINS.glob("*/*.pddl"))
    if path.name != "domain.pddl"
    and (
        path.parent.name not in ("grid", "grid-joint")
        or path.stem in ("corners-4x4", "gw2-2x3", "gwb5-3x3", "three-cells")
    )
] + ["grid/three-robots-3x3"]


@cache
def shipped(name: str) -> tuple[Candidates, TaskLanguage]:
    """The task of a shipped problem with the greedy language for it; actions remembered where plans
    are inseparable.
    """
    folder, _, stem = name.partition("/")
    for remember in (False, True):
        candidates = own_task(folder, stem, ModelOptions(remember_actions=remember))
        try:
            language = build_language(candidates, "greedy").language
        except Inseparable:
            continue
        return candidates, in_its_task(candidates, language)
    raise AssertionError(name)


def where_r2_is(candidates: Candidates) -> Language:
    """The paper's language of the running example: a word for each place of robot 2."""
    words, states = ("in-a", "in-b", "in-c"), {}
    for row in candidates.rows:
        key = candidates.model.codec.key(row)
        states[key] = f"in-{key.partition('(at r2 ')[2][0]}"
    return Language(words, states, "in-a")


@cache
def three_cells() -> TaskLanguage:
    """r1 and r2 trade a and b on three adjacent cells, a joint step being three states: four
    optimal plans.
    """
    candidates = own_task("three-cells")
    return next(iter(languages_in_tasks(where_r2_is(candidates), candidates)))


@cache
def task_languages(
    folder: str, stem: str, method: str = "minimal", everything: bool = True
) -> tuple[TaskLanguage, ...]:
    """Every candidate task with a language that a method makes."""
    candidates = (all_tasks if everything else own_task)(folder, stem)
    return tuple(languages_in_tasks(build_language(candidates, method).language, candidates))


class Unsuitable(Exception):
    """A random model without a task that can be solved, or with too many plans to list."""


#: (robots, random models): some always, more of them in CI.
RANDOM = [
    (2, 25),
    (3, 25),
    pytest.param(2, 120, marks=pytest.mark.thorough),
    pytest.param(3, 120, marks=pytest.mark.thorough),
]


@cache
def random_task_languages(
    robots: int, number: int
) -> tuple[tuple[int, Candidates, TaskLanguage], ...]:
    """So many random models by their seeds, each made once in a process."""
    found: list[tuple[int, Candidates, TaskLanguage]] = []
    for seed in count():
        with suppress(Unsuitable):
            found.append((seed, *random_task_language(seed, robots)))
        if len(found) == number:
            return tuple(found)
    raise AssertionError("seeds do not end")


def random_task_language(seed: int, robots: int) -> tuple[Candidates, TaskLanguage]:
    """A task of a random model, one of its longer ones, under a random partition; some states are
    left to the default.

    No coordination language, mostly: saying and understanding, searching and wishing do not depend
    on it.
    """
    random = Random(seed)
    if seed % 2 == 0:
        domain, problem, options = random_chores(seed, robots)
    elif seed % 5 == 0:
        domain, problem, options = random_model(seed, robots)
    else:  # robots on a graph
        options = ModelOptions(cost=random.choice(["makespan", "makespan", "makespan+actions"]))
        text, task = graph_text(random, robots)
        domain, problem = parsed(text, task)
    try:
        if seed % 2 == 0:
            candidates = from_problems(domain, [problem], options)
        else:
            candidates = from_listed(
                domain, [problem], [long_task(random, domain, problem, options)], options
            )
    except ProvedImpossible:
        raise Unsuitable from None
    if not 0 < Plans.of(candidates.spaces[0]).count <= 300:
        raise Unsuitable
    size = random.choice([1, 2, 2, 3, 3, 4, 5])
    used = sorted(set(candidates.spaces[0].state.tolist()))
    mapped = [n for n in used if random.random() < 0.9] or used[:1]
    partition = {n: random.randrange(size) for n in mapped}
    language = Language.of(Partition.of_states(candidates.rows, partition), candidates.model)
    return candidates, in_its_task(candidates, language)


def long_task(
    random: Random, domain: Domain, problem: Problem, options: ModelOptions
) -> ListedTask:
    """From one reachable state to another one that is far from it, or to some of its literals."""
    loaded = build(domain, [problem], options)
    codec = loaded.model.codec
    space = explore(loaded.model, loaded.tasks[0].init[None, :])
    if not 1 < len(space) <= 400:
        raise Unsuitable
    farthest: list[tuple[int, int, list[int]]] = []
    for start in random.sample(range(len(space)), min(8, len(space))):
        layer, seen, depth = [start], {start}, 0
        while after := sorted(
            {t for s in layer for t in space.target[space.first[s] : space.first[s + 1]].tolist()}
            - seen
        ):
            layer, depth = after, depth + 1
            seen.update(layer)
        farthest.append((depth, start, layer))
    _, start, layer = max(farthest)
    true = set(codec.decode(space.rows[random.choice(layer)]))
    literals = [fact if fact in true else f"(not {fact})" for fact in codec.facts.texts]
    if random.random() < 0.3:
        literals = random.sample(literals, random.randint(1, len(literals)))
    return ListedTask(tuple(codec.decode(space.rows[start])), tuple(literals))


def in_its_task(candidates: Candidates, language: Language) -> TaskLanguage:
    space, table = candidates.spaces[0], language.partition(candidates.model)
    return TaskLanguage(language, table, space, 0, table.word_of(space.rows)[space.state], True)
