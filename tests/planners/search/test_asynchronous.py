# SPDX-License-Identifier: GPL-3.0-or-later
"""Plans of robots without a common step against the definition: parts, timing, interleavings."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from coordlang.commands.building import build_language
from coordlang.language.candidates import all_pairs
from coordlang.language.words import Partition
from coordlang.verification.by_definition import verify
from planners.joint.composition import ComposingStepper
from planners.joint.model import Goal
from planners.joint.tables import Rows
from planners.joint.traces import Traces
from planners.loading import build, load
from planners.pddl.model_options import ModelOptions
from planners.search.asynchronous import asynchronous
from planners.search.optimal_plans import search
from planners.search.plan_space import PlanSpace
from planners.search.plans import Plans as Paths
from planners.system.errors import BadInput
from tests.support import naive, thorough
from tests.support.asynchronous import (
    ChangesAlone,
    Plans,
    World,
    least_words,
    random_plans,
    random_tasks,
    texts,
)
from tests.support.domains import DOMAINS, own_task
from tests.support.random_models import random_model
from tests.support.symmetric_worlds import GRID
from tests.support.symmetric_worlds import world as on_cells
from tests.support.texts import parsed

RUNS = [(2, range(18)), (3, range(4))]
THOROUGH = [(2, range(18, 1_500)), (3, range(4, 800)), (4, range(100))]
SEEDS = [*RUNS, *thorough(*THOROUGH)]


def paths(space: PlanSpace, task: int) -> dict[tuple[tuple[str, ...], ...], tuple[int, ...]]:
    """The parts of a task's plans, as texts, each with the states that the plan passes."""
    found = {}
    listed = Paths.of(space, task)
    for plan in listed:
        columns = enumerate(zip(*plan, strict=True)) if plan else enumerate([()] * space.robots)
        parts = tuple(
            tuple(space.model.labels[robot][number] for number in own if number)
            for robot, own in columns
        )
        assert parts not in found, "plans with equal parts are one"
        found[parts] = tuple(listed.states(plan))
    return found


def ends_of(space: PlanSpace, task: int) -> tuple[Rows, Goal]:
    """The state in which a task begins, and its goal."""
    start = space.starts[task]
    return space.rows[space.state[start]], space.goals[space.goal[start]]


@pytest.mark.parametrize(("robots", "seeds"), SEEDS)
def test_paths_are_the_plans_up_to_timing(robots: int, seeds: range) -> None:
    """They have the states of those that do everything as soon as possible, and come from them."""
    seen: Counter[str] = Counter()
    for space, world, tasks, _ in random_tasks(robots, seeds):
        try:
            made = asynchronous(space)
        except BadInput:
            seen["refused"] += 1
            continue
        for task in tasks:
            try:
                plans = Plans(world, space, task, 60)
            except naive.TooLarge:
                continue
            wanted = {texts(world.model, parts): states for parts, states in plans.states.items()}
            assert paths(made, task) == wanted
            seen["plans"] += len(wanted)
            listed = Paths.of(made, task)
            for plan in listed:
                assert listed.steps(plan) in plans.listed
                assert listed.of_steps(listed.steps(plan)) == plan
    assert seen["plans"] >= 30, seen


@pytest.mark.parametrize(("robots", "seeds"), SEEDS)
def test_under_a_language_every_interleaving_ends_in_the_goal(robots: int, seeds: range) -> None:
    """A language by definition, whatever time events take; and `verify` agrees."""
    seen: Counter[str] = Counter()
    for world, space, plans, made, random in random_plans(robots, seeds, 40):
        row, goal = ends_of(space, 0)
        for many in (1, 2, 4):
            word = {state: random.randrange(many) for state in range(len(space.rows))}
            mixtures = [mixed for mixed, _ in plans.mixtures(word)]
            if len(mixtures) > 100:
                continue
            holds = all(mixed in plans.states for mixed in mixtures)
            assert verify(Partition.of_states(space.rows, word), [made]).holds == holds
            ends = Counter(end for mixed in mixtures for end in world.ends(row, mixed, goal))
            assert not holds or set(ends) == {"arrived"}
            seen["language" if holds else "none"] += 1
            seen["mixtures"] += len(mixtures)
            seen["do not arrive"] += any(end != "arrived" for end in ends)
    assert min(seen["language"], seen["none"]) >= 5, seen


