# SPDX-License-Identifier: GPL-3.0-or-later
"""Required coordination and divergences from choices against the composition walk, their twin."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

from coordlang.language.candidates import all_pairs
from coordlang.required.choices import Choices, LabelSets
from coordlang.required.divergences import DivergenceSearch, first_differences, minimal
from coordlang.required.miscoordination import inseparable
from planners.pddl import parse_domain, parse_problem
from planners.pddl.sexpr import Source
from planners.search.plan_space import PlanSpace
from tests.support.composition_walk import walk
from tests.support.random_models import random_model
from tests.support.random_spaces import runs, separable_spaces


def agree(space: PlanSpace, chunk: int) -> bool:
    """Compare with the walk; whether any coordination is required."""
    twin = walk(space)
    choices = Choices(space)
    assert (choices.requires == twin.requires).all()
    search = DivergenceSearch(space.robots, chunk)
    search.add(choices)
    table = search.table()
    assert table[:, 0].tolist() == twin.divergences.last.tolist()
    assert table[:, 1:].tolist() == twin.divergences.following.tolist()
    return bool(twin.requires.any())


def compared(seeds: range, robots: int | None) -> Counter[bool]:
    answers: Counter[bool] = Counter()
    for number, space in enumerate(separable_spaces(seeds, robots)):
        answers[agree(space, chunk=(7, 100, 1_000_000)[number % 3])] += 1
    return answers


@pytest.mark.parametrize(("robots", "seeds"), runs(30, 15, 20))
def test_choices_equal_the_walk(robots: int | None, seeds: range) -> None:
    answers = compared(seeds, robots)
    assert answers[True] >= 3
    assert answers[False] >= 3


@pytest.mark.parametrize("seed", range(8))
def test_many_plan_spaces_share_their_sets(seed: int) -> None:
    """Divergences over all candidate tasks: the walks' together, each once."""
    domain, problem, options = random_model(seed, 2)
    candidates = all_pairs(domain, [problem], options)
    spaces = [space for space in candidates.spaces if len(space)]
    if not spaces or any(inseparable(space) is not None for space in spaces):
        pytest.skip("this model has no task, or inseparable plans")
    found = first_differences(spaces)
    walks = [walk(space) for space in spaces]
    expected = {
        (last, *following)
        for twin in walks
        for last, following in zip(
            twin.divergences.last.tolist(), twin.divergences.following.tolist(), strict=True
        )
    }
    rows = zip(found.divergences.last.tolist(), found.divergences.following.tolist(), strict=True)
    assert [(last, *following) for last, following in rows] == sorted(expected)
    requiring = sum(
        int(twin.requires[space.starts].sum()) for twin, space in zip(walks, spaces, strict=True)
    )
    assert found.requiring == requiring
    sets = LabelSets()
    assert [Choices(space, sets).requires.tolist() for space in spaces] == [
        twin.requires.tolist() for twin in walks
    ]


TWO_WAYS = """(define (domain two-ways) (:types robot place)
 (:predicates (at ?r - robot ?x - place) (way ?x ?y - place))
 (:action walk :agent ?r - robot :parameters (?x ?y - place)
  :precondition (and (at ?r ?x) (way ?x ?y) (forall (?o - robot) (not (at ?o ?y))))
  :effect (and (at ?r ?y) (not (at ?r ?x))))
 (:action run :agent ?r - robot :parameters (?x ?y - place)
  :precondition (and (at ?r ?x) (way ?x ?y) (forall (?o - robot) (not (at ?o ?y))))
  :effect (and (at ?r ?y) (not (at ?r ?x)))))"""


def test_several_labels_lead_to_one_state() -> None:
    """Every robot may walk or run: several edges join the same two nodes, and plans mix freely."""
    domain = parse_domain(Source("domain", TWO_WAYS))
    places = " ".join(f"c{n}" for n in range(5))
    ways = " ".join(f"(way c{n} c{(n + k) % 5})" for n in range(5) for k in (1, 4))
    problem = parse_problem(
        Source(
            "problem",
            f"(define (problem p) (:domain two-ways) (:objects r1 r2 - robot {places} - place)"
            f" (:init (at r1 c0) (at r2 c2) {ways}) (:goal (at r1 c1)))",
        ),
        domain,
    )
    (space,) = all_pairs(domain, [problem]).spaces
    ends = np.column_stack((space.sources, space.targets()))
    assert len(np.unique(ends, axis=0)) < len(ends)
    assert inseparable(space) is None
    assert agree(space, 1_000_000)


def test_what_a_smaller_divergence_implies() -> None:
    assert DivergenceSearch(1).table().shape == (0, 2)  # a robot alone parts from nobody
    rows = np.array([[0, 3, 4, 5], [0, 1, 2, 3], [0, 1, 2, -1], [1, 1, 2, 3], [0, 2, 3, 4]])
    assert minimal(np.concatenate((rows, rows))).tolist() == [
        [0, 1, 2, -1],
        [0, 2, 3, 4],
        [0, 3, 4, 5],
        [1, 1, 2, 3],
    ]
