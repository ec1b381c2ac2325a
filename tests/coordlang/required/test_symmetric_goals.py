# SPDX-License-Identifier: GPL-3.0-or-later
"""Goals up to symmetry: the same first differences and states as from all goals."""

from __future__ import annotations

from itertools import combinations
from random import Random

import pytest

from coordlang.commands.building import build_language
from coordlang.language.candidates import Candidates, all_pairs, from_problems
from coordlang.required.miscoordination import Inseparable
from coordlang.verification.by_definition import inseparable
from coordlang.vocabulary import first_differences
from coordlang.vocabulary.first_differences import FirstDifferences, differences, symmetric_goals
from planners.parallel.workers import Workers
from planners.pddl import parse_problem, read_domain, read_problem
from planners.pddl.model_options import ModelOptions
from planners.pddl.sexpr import Source
from planners.search.portions import PORTION
from tests.support.domains import DOMAINS, all_tasks
from tests.support.random_models import random_model
from tests.support.symmetric_worlds import GRID, world


def agree(candidates: Candidates, portion: float = PORTION) -> bool:
    """Compare; whether a symmetry was found and coordination is required."""
    if symmetric_goals(candidates, 0, 0) is None:
        return False
    found = answer(candidates, portion, True)
    every = answer(candidates, portion, False)
    if found is None or every is None:
        assert found is every
        return False
    assert found.states.tolist() == every.states.tolist()
    one, other = found, every
    assert one.listed.tolist() == other.listed.tolist()
    assert (one.requiring, one.nodes, one.edges) == (other.requiring, other.nodes, other.edges)
    return bool(one.requiring)


def answer(candidates: Candidates, portion: float, by_symmetry: bool) -> FirstDifferences | None:
    """First differences with or without symmetries; None if some plans are inseparable."""
    with pytest.MonkeyPatch.context() as patch:
        for_action = 0 if by_symmetry else 10**9
        patch.setattr(
            first_differences, "symmetric_goals", lambda c: symmetric_goals(c, 0, for_action)
        )
        try:
            return differences(candidates, Workers(), portion=portion)
        except Inseparable:
            return None


def random_worlds(seeds: range) -> int:
    found = 0
    for seed in seeds:
        random = Random(seed)
        robots = random.choice([2, 2, 3])
        cells = random.randint(robots + 1, 5 if robots == 2 else 4)
        edges = [edge for edge in combinations(range(cells), 2) if random.random() < 0.7]
        problem = parse_problem(Source("p", world(cells, edges, robots)), GRID)
        options = random.choice([ModelOptions(), ModelOptions(cost="makespan+actions")])
        candidates = all_pairs(GRID, [problem], options)
        found += bool(candidates.count) and agree(candidates, random.choice([PORTION, 40.0, 300.0]))
    return found


@pytest.mark.parametrize(
    "seeds", [range(15), pytest.param(range(1_000, 1_300), marks=pytest.mark.slow)]
)
def test_random_worlds(seeds: range) -> None:
    assert random_worlds(seeds) >= len(seeds) // 3


def test_random_models() -> None:
    """Mostly without a symmetry."""
    found = 0
    for seed in range(30):
        domain, problem, options = random_model(seed, 2 + seed % 2)
        candidates = all_pairs(domain, [problem], options)
        if 0 < candidates.count <= 2_000:
            agree(candidates)
            found += symmetric_goals(candidates, 0, 0) is not None
    assert found >= 1


def test_where_symmetries_are_not_looked_for() -> None:
    grid = read_domain(DOMAINS / "grid" / "domain.pddl")
    problem = read_problem(DOMAINS / "grid" / "gw2-2x3.pddl", grid)
    small = all_pairs(grid, [problem])
    assert symmetric_goals(small) is None  # less work than symmetries take
    assert symmetric_goals(small, 0, 0) is not None
    assert symmetric_goals(small, least=0, for_action=10**6) is None
    assert symmetric_goals(from_problems(grid, [problem]), 0, 0) is None
    remembering = all_pairs(grid, [problem], ModelOptions(remember_actions=True))
    assert symmetric_goals(remembering, 0, 0) is None


def test_a_language_is_the_same_and_inseparable_plans_are_shown(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    grid = all_tasks("grid", "gw4-3x3")
    without = build_language(grid, "greedy")
    monkeypatch.setattr(
        "coordlang.vocabulary.first_differences.symmetric_goals", lambda c: symmetric_goals(c, 0, 0)
    )
    assert build_language(grid, "greedy").language.states == without.language.states
    shown = 0
    for seed in range(30):
        domain, problem, options = random_model(seed, 2)
        candidates = all_pairs(domain, [problem], options)
        if not candidates.count or not any(map(inseparable, candidates.spaces)):
            continue
        with pytest.raises(Inseparable):
            build_language(candidates, "greedy")
        shown += 1
    assert shown