@pytest.mark.parametrize(("robots", "seeds"), [RUNS[0], *thorough(*THOROUGH[:2])])
def test_one_plan_is_the_soonest_in_every_event(robots: int, seeds: range) -> None:
    """Of plans with equal parts one has every event no later than any other one."""
    compared = 0
    for space, world, tasks, _ in random_tasks(robots, seeds):
        for task in tasks:
            row = space.rows[space.state[space.starts[task]]]
            by_parts: dict[object, list[tuple[tuple[int, ...], ...]]] = {}
            try:
                for plan in naive.listed(space, task, 60):
                    parts, when = world.parts(row, plan)
                    by_parts.setdefault(parts, []).append(when)
            except (naive.TooLarge, ChangesAlone):
                continue
            for timings in by_parts.values():
                times = np.array([[t for own in when for t in own] for when in timings])
                assert (times == times.min(axis=0)).all(axis=1).any()
                compared += len(timings) > 1
    assert compared > 0


#: Maps by their links, robots, fewest words in step and without.
MAPS = [
    ("ab bc ca", 2, 3, 3),
    ("ab ac ad", 2, 3, 3),
    ("ab bc cd da", 3, 3, 3),
    *thorough(
        ("ab bc cd da", 2, 3, 5),
        ("ab bc cd da ac", 2, 5, 6),
        ("ab ac ad bc bd cd", 2, 4, 4),
        ("ab bc ca cd", 2, 3, 3),
        ("ab ac ad ae", 2, 4, 4),
        ("ab bc cd ce", 2, 3, 3),
        ("ab bc ca ad be", 2, 3, 4),
        ("ab bc ca cd de ec", 2, 3, 4),
        ("ab bc cd da de", 2, 4, 6),
        ("ab bc cd de ea", 2, 3, 5),
        ("ab bc cd de cf", 2, 3, 4),
        ("ab bc ad be cf", 2, 3, 4),
        ("ab bc cd de ef fa", 2, 3, 5),
        ("ab bc de ef ad be cf", 2, 5, 9),
        ("ab bc ca cd", 3, 5, 5),
        ("ab bc cd de ea", 3, 5, 8),
    ),
]


@pytest.mark.parametrize(("links", "robots", "in_step", "asynchronously"), MAPS)
def test_least_words(links: str, robots: int, in_step: int, asynchronously: int) -> None:
    """As the brute force finds them; every mixture arrives in every interleaving."""
    cells = sorted({*links} - {" "})
    edges = [(cells.index(link[0]), cells.index(link[1])) for link in links.split()]
    problem = on_cells(len(cells), edges, robots)
    in_step_tasks = all_pairs(GRID, [problem])
    others = all_pairs(GRID, [problem], ModelOptions(asynchronous=True))
    for candidates, words in ((in_step_tasks, in_step), (others, asynchronously)):
        built = build_language(candidates, "minimal")
        assert len(built.language.words) == built.language.guarantee.lower_bound == words
    (space,) = in_step_tasks.spaces
    world = World(space.model)
    plans = [Plans(world, space, task, 200) for task in range(len(space.starts))]
    least, word = least_words(plans, range(len(space.rows)))
    assert least == asynchronously
    for task, own in enumerate(plans):
        row, goal = ends_of(space, task)
        for mixed, _ in own.mixtures(word):
            assert world.ends(row, mixed, goal) == {"arrived"}
    if in_step < asynchronously:
        assert sum(len(own.states) for own in plans) < sum(len(own.listed) for own in plans)


