# SPDX-License-Identifier: GPL-3.0-or-later
"""Random models of all kinds and plan spaces of their tasks, small enough for their twins."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import fields, replace
from functools import lru_cache
from random import Random
from typing import Any, get_args
from unittest.mock import Mock

import numpy as np

from coordlang.language.candidates import Candidates, all_pairs, explored_if_small, from_problems
from coordlang.verification.by_definition import inseparable
from planners.joint.model import JointModel, PlanningTask
from planners.loading import PlanningInstance, build
from planners.pddl.lifted import Domain, Problem
from planners.pddl.model_options import Cost, ModelOptions
from planners.search.optimal_plans import plan_spaces
from planners.search.plan_space import PlanSpace
from planners.search.reachable import Space, explore
from planners.system.errors import BadInput, ProvedImpossible
from tests.support import slow, thorough
from tests.support.random_models import random_model
from tests.support.random_pddl import random_model as random_pddl
from tests.support.texts import parsed

#: Nodes of a plan space up to which the walk is waited for, by the number of robots.
MOST = {2: 3_000, 3: 250, 4: 60}


@lru_cache(500)
def candidates_of(seed: int, robots: int | None) -> Candidates | None:
    """Those of a seed, once in a process (``robots`` None: any kind); None if refused or large."""
    random = Random(seed)
    try:
        if robots is None:
            domain, problem, options = of_any_kind(seed, random)
            loaded = build(domain, [problem], options)
            if explored_if_small(loaded.model, loaded.tasks[0].init[None, :]) is None:
                return None  # one of them has 60 million joint steps
        else:
            domain, problem, options = random_model(seed, robots)
            options = replace(options, remember_actions=random.random() < 0.3)
        make = from_problems if random.random() < (0.5 if robots else 0.3) else all_pairs
        return make(domain, [problem], options)
    except (ProvedImpossible, BadInput):
        return None


def of_any_kind(seed: int, random: Random) -> tuple[Domain, Problem, ModelOptions]:
    """MA-PDDL with formulas, plain PDDL with shared actions, joint-action PDDL with drift."""
    text = random_pddl(seed, random.choice(["agent", "plain", "joint"]))
    options = ModelOptions(unowned=text.unowned, remember_actions=random.random() < 0.3)
    return (*parsed(text.domain, text.problem), options)


def random_instance(seed: int) -> PlanningInstance | None:
    """The model of a seed, under a random cost; None where it is refused."""
    random = Random(seed)
    try:
        if seed % 2:
            domain, problem, options = random_model(seed, random.choice((2, 3)))
        else:
            domain, problem, options = of_any_kind(seed, random)
        return build(domain, [problem], replace(options, cost=random.choice(get_args(Cost))))
    except BadInput:
        return None


def explored(loaded: PlanningInstance) -> Space | None:
    """All reachable states; None where joint actions cannot be told apart."""
    try:
        return explore(loaded.model, loaded.tasks[0].init[None, :])
    except BadInput:
        return None


def blind_search(model: JointModel, task: PlanningTask) -> PlanSpace:
    """All optimal plans by exploring every reachable state, without any bound."""
    init = task.init[None, :]
    (found,) = plan_spaces(explore(model, init), [(task.goal, init)])
    used, state = np.unique(found.state, return_inverse=True)
    return replace(found, rows=found.rows[used], state=state)


def equal(one: PlanSpace, other: PlanSpace) -> None:
    """Every field but the model is the same, and so are the types of arrays."""
    for field in fields(PlanSpace):
        a, b = getattr(one, field.name), getattr(other, field.name)
        if isinstance(a, np.ndarray):
            assert (a.dtype, a.tolist()) == (b.dtype, b.tolist()), field.name
        else:
            assert field.name == "model" or a == b, field.name


def random_spaces(
    seeds: range, robots: int | None, most: int | None = None
) -> Iterator[tuple[Candidates, PlanSpace]]:
    """Plan spaces of random tasks, of ``most`` nodes (None: many); ``robots`` None: any kind."""
    for seed in seeds:
        found = candidates_of(seed, robots)
        if found is None:
            continue
        for space in found.spaces:
            if 0 < len(space) <= (MOST.get(space.robots, 0) if most is None else most):
                yield found, space


def separable_spaces(seeds: range, robots: int | None) -> Iterator[PlanSpace]:
    """The `random_spaces` without inseparable plans."""
    return (space for _, space in random_spaces(seeds, robots) if inseparable(space) is None)


def runs(two: int, three: int, any_kind: int) -> list[Any]:
    """Pairs (robots, seeds): so many models always, and many with ``-m slow``."""
    return [
        (2, range(two)),
        (3, range(three)),
        *thorough((None, range(any_kind))),
        *slow((2, range(1_000, 1_700)), (3, range(2_000, 2_800)), (4, range(3_000, 3_300))),
        *slow((None, range(4_000, 4_400))),
    ]


def layered_space(sizes: Sequence[int], edges: Sequence[Sequence[tuple[int, int]]]) -> PlanSpace:
    """A plan space of one robot and one task.

    ``sizes`` are the numbers of nodes of the layers, the goal's first; ``edges`` has for each node
    its pairs (label, next node), sorted; plans start at the last node.  A node's state has its number.
    """
    flat = [edge for own in edges for edge in own]
    return PlanSpace(
        model=Mock(),
        rows=np.zeros((0, 1), np.uint64),
        state=np.arange(len(edges)),
        goal=np.zeros(len(edges), np.int64),
        layer=np.repeat(np.arange(len(sizes)), sizes),
        first=np.cumsum([0, *map(len, edges)]),
        target=np.array([to for _, to in flat], np.int64),
        labels=np.array([[label] for label, _ in flat], np.int32).reshape(-1, 1),
        cost=np.zeros(len(flat), np.int64),
        goals=(None,),  # type: ignore[arg-type]
        starts=np.array([len(edges) - 1]),
        second=np.zeros(1, np.int64),
    )
