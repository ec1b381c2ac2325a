# SPDX-License-Identifier: GPL-3.0-or-later
"""Candidate tasks that are small enough to list every plan of them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import replace
from functools import cache
from itertools import chain, count, islice, product
from random import Random

from coordlang.language.candidates import Candidates, all_pairs, from_listed, from_problems
from coordlang.language.listed import ListedTask
from coordlang.verification.by_definition import inseparable
from planners.joint.states import split_atoms
from planners.pddl.model_options import ModelOptions
from planners.search.plan_space import PlanSpace
from planners.search.plans import Plan
from planners.system.errors import BadInput, ProvedImpossible
from tests.support import naive
from tests.support.random_models import graph_text, random_model
from tests.support.texts import parsed

#: More plans of one task are not listed.
MOST = 40
#: (robots, asynchronous) -> the seeds up to the last one here whose models are small and require
#: coordination, as looking at all of them finds: most models do not, and take as long to make.
REQUIRING = {
    (2, False): """
        7 11 23 64 73 83 89 90 94 97 100 115 118 121 130 141 155 161 164 170 172 173 179 194 199
        208 214 227 230 238 249 255 256 257 275 284 287 301 305 316 317 319 320 328 332 335 347
        350 354 361
    """,
    (3, False): """
        2 5 7 14 25 32 35 44 52 61 67 83 85 89 91 97 110 118 126 130 133 134 136 151 155 164 165
        170 172 173 176 181 182 199 200 205 208 214 227 233 257 262 275 277 285 299 301 305 319
        328 332 343
    """,
    (2, True): """
        2 7 11 15 61 64 67 73 83 89 90 93 94 97 115 118 121 130 133 141 153 155 161 164 170 172
        173 179 182 194 199 205 214 227 230 238 249 255 256 257 265 269 274 275 284 287 295 301
        305 317 319 320 328 332 335 344 347 350 354
    """,
}


@cache
def on_graph(seed: int, robots: int) -> Candidates | None:
    """Robots on a random graph: all pairs of states, or one partial goal. None if useless."""
    text, problem = graph_text(Random(seed), robots)
    domain, goal = parsed(text, problem)
    try:
        candidates = (all_pairs if seed % 2 else from_problems)(domain, [goal], ModelOptions())
    except ProvedImpossible:
        return None
    return candidates if 0 < candidates.count <= 140 else None


def some_tasks(candidates: Candidates, random: Random, number: int) -> Candidates:
    """A few pairs of states, goals sometimes partial."""
    key = candidates.model.codec.key
    tasks = []
    for _ in range(number):
        init, goal = (
            tuple(split_atoms(key(row)))
            for row in candidates.rows[random.sample(range(len(candidates.rows)), 2)]
        )
        tasks.append(ListedTask(init, goal[: random.randint(1, len(goal))]))
    return from_listed(candidates.loaded.domain, candidates.loaded.problems, tasks)


def requiring(candidates: Candidates) -> bool:
    return any(
        first_break(steps_of(space), space.robots, space.starts.tolist(), together=False)
        is not None
        for space in candidates.spaces
    )


def states_of(candidates: Candidates) -> list[int]:
    """The states that plans pass through."""
    return sorted({s for space in candidates.spaces for s in space.state.tolist()})


def small_candidates(
    robots: int,
    *,
    states: int,
    plans: int = 0,
    tasks: int = 100,
    separable: bool = True,
    asynchronous: bool = False,
    requires: bool = False,
) -> Iterator[tuple[int, Candidates]]:
    """Random models by their seeds, as all pairs of states or with their own task, that are no
    larger.

    ``plans`` of one task are listed at most, 0: any number; ``separable``: no plans are inseparable;
    ``requires``: they require coordination, and have at most 9 states and 100 tasks.
    """
    known = [*map(int, REQUIRING.get((robots, asynchronous), "").split())] if requires else []
    for seed in chain(known, count(max(known, default=-1) + 1)):
        found = _random(seed, robots, asynchronous)
        if found is None:
            continue
        with suppress(ProvedImpossible, BadInput, naive.TooLarge):
            if not 0 < found.count <= tasks or len(states_of(found)) > states:
                continue
            if separable and any(inseparable(space) is not None for space in found.spaces):
                continue
            if plans:
                list(listed(found, plans))
            if requires and seed not in known and not requiring(found):
                continue
            yield seed, found


@cache
def _random(seed: int, robots: int, asynchronous: bool) -> Candidates | None:
    """Made once in a process, for many files; None where nothing can be done."""
    domain, problem, options = random_model(seed, robots)
    options = replace(options, asynchronous=asynchronous)
    try:
        return (all_pairs if seed % 3 else from_problems)(domain, [problem], options)
    except (ProvedImpossible, BadInput):
        return None


def random_candidates(seeds: range, robots: int, most: int) -> Iterator[tuple[int, Candidates]]:
    """Those of the random models of seeds, with ``most`` tasks at most."""
    for seed in seeds:
        found = _random(seed, robots, False)
        if found is not None and 0 < found.count <= most:
            yield seed, found


def listed(
    candidates: Candidates, most: int = MOST
) -> Iterator[tuple[PlanSpace, int, list[Plan], list[tuple[int, ...]]]]:
    """Each task with its plans in their order and the states that they pass through."""
    for space in candidates.spaces:
        for task in range(len(space.starts)):
            plans = naive.listed(space, task, most)
            yield space, task, plans, [naive.states(space, task, plan) for plan in plans]


def failing(candidates: Candidates) -> list[list[tuple[int, ...]]]:
    """The state sequences of every failing tuple of plans."""
    robots = len(candidates.model.robots)
    found = set()
    for _, _, plans, sequences in listed(candidates):
        number = {plan: n for n, plan in enumerate(plans)}
        for chosen in naive.failing(plans, robots):
            found.add(tuple(sequences[number[plan]] for plan in chosen))
    return [list(states) for states in sorted(found)]


def is_language(word: Mapping[int, int], bad: list[list[tuple[int, ...]]]) -> bool:
    """Whether no failing tuple of plans has one sentence."""
    return not any(
        len({naive.sentence([word[s] for s in states]) for states in plans}) == 1 for plans in bad
    )


def partitions(states: list[int], size: int) -> Iterator[dict[int, int]]:
    for words in product(range(size), repeat=len(states)):
        if [words.index(w) for w in range(size) if w in words] == sorted(
            words.index(w) for w in set(words)
        ):
            yield dict(zip(states, words, strict=True))


@cache
def small_worlds(states: int = 7, number: int = 16) -> tuple[Candidates, ...]:
    """Tasks of two and three robots in turn that require coordination, with few states and plans."""
    two, three = (
        (found for _, found in small_candidates(n, states=states, plans=MOST, requires=True))
        for n in (2, 3)
    )
    return tuple(islice(chain.from_iterable(zip(two, three, strict=True)), number))


Nodes = tuple[int, ...]
#: For each node the next one by the labels of the step.
Steps = list[dict[Nodes, int]]


def steps_of(space: PlanSpace) -> Steps:
    steps: Steps = [{} for _ in range(len(space))]
    table = zip(space.sources.tolist(), space.labels.tolist(), space.target.tolist(), strict=True)
    for node, labels, target in table:
        steps[node][tuple(labels)] = target
    return steps


def first_break(steps: Steps, robots: int, starts: list[int], *, together: bool) -> int | None:
    """The step at which a mixture from a node breaks; ``together``: of plans in the same states."""
    layer, step = {((start,) * robots, start) for start in starts}, 0
    seen = {*layer}
    while layer:
        after = set()
        for plans, mixture in layer:
            for chosen in product(*(steps[node].items() for node in plans)):
                labels, ends = zip(*chosen, strict=True)
                if together and len({*ends}) > 1:
                    continue
                mixed = tuple(own[robot] for robot, own in enumerate(labels))
                if mixed not in steps[mixture]:
                    return step
                after.add((ends, steps[mixture][mixed]))
        layer, step = after - seen, step + 1
        seen |= after
    return None
