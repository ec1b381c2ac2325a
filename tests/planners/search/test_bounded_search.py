# SPDX-License-Identifier: GPL-3.0-or-later
"""The bounded search against the blind one: the same plan space, whatever it is bounded by.

What bounds it (heuristics, mutexes, the solver's formula) loses a plan here if it is wrong.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from random import Random
from typing import Any

import pytest

from planners.loading import PlanningInstance
from planners.pddl.model_options import Cost, ModelOptions
from planners.search import bounded_search, exact_bound
from planners.search.heuristics import HEURISTICS
from planners.search.optimal_plans import search, search_with_effort
from planners.search.plans import counts
from planners.search.reachable import Exploration
from planners.system.errors import BadInput, ProvedImpossible
from tests.support import slow, thorough
from tests.support.domains import world_of
from tests.support.random_models import random_threes
from tests.support.random_spaces import blind_search, equal, random_instance
from tests.support.texts import model_of

#: Searches that ask the solver at once, with effort for all or some of its answers, and one in small
#: pieces.
SIZES = (
    dict[str, int](),
    {"_PROBE": 0, "_EFFORT": 3_000},
    {"_PROBE": 0, "_EFFORT": 20_000, "states_at_once": 3, "_JOINT_LABELS": 0},
    {"states_at_once": 2, "steps_at_once": 5},
    {"_PROBE": 0, "_EFFORT": 20_000, "_QUESTION": 0, "_JOINT_LABELS": 0},
    {"_PROBE": 0, "_EFFORT": 300, "_QUESTION": 0},
    {"_PROBE": 1, "_EFFORT": 4_000},
)
ASKING = [sizes for sizes in SIZES if sizes.get("_PROBE") == 0]
COSTS: tuple[Cost, ...] = ("makespan", "makespan+actions", "makespan+cost")


def threes(seed: int) -> PlanningInstance:
    """A third robot decides what happens between two."""
    text = random_threes(seed)
    return model_of(text.domain, text.problem, ModelOptions(cost=COSTS[seed % 2]))


ROOMS = """(define (domain rooms) (:types robot place)
  (:predicates (at ?r - robot ?p - place) (way ?r - robot ?p ?q - place) (lit ?p - place)
    (low ?r - robot) (full ?r - robot))
  (:functions (total-cost) - number)
  (:action go :agent ?r - robot :parameters (?p ?q - place)
    :precondition (and (at ?r ?p) (way ?r ?p ?q))
    :effect (and (not (at ?r ?p)) (at ?r ?q) (increase (total-cost) 1)))
  (:action run :agent ?r - robot :parameters (?p ?q - place)
    :precondition (and (at ?r ?p) (way ?r ?p ?q) WHEN)
    :effect (and (not (at ?r ?p)) (at ?r ?q) (low ?r)))
  (:action light :agent ?r - robot :parameters (?p - place)
    :precondition (and (at ?r ?p) SIGN) :effect (and (lit ?p) (increase (total-cost) 1)))
  (:action dim :agent ?r - robot :parameters (?p - place)
    :precondition (and (at ?r ?p) (lit ?p)) :effect (not (lit ?p)))
  (:action rest :agent ?r - robot :parameters (?p - place) :precondition (and (at ?r ?p) SEEN)
    :effect (and (full ?r) (not (low ?r)) (increase (total-cost) 1)))
  (:action look :agent ?r - robot :parameters (?p - place)
    :precondition (at ?r ?p) :effect LOOKS))"""
#: What parts of the domain may be.
PARTS = {
    "WHEN": ("(not (low ?r))", "", "", "(lit ?q)"),
    "SIGN": ("(not (lit ?p))", ""),
    "SEEN": (
        "(low ?r)",
        "(low ?r)",
        "(exists (?o - robot) (and (not (= ?o ?r)) (low ?o)))",
        "(not (exists (?o - robot ?q ?s - place) (and (not (= ?o ?r)) (go ?o ?q ?s))))",
    ),
    "LOOKS": (
        "(full ?r)",
        "(when (lit ?p) (full ?r))",
        "(forall (?o - robot) (when (low ?o) (lit ?p)))",
    ),
}


def rooms(seed: int) -> PlanningInstance:
    """Robots that go about by themselves, in cheap and dear ways, and switch lights for all."""
    random, text = Random(seed), ROOMS
    robots, places = ["r1", "r2"], ["p1", "p2", "p3", "p4"]
    ways = [(r, p, q) for r in robots for p in places for q in places if random.random() < 0.6]
    facts = [f"(at {r} {random.choice(places)})" for r in robots]
    facts += [f"(way {r} {p} {q})" for r, p, q in ways]
    facts += [f"(low {r})" for r in robots if random.random() < 0.4]
    for part, choices in PARTS.items():
        text = text.replace(part, random.choice(choices))
    goal = [f"(at {random.choice(robots)} {random.choice(places)})"]
    goal += [f"(lit {p})" for p in random.sample(places, random.choice((1, 1, 2)))]
    problem = (
        f"(define (problem p) (:domain rooms) (:objects {' '.join(robots)} - robot "
        f"{' '.join(places)} - place) (:init (= (total-cost) 0) {' '.join(facts)})"
        f" (:goal (and (full {random.choice(robots)}) {' '.join(goal)})))"
    )
    return model_of(text, problem, ModelOptions(cost=random.choice((*COSTS[1:], "makespan+cost"))))


def sized(sizes: dict[str, int], search: Callable[..., Any], *asked: object) -> Any:
    with pytest.MonkeyPatch.context() as patch:
        for name, size in sizes.items():
            owners = (bounded_search, exact_bound, Exploration)
            patch.setattr(next(owner for owner in owners if hasattr(owner, name)), name, size)
        return search(*asked)


def compared(models: Iterable[PlanningInstance | None]) -> Counter[str]:
    met: Counter[str] = Counter()
    for number, loaded in enumerate(models):
        if loaded is None:
            continue
        model, task = loaded.model, loaded.tasks[0]
        searches = [(SIZES[number % len(SIZES)], heuristic) for heuristic in ("auto", *HEURISTICS)]
        if loaded.domain.name == "rooms":  # made for what the solver is asked
            searches = [(asking, "auto") for asking in ASKING[number % 2 :: 2]]
        try:
            twin = blind_search(model, task)
        except BadInput:  # joint actions that no robot can tell apart, somewhere
            continue
        except ProvedImpossible:
            met["unsolvable"] += 1
            for sizes, heuristic in searches:
                with pytest.raises(ProvedImpossible):
                    sized(sizes, search, model, task, heuristic)
            continue
        met["solved" if len(twin) > 1 else "at the goal"] += 1
        for sizes, heuristic in searches:
            found = sized(sizes, search, model, task, heuristic)
            assert (found.rows[found.state] == twin.rows[twin.state]).all()
            equal(found, replace(twin, rows=found.rows, state=found.state))
    return met


#: Families of models.
FAMILIES: dict[str, Callable[[int], PlanningInstance | None]] = {
    "any": random_instance,
    "threes": threes,
    "rooms": rooms,
}


@pytest.mark.parametrize(
    ("family", "seeds"),
    [
        ("any", range(34)),
        ("threes", range(18)),
        ("rooms", (3, 11, 12, 14, 15, 16, 17, 20, 21, 30)),
        *thorough(("rooms", (*range(22), 30, 34))),
        *slow(("any", range(10_000, 12_000)), ("threes", range(10_000, 10_800))),
        *slow(("rooms", range(10_000, 10_400))),
    ],
)
def test_bounds_lose_no_optimal_plan(family: str, seeds: Sequence[int]) -> None:
    met = compared(map(FAMILIES[family], seeds))
    assert min(met["solved"], met["unsolvable"]) >= 5


JOBS = """(define (domain jobs) (:requirements :typing) (:types robot job)
  (:predicates (done ?j - job) (can ?r - robot ?j - job) (asleep ?r - robot))
  (:action do :parameters (?r - robot ?j - job)
    :precondition (and (can ?r ?j) (not (asleep ?r)) (not (done ?j))) :effect (done ?j))
  (:action wake :parameters (?r - robot)
    :precondition (asleep ?r) :effect (not (asleep ?r))))"""


def test_a_bound_that_was_left_out_is_not_taken_as_refuted() -> None:
    """Seven jobs take six steps where r2 does one of them, and must be woken for that.

    Seven steps take one action less, and the round for six is left out, as rounds hardly grow.
    """
    jobs = [f"j{number}" for number in range(7)]
    problem = (
        f"(define (problem p) (:domain jobs) (:objects r1 r2 - robot {' '.join(jobs)} - job)"
        f"(:init {' '.join(f'(can r1 {job})' for job in jobs)} (can r2 j0) (asleep r2))"
        f"(:goal (and {' '.join(f'(done {job})' for job in jobs)})))"
    )
    loaded = model_of(JOBS, problem, ModelOptions(cost="makespan+actions"))
    asked = 0
    for probe in range(500, 5_000, 250):
        asking = {"_PROBE": probe}
        plans, effort = sized(asking, search_with_effort, loaded.model, loaded.tasks[0])
        assert plans.cost_of(0) == (6, 8)
        asked += "SAT" in effort.bounded_by
    assert asked >= 10


def test_on_open_grids_no_solver_is_asked() -> None:
    task = world_of("grid", "corners-8x8").loaded
    plans, effort = sized({"_PROBE": 400}, search_with_effort, task.model, task.tasks[0])
    assert (counts(plans)[int(plans.starts[0])], effort.rounds) == (8_383_608, 2)
    assert "SAT" not in effort.bounded_by


def test_no_plan_goes_on_beyond_the_goal() -> None:
    task = world_of("grid", "corners-3x3").loaded
    plans = search(task.model, task.tasks[0])
    start = int(plans.starts[0])
    own = [plans.labels_of(edge)[1:] for edge in plans.first_path(start)]
    path = plans.path_of_robots(start, [1], own)
    assert path is not None
    assert [plans.labels_of(edge)[1:] for edge in path] == own
    assert plans.path_of_robots(start, [1], [*own, own[0]]) is None
