# SPDX-License-Identifier: GPL-3.0-or-later
"""Tasks one by one have the plans that they have together, whatever else is asked."""

from __future__ import annotations

import json
import warnings
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

import coordlang
from coordlang.language import candidates as room
from coordlang.language.candidates import Candidates, describe, from_listed
from coordlang.language.file import to_bytes
from coordlang.language.listed import ListedTask, goal_text
from planners.joint.model import JointModel
from planners.pddl import parse_domain, parse_problem
from planners.pddl.model_options import ModelOptions
from planners.pddl.sexpr import Source
from planners.search.plans import Plans, counts
from planners.search.reachable import explore
from planners.system.errors import BadInput, Note, ProvedImpossible
from tests.support import thorough
from tests.support.command import Command
from tests.support.domains import files_of, read
from tests.support.joint_twin import built
from tests.support.random_pddl import random_model


@pytest.fixture
def large(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every space is too large to be explored."""
    monkeypatch.setattr(room, "MOST_STATES", 0)


def answers(candidates: Candidates) -> Counter[tuple[object, ...]]:
    """Of each task its cost and all its plans, as labels and states."""
    found: Counter[tuple[object, ...]] = Counter()
    for space in candidates.spaces:
        for task in range(len(space.starts)):
            plans = Plans.of(space, task)
            listed = sorted(
                (plan, tuple(map(space.model.state_text, space.rows[[*plans.states(plan)]])))
                for plan in plans
            )
            found[describe(space, task), space.cost_of(task), tuple(listed)] += 1
    return found


def some_tasks(model: JointModel, start: np.ndarray, most: int) -> list[ListedTask]:
    """Pairs of reachable states and a partial goal, some of them without a plan."""
    space = explore(model, start[None, :])
    rows = model.codec.facts_part(space.rows)[:: max(1, len(space) // most)][:most]
    states = [tuple(model.codec.facts.texts[f] for f in model.codec.true_facts(r)) for r in rows]
    never = (states[0][0], f"(not {states[0][0]})") if states[0] else ()
    goals = [*(own[:2] for own in states[::2]), never]
    return [ListedTask(init, goal) for init in states for goal in goals]


@pytest.mark.parametrize("kind", ["agent", *thorough("plain")])
def test_random_tasks_have_the_same_plans(
    kind: str, monkeypatch: pytest.MonkeyPatch, searches: list[str]
) -> None:
    compared = shared = skipped = 0
    for seed in range(8):
        text = random_model(seed, kind)  # type: ignore[arg-type]
        domain = parse_domain(Source("d", text.domain))
        problem = parse_problem(Source("p", text.problem), domain)
        world = built(text)
        listed = some_tasks(world.model, world.tasks[0].init, 4)
        for remember, cost in ((False, "makespan"), (True, "makespan+actions")):
            options = ModelOptions(
                unowned=text.unowned,
                cost=cost,  # type: ignore[arg-type]
                remember_actions=remember,
            )
            with warnings.catch_warnings(), monkeypatch.context() as patched:
                warnings.simplefilter("ignore", Note)
                try:
                    explored = from_listed(domain, [problem], listed, options, skip_unsolvable=True)
                except ProvedImpossible:
                    continue
                if sum(sum(counts(space)) for space in explored.spaces) > 2000:
                    continue  # plans are listed one by one
                patched.setattr(room, "MOST_STATES", 0)
                before = len(searches)
                single = from_listed(domain, [problem], listed, options, skip_unsolvable=True)
            assert (explored.states is None, single.states) == (False, None)
            assert answers(single) == answers(explored)
            assert single.count == explored.count
            assert single.skipped == explored.skipped
            assert single.listed == explored.listed
            compared += single.count
            shared += single.count + len(single.skipped) - (len(searches) - before)
            skipped += len(single.skipped)
    assert min(compared, shared, skipped) > 10


def test_tasks_on_one_plan_share_its_search(large: None, searches: list[str]) -> None:
    domain, problem = read("grid", "gw4-3x3")
    cells = ["c0-0", "c0-1", "c0-2", "c1-2"]
    tasks = [ListedTask((f"(at r1 {c})", "(at r2 c2-0)"), ("(at r1 c2-2)",)) for c in cells]
    with pytest.warns(Note, match="4 of 4 tasks start elsewhere .* is not checked"):
        found = from_listed(domain, [problem], tasks)
    assert searches == ["1"]
    costs = [found.spaces[0].cost_of(task)[0] for task in range(4)]
    assert costs == [4, 3, 2, 1]
    assert [goal_text(found.model, goal) for goal in found.spaces[0].goals] == ["(at r1 c2-2)"] * 4


@pytest.mark.parametrize(
    "init", [("(at r1 c0-0)",), ("(at r1 c0-0)", "(at r1 c0-1)", "(at r2 c1-1)"), ()]
)
def test_a_robot_that_is_nowhere_or_in_two_places_is_a_mistake(
    large: None, init: tuple[str, ...]
) -> None:
    domain, problem = read("grid", "gw4-3x3")
    good = ListedTask(("(at r1 c0-0)", "(at r2 c1-1)"), ())
    with pytest.raises(BadInput, match=r"task 2: the state .* cannot be reached from the initial"):
        from_listed(domain, [problem], [good, ListedTask(init, ())])


# ---- idling is a rule of the model: nothing else changes a task's plans

#: A do-nothing action that is possible for a robot that is awake.
_REST = """(:action rest :agent ?r - robot :parameters () :precondition (awake ?r))
  (:action wake :agent ?r - robot :parameters () :precondition (not (awake ?r)) :effect (awake ?r))"""


@pytest.fixture
def files(tmp_path: Path) -> tuple[Path, Path, Path]:
    """A T-map with a cell ``far`` and an action ``rest``; r2 is awake in problem A, not in B."""
    domain, problem = (path.read_text() for path in files_of("t-map"))
    domain = domain.replace("(:predicates", "(:predicates (awake ?r - robot)")
    domain = domain.rstrip().removesuffix(")") + _REST + ")"
    problem = problem.replace("c0-1\n", "c0-1 far\n", 1)
    paths = tmp_path / "domain.pddl", tmp_path / "a.pddl", tmp_path / "b.pddl"
    paths[0].write_text(domain)
    paths[1].write_text(problem.replace("(:init", "(:init (awake r1) (awake r2)"))
    paths[2].write_text(problem.replace("(:init", "(:init (awake r1)"))
    return paths


def test_a_tasks_plans_do_not_depend_on_other_problems(files: tuple[Path, Path, Path]) -> None:
    domain, a, b = files
    alone = [coordlang.plans(domain, problem).count for problem in (a, b)]
    assert [task.plans for task in coordlang.coordination(domain, a, b)] == alone
    assert [task.plans for task in coordlang.coordination(domain, b, a)] == alone[::-1]
    assert all(coordlang.coordination(domain, a, b))


def test_a_language_is_verified_in_the_model_of_the_domain(
    files: tuple[Path, Path, Path], tmp_path: Path
) -> None:
    domain, a, b = files
    built = coordlang.build(domain, a, method="greedy")
    path = tmp_path / "a.json"
    built.language.save(path)
    assert "idle" not in json.loads(path.read_text())["model"]
    again = coordlang.build(domain, b, start=path)
    assert again.tasks == 2
    assert again.job.first_differences.requiring == 2
    assert coordlang.verify(again.language, domain, a, b)


def test_a_file_with_another_rule_is_refused(
    files: tuple[Path, Path, Path], tmp_path: Path
) -> None:
    """One with the same rule is read."""
    domain, a, _ = files
    data = json.loads(to_bytes(coordlang.build(domain, a, method="greedy").language))
    path = tmp_path / "old.json"
    for idle in (["r1"], [], ["r1", "r2", "r3"]):
        path.write_text(json.dumps({**data, "model": {**data["model"], "idle": idle}}))
        with pytest.raises(coordlang.BadInput, match="some robot might not idle") as refused:
            coordlang.verify(path, domain, a)
        assert "coordlang build" in str(refused.value)
    path.write_text(json.dumps({**data, "model": {**data["model"], "idle": ["r2", "r1"]}}))
    assert coordlang.verify(path, domain, a)
    assert "idle" not in coordlang.load_language(path).provenance.model


def test_a_plan_with_what_is_left_out(
    files: tuple[Path, Path, Path], tmp_path: Path, coordlang: Command
) -> None:
    domain, a, _ = files
    language, plan = tmp_path / "l.json", tmp_path / "plan"
    assert coordlang("build", domain, a, "--method", "greedy", "-o", language).code == 0
    actions = [["(move r1 c0-1 c1-1)", "(rest r2)"]]
    for text in (
        "0: (rest r2)\n0: (move r1 c0-1 c1-1)\n",
        json.dumps({"plans": [{"cost": 1, "actions": actions}], "count": 1}),
    ):
        plan.write_text(text)
        refused = coordlang("say", language, domain, a, plan)
        assert refused.code == 1
        assert "(rest r2)" in refused.err
        assert "idling" in refused.err
    assert "rest: idling" in coordlang("inspect", domain, a).out


def test_all_pairs_are_those_of_the_same_states(tmp_path: Path) -> None:
    """As many states are reachable from a mirrored start, but other ones."""
    domain, shipped = files_of("t-map")
    text = shipped.read_text()
    walls = text.replace("(adjacent c1-0 c1-1)", "").replace("(adjacent c1-1 c1-0)", "")
    problems = []
    for number, start in enumerate(("(at r1 c1-0) (at r2 c1-1)", "(at r2 c1-0) (at r1 c1-1)")):
        problems.append(tmp_path / f"p{number}.pddl")
        problems[-1].write_text(walls.replace("(at r1 c0-1) (at r2 c1-0)", start))
    language = coordlang.build(domain, problems[0], tasks="all", method="greedy").language
    assert coordlang.verify(language, domain, problems[0])
    with pytest.raises(coordlang.BadInput, match="all pairs of other states"):
        coordlang.verify(language, domain, problems[1])
