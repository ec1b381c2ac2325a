# SPDX-License-Identifier: GPL-3.0-or-later
"""What the maps contain: the rules of the grid, in both styles."""

from __future__ import annotations

import re
from collections import Counter
from itertools import product

import numpy as np
import pytest
from generate import Scenario, problem_text
from gridmap import GridMap, open_grid, ring, three_cells

from planners.loading import build
from planners.pddl import parse_problem
from planners.pddl.formula_tree import conjuncts
from planners.pddl.sexpr import Source
from planners.search.optimal_plans import plan_spaces
from planners.search.plan_space import PlanSpace
from planners.search.plans import counts
from planners.search.reachable import Space, explore
from tests.support.domains import read, world_of

STYLES = ("grid", "grid-joint")


def to_every_state(space: Space) -> PlanSpace:
    """The optimal plans between all pairs of different states."""
    groups = [(space.model.full_state(row), None) for row in space.rows]
    (plans,) = plan_spaces(space, groups)
    return plans


@pytest.mark.parametrize(
    "problem", ["gw1-2x2", "gw2-2x3", "gw4-3x3", "gwb1-2x4", "gwb5-3x3", "corners-4x4"]
)
def test_both_styles_are_the_same_model(problem: str) -> None:
    one, other = (world_of(style, problem).space for style in STYLES)
    assert one.model.codec.facts == other.model.codec.facts
    assert (one.rows == other.rows).all()
    # Only MA-PDDL has the step in which nobody moves.
    still = {(number, (None, None), number) for number in range(len(one))}
    assert steps(one) == steps(other) | still
    first, second = to_every_state(one), to_every_state(other)
    assert counts_at_starts(first) == counts_at_starts(second)


@pytest.mark.parametrize("problem", ["three-cells", "t-map", "gw2-2x3", "gwb1-2x4", "corners-4x4"])
def test_joint_schemas_are_disjoint(problem: str) -> None:
    """Planners that do not compare what actions do would count a plan twice."""
    actions = world_of("grid-joint", problem).loaded.model.actions
    meant = Counter((action.parts, frozenset(conjuncts(action.precondition))) for action in actions)
    assert [key for key, times in meant.items() if times > 1] == []


def steps(space: Space) -> set[tuple[int, tuple[str | None, ...], int]]:
    """(state, where each robot moves, next state); a step that is there twice is an error."""
    sources = np.repeat(np.arange(len(space)), np.diff(space.first)).tolist()
    texts = [
        tuple(text and text.split()[-1] for text in space.model.texts(own)) for own in space.labels
    ]
    found = [*zip(sources, texts, space.target.tolist(), strict=True)]
    assert len(set(found)) == len(found)
    return set(found)


def counts_at_starts(plans: PlanSpace) -> list[tuple[int, int, int]]:
    """(goal, initial state, number of optimal plans) of every task."""
    all_counts = counts(plans)
    return [
        (int(plans.goal[node]), int(plans.state[node]), all_counts[node]) for node in plans.starts
    ]


def naive_steps(grid: GridMap, state: tuple[str, ...]) -> set[tuple[str, ...]]:
    """The rules of a step, literally: who moves where, nobody shares a cell, nobody swaps."""
    options = [[cell, *grid.neighbours(cell)] for cell in state]
    return {
        after
        for after in product(*options)
        if len(set(after)) == len(after)
        and not any(
            a != b and (b, a) in zip(state, after, strict=True)
            for a, b in zip(state, after, strict=True)
        )
    }


@pytest.mark.parametrize(
    ("grid", "starts"),
    [
        (three_cells(), ("a", "b")),
        (three_cells(), ("a", "b", "c")),
        (open_grid(2, 2), ("c0-0", "c0-1", "c1-1", "c1-0")),
        (open_grid(2, 3), ("c0-0", "c1-1")),
        (open_grid(2, 3), ("c0-0", "c1-1", "c0-2")),
        (ring(2, 4), ("c0-0", "c1-1", "c0-2")),
    ],
    ids=["triangle-2", "triangle-3", "square-4", "grid-2", "grid-3", "ring-3"],
)
def test_the_grid_domain_against_its_rules(grid: GridMap, starts: tuple[str, ...]) -> None:
    robots = len(starts)
    domain, _ = read("grid", "gw1-2x2")
    text = problem_text(Scenario("naive", grid, starts, starts), "grid")
    loaded = build(domain, [parse_problem(Source("naive", text), domain)])
    space = explore(loaded.model, loaded.tasks[0].init[None, :])
    cells = [
        tuple(re.findall(r"\(at r\d+ (\S+)\)", loaded.model.codec.key(row))) for row in space.rows
    ]

    seen, todo = {starts}, [starts]
    while todo:
        new = naive_steps(grid, todo.pop()) - seen
        seen |= new
        todo += new
    assert set(cells) == seen
    for number, state in enumerate(cells):
        after = [
            cells[target] for target in space.target[space.first[number] : space.first[number + 1]]
        ]
        assert len(state) == robots
        assert Counter(after) == Counter(naive_steps(grid, state))