def test_single_steps_are_those_of_tables() -> None:
    """What a state allows, and what one step leads to, whether it is looked up alone or not."""
    seen: Counter[bool] = Counter()
    for space, world, _, random in random_tasks(3, range(16)):
        traces, model = Traces(space.model), space.model
        if not isinstance(model.stepper, ComposingStepper):
            continue
        for row in space.rows[:20]:
            options = model.stepper.choices(model.codec.facts_part(row[None, :]))
            for robot, (_, labels) in enumerate(options):
                for label in range(len(model.labels[robot])):
                    step = tuple(label if r == robot else 0 for r in range(space.robots))
                    assert traces.allows(row, step) == (label in labels)
            for _ in range(30):
                step = tuple(int(random.choice(labels.tolist())) for _, labels in options)
                result = traces.result(row, step)
                known = world.steps(row).get(step)
                assert (result is None) == (known is None)
                assert result is None or (result == known).all()
                seen[result is None] += 1
    assert min(seen.values()) > 100


def test_robots_that_turn_in_a_ring_meet(tmp_path: Path) -> None:
    """Three robots on three cells: nobody can go first."""
    old = (DOMAINS / "three-cells" / "problem.pddl").read_text()
    (tmp_path / "turn.pddl").write_text(
        old.replace("r1 r2 - robot", "r1 r2 r3 - robot")
        .replace("(:init", "(:init (at r3 c)")
        .replace(old[old.index("(:goal") :], "(:goal (and (at r1 b) (at r2 c) (at r3 a))))")
    )
    loaded = load(DOMAINS / "three-cells" / "domain.pddl", [tmp_path / "turn.pddl"])
    space = search(loaded.model, loaded.tasks[0])
    assert space.cost_of(0)[0] == 1
    (edge,) = space.out_edges(int(space.starts[0]))
    traces = Traces(space.model)
    assert traces.blocks(loaded.tasks[0].init, space.labels_of(edge)) == ((0, 1, 2),)
    (made,) = paths(asynchronous(space), 0)
    assert made[0] == ("(move r1 a b) (with r2 (move r2 b c)) (with r3 (move r3 c a))",)


def test_a_shared_action_and_two_that_lift_one_table_meet() -> None:
    (space,) = own_task("tray", "serve").spaces
    traces = Traces(space.model)
    path = space.first_path(int(space.starts[0]))
    blocks = [
        traces.blocks(space.rows[space.state[node]], space.labels_of(edge))
        for node, edge in zip(space.nodes_on(int(space.starts[0]), path), path, strict=False)
    ]
    assert any(len(block) == 2 for step in blocks for block in step)


NOT_ALL_AT_ONCE = """
(define (domain three) (:requirements :typing :negative-preconditions :multi-agent)
  (:types robot)
  (:predicates (done ?r - robot) (twice ?r - robot) (first ?r - robot))
  (:action e :agent ?r - robot :parameters ()
    :precondition (and (first ?r) (not (done ?r))
      (not (exists (?a ?b - robot) (and (not (= ?a ?b)) (f ?a) (f ?b)))))
    :effect (done ?r))
  (:action again :agent ?r - robot :parameters ()
    :precondition (and (first ?r) (done ?r) (not (twice ?r))) :effect (twice ?r))
  (:action f :agent ?r - robot :parameters ()
    :precondition (and (not (first ?r)) (not (done ?r))) :effect (done ?r)))
"""


def test_plans_of_which_none_is_the_soonest_are_refused() -> None:
    """r1 may begin beside each of two robots, not beside both: some robot is late, either one."""
    problem = """
(define (problem p) (:domain three) (:objects r1 r2 r3 - robot) (:init (first r1))
  (:goal (and (twice r1) (done r2) (done r3))))
"""
    domain, read_problem = parsed(NOT_ALL_AT_ONCE, problem)
    loaded = build(domain, [read_problem])
    space = search(loaded.model, loaded.tasks[0])
    with pytest.raises(BadInput, match="sooner in two ways"):
        asynchronous(space)


def test_a_state_that_changes_by_itself_is_refused() -> None:
    """A joint action in which nobody does anything."""
    domain, problem, options = random_model(23, 2)
    candidates = all_pairs(domain, [problem], replace(options, asynchronous=True))
    with pytest.raises(BadInput, match="changes while all robots idle"):
        candidates.spaces  # noqa: B018
