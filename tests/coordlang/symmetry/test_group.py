# SPDX-License-Identifier: GPL-3.0-or-later
"""Symmetries: the group that the slow twin finds, checked on the model, and bounded."""

from __future__ import annotations

from itertools import combinations, permutations
from random import Random

import pytest

from coordlang.language.candidates import Candidates, all_pairs, from_problems
from coordlang.symmetry.graph import automorphism_generators
from coordlang.symmetry.group import SymmetryGroup, checked_generators, symmetry_group
from planners.pddl import parse_domain, parse_problem
from planners.pddl.sexpr import Source
from planners.search.plans import Plans, counts
from planners.system.errors import ProvedImpossible
from tests.support.candidates import random_candidates, some_tasks
from tests.support.domains import all_tasks
from tests.support.symmetric_worlds import GRID, state_symmetries, world


def random_world(random: Random) -> Candidates | None:
    """A few cells, some of which are neighbours; all tasks, one task, or a few of them."""
    cells = random.randint(3, 5)
    edges = [edge for edge in combinations(range(cells), 2) if random.random() < 0.85]
    robots = random.choice([2, 2, 3]) if cells < 5 else 2
    problem = world(cells, edges, robots)
    every = all_pairs(GRID, [problem])
    if not every.count:
        return None
    kind = random.choice(["all", "one", "some"])
    if kind == "all":
        return every
    if kind == "one":
        try:
            return from_problems(GRID, [problem])
        except ProvedImpossible:
            return None
    return some_tasks(every, random, random.randint(1, 4))


def elements(group: SymmetryGroup) -> set[tuple[int, ...]]:
    return set(map(tuple, group.permutations))


def dropped(candidates: Candidates) -> int:
    """How many automorphisms of the graph are no symmetries of the model."""
    return len(automorphism_generators(candidates)) - len(checked_generators(candidates))


def is_group(permutations: set[tuple[int, ...]]) -> bool:
    """Whether one after another, and the identity, are among them again."""
    known = permutations | {tuple(range(len(next(iter(permutations)))))} if permutations else set()
    return all(tuple(a[s] for s in b) in known for a in permutations for b in permutations)


@pytest.mark.thorough
def test_the_group_that_the_slow_twin_finds() -> None:
    random = Random(5)
    sizes = []
    for _ in range(40):
        candidates = random_world(random)
        if candidates is None:
            continue
        group = symmetry_group(candidates, largest=1_000)
        assert elements(group) == state_symmetries(candidates)
        assert not dropped(candidates)
        sizes.append(len(group.symmetries))
    assert sum(size > 1 for size in sizes) >= 8
    assert max(sizes) >= 47


@pytest.mark.parametrize("robots", [2, 3])
def test_the_group_of_unstructured_models(robots: int) -> None:
    """Random models: mostly no symmetry, and never one that the twin does not find."""
    found = 0
    for _, candidates in random_candidates(range(40), robots, 3_000):
        group = symmetry_group(candidates)
        assert elements(group) == state_symmetries(candidates)
        found += bool(group.symmetries)
    assert found >= 2


@pytest.mark.parametrize(
    "name",
    [
        *("three-cells/problem", "t-map/problem", "grid/gw2-2x3", "grid-joint/gw1-2x2"),
        *("handover/two-doors", "push-box/next-door", "lock/three-robots", "tray/serve"),
    ],
)
def test_the_group_of_shipped_domains(name: str) -> None:
    candidates = all_tasks(*name.split("/"))
    group = symmetry_group(candidates)
    assert elements(group) == state_symmetries(candidates)
    assert is_group(elements(group))
    assert not dropped(candidates)


def test_of_a_large_group_a_subgroup() -> None:
    """Three robots in four cells, all neighbours of each other: 4! times 3! symmetries."""
    candidates = all_pairs(GRID, [world(4, list(combinations(range(4), 2)), 3)])
    whole = elements(symmetry_group(candidates, largest=144))
    assert len(whole) == 143
    for largest in (1, 2, 7, 64, 143):
        part = elements(symmetry_group(candidates, largest))
        assert part < whole
        assert len(part) < largest
        assert is_group(part)
    assert len(elements(symmetry_group(candidates))) >= 23


SIGNS = """(define (domain signs) (:types robot place sign)
  (:predicates (at ?r - robot ?p - place) (way ?a ?b - place) (posted ?s - sign ?p - place))
  (:action go :agent ?r - robot :parameters (?a ?b - place)
    :precondition (and (at ?r ?a) (way ?a ?b)
      (forall (?s - sign ?o - robot ?x - place)
        (or (not (posted ?s ?b)) (= ?o ?r) (not (go ?o ?x ?b)))))
    :effect (and (at ?r ?b) (not (at ?r ?a)))))"""


def test_a_renaming_that_changes_what_an_action_needs_is_no_symmetry() -> None:
    """Two ways around; by a sign, which no fact or action names, robots come one at a time."""
    domain = parse_domain(Source("signs", SIGNS))
    text = """(define (problem p) (:domain signs) (:objects r1 r2 - robot a b c d - place s - sign)
      (:init (at r1 a) (at r2 a) (way a c) (way a d) (way c b) (way d b) {})
      (:goal (and (at r1 b) (at r2 b))))"""
    signs = {"": 3, "(posted s c) (posted s b)": 1, "(posted s c) (posted s d)": 1}
    for posted, size in signs.items():
        problem = parse_problem(Source("p", text.format(posted)), domain)
        candidates = from_problems(domain, [problem])
        group = symmetry_group(candidates)
        check_plans(candidates, group)
        assert (len(group.symmetries), dropped(candidates)) == (size, 0)


def test_states_and_tasks_are_not_enough(monkeypatch: pytest.MonkeyPatch) -> None:
    """Everywhere is next to everywhere, and all pairs of states are tasks; one place has a sign."""
    domain = parse_domain(Source("signs", SIGNS))
    ways = " ".join(f"(way {x} {y})" for x, y in permutations("abc", 2))
    text = f"""(define (problem p) (:domain signs) (:objects r1 r2 - robot a b c - place s - sign)
      (:init (at r1 a) (at r2 a) {ways} (posted s c)) (:goal (at r1 b)))"""
    candidates = all_pairs(domain, [parse_problem(Source("p", text), domain)])
    group = symmetry_group(candidates)
    check_plans(candidates, group)
    assert (len(group.symmetries), dropped(candidates)) == (3, 0)
    # A graph without room for the actions is too symmetric: what bliss finds in it is dropped.
    some_are_dropped = set()
    for size in range(20, 60, 4):
        monkeypatch.setattr("coordlang.symmetry.graph.LARGEST_GRAPH", size)
        part = symmetry_group(candidates)
        check_plans(candidates, part)
        assert elements(part) <= elements(group)
        some_are_dropped.add(dropped(candidates) > 0)
    assert some_are_dropped == {False, True}


def check_plans(candidates: Candidates, group: SymmetryGroup) -> None:
    """The definition: the optimal plans of a task go to the optimal plans of a task."""
    plans_of_tasks = set()
    for space in candidates.spaces:
        counted = counts(space)
        for start in space.starts.tolist():
            plans = Plans(space, start, counted)
            plans_of_tasks.add(frozenset(tuple(plans.states(plan)) for plan in plans))
    for permutation in group.permutations:
        assert plans_of_tasks == {
            frozenset(tuple(permutation[s] for s in states) for states in plans)
            for plans in plans_of_tasks
        }
