# SPDX-License-Identifier: GPL-3.0-or-later
"""The engine inside unified-planning: its plans against ours, and by its own validator."""

from __future__ import annotations

import subprocess
import sys
from collections import Counter
from contextlib import suppress
from fractions import Fraction
from itertools import islice
from pathlib import Path
from random import Random
from typing import Any
from unittest.mock import Mock

import pytest
import unified_planning.shortcuts as up
from unified_planning.engines import FailedValidationReason
from unified_planning.engines import PlanGenerationResultStatus as Status
from unified_planning.engines import ValidationResultStatus as Validity
from unified_planning.exceptions import (
    UPConflictingEffectsException,
    UPNoSuitableEngineAvailableException,
    UPUnsupportedProblemTypeError,
    UPUsageError,
)
from unified_planning.io import PDDLReader
from unified_planning.model import ContingentProblem
from unified_planning.model.multi_agent import Agent, MultiAgentProblem
from unified_planning.plans import (
    ActionInstance,
    PartialOrderPlan,
    PlanKind,
    SequentialPlan,
    STNPlan,
    TimeTriggeredPlan,
)

from benchmarks.paper.task_choices import languages_in_tasks
from coordlang.commands.building import build_language
from coordlang.language.candidates import from_problems
from coordlang.language.sentences import task_sentences
from coordlang.unified import engine as engine_module
from coordlang.unified import register
from coordlang.unified.engine import PLAN_KINDS, CoordlangEngine
from coordlang.unified.plans import label
from coordlang.unified.translation import PddlNames, translate
from planners.pddl.model_options import ModelOptions
from planners.search.optimal_plans import search
from planners.search.plans import Plans
from planners.system.errors import Unsupported, UsageError
from tests.support import thorough
from tests.support.command import Command
from tests.support.domains import ROOT, files_of, loaded_from


@pytest.fixture(autouse=True)
def _registered() -> None:
    register()


def solve(problem: Any, timeout: float | None = None, **params: Any) -> Any:
    with up.OneshotPlanner(name="coordlang", params=params) as planner:
        return planner.solve(problem, timeout=timeout)


def all_plans(problem: Any, **params: Any) -> list[Any]:
    with up.AnytimePlanner(name="coordlang", params=params) as planner:
        results = list(planner.get_solutions(problem))
    assert [r.status for r in results] == [Status.INTERMEDIATE] * (len(results) - 1) + [
        Status.SOLVED_OPTIMALLY
    ]
    return [r.plan for r in results]


def verdict(problem: Any, plan: Any, **params: Any) -> Any:
    with up.PlanValidator(name="coordlang", params=params) as validator:
        return validator.validate(problem, plan)


CROSSING = """(define (domain crossing) (:requirements :typing) (:types cell KIND)
  (:predicates (at ?r - KIND ?c - cell) (near ?a ?b - cell) (free ?c - cell) (seen))
  (:action move :parameters (?r - KIND ?a ?b - cell)
    :precondition (and (at ?r ?a) (near ?a ?b) (free ?b))
    :effect (and (not (at ?r ?a)) (at ?r ?b) (not (free ?b)) (free ?a))) MORE)"""


def crossing(cells: int = 4, kind: str = "robot", more: str = "") -> Any:
    """Two robots trade places on a star of cells (the T-map with four); a cell must be free."""
    names, others = [f"c{n}" for n in range(cells)], [n for n in range(cells) if n != 1]
    ways = " ".join(f"(near c{n} c1) (near c1 c{n})" for n in others)
    free = " ".join(f"(free c{n})" for n in (1, *range(3, cells)))
    return PDDLReader().parse_problem_string(
        CROSSING.replace("KIND", kind).replace("MORE", more),
        f"""(define (problem p) (:domain crossing) (:objects r1 r2 - {kind} {" ".join(names)} - cell)
        (:init (at r1 c0) (at r2 c2) {ways} {free}) (:goal (and (at r1 c2) (at r2 c0))))""",
    )


def read(folder: str, problem: str) -> Any:
    """A shipped domain by unified-planning's own reader."""
    return PDDLReader().parse_problem(*map(str, files_of(folder, problem)))


def steps_of(found: Any, plan: PartialOrderPlan) -> list[list[str]]:
    """The labels of a partial-order plan, layer by layer, by its definition."""
    before = {
        a: {b for b, later in plan.get_adjacency_list.items() if a in later}
        for a in plan.get_adjacency_list
    }
    depth: dict[Any, int] = {}
    while len(depth) < len(before):
        for action, earlier in before.items():
            if action not in depth and earlier <= depth.keys():
                depth[action] = 1 + max((depth[b] for b in earlier), default=-1)
    layers: list[list[str]] = [[] for _ in range(1 + max(depth.values(), default=-1))]
    for action, number in depth.items():
        layers[number].append(label(found, action))
    return [sorted(layer) for layer in layers]


@pytest.mark.parametrize(
    ("folder", "name", "robots"),
    [
        ("handover", "one-door", {}),
        ("elevator", "same-floor", {}),
        *thorough(("two-arms", "exchange", {"robots": ("arm1", "arm2")})),
    ],
)
def test_the_plans_are_those_of_the_pddl_files(
    folder: str, name: str, robots: dict[str, Any]
) -> None:
    loaded = loaded_from(folder, name, ModelOptions(tuple(robots.get("robots", ()))))
    ours, texts = Plans.of(search(loaded.model, loaded.tasks[0])), loaded.model.texts
    wanted = ([sorted({t for t in texts(step) if t}) for step in plan] for plan in ours)
    problem = read(folder, name)
    found = translate(problem)
    plans = all_plans(problem, **robots)
    assert plans
    assert Counter(str(steps_of(found, plan)) for plan in plans) == Counter(map(str, wanted))
    for plan in plans[:5]:
        assert verdict(problem, plan, **robots).status == Validity.VALID
        assert sequential_verdicts(problem, plan) == {Validity.VALID}


def sequential_verdicts(problem: Any, plan: PartialOrderPlan, most: int = 12) -> set[Any]:
    """What unified-planning's own validator says of the linearisations."""
    with up.PlanValidator(name="sequential_plan_validator") as validator:
        plans = list(islice(plan.all_sequential_plans(), most))
        return {validator.validate(problem, plan).status for plan in plans}


def test_an_optimal_plan(capfd: pytest.CaptureFixture[str]) -> None:
    problem = crossing()
    problem.add_quality_metric(up.MinimizeMakespan())
    result = solve(problem)
    assert result.status == Status.SOLVED_OPTIMALLY
    assert result.engine_name == "coordlang"
    assert result.metrics == {"makespan": "6", "plans": "2"}
    assert isinstance(result.plan, PartialOrderPlan)
    assert verdict(problem, result.plan).status == Validity.VALID
    kinds = {kind: solve(problem, plan_kind=kind).plan for kind in PLAN_KINDS}
    assert {kind: plan.kind for kind, plan in kinds.items()} == {kind: kind for kind in kinds}
    assert all(verdict(problem, plan).status == Validity.VALID for plan in kinds.values())
    assert capfd.readouterr() == ("", "")


# Multi-agent problems.


def agents() -> Any:
    """`crossing` with two agents, whose places are object fluents; one goal is private."""
    same, problem, cell = crossing(), MultiAgentProblem("crossing"), up.UserType("cell")
    near, free = same.fluent("near"), same.fluent("free")
    for fluent in (near, free):
        problem.ma_environment.add_fluent(fluent, default_initial_value=False)
    places = [same.object(f"c{n}") for n in range(4)]
    problem.add_objects(places)
    for atom, value in same.explicit_initial_values.items():
        if atom.fluent() in (near, free):
            problem.set_initial_value(atom, value)
    for name, start, goal in (("R1", 0, 2), ("R2", 2, 0)):
        agent, where = Agent(name, problem), up.Fluent("Where", cell)
        agent.add_public_fluent(where)
        move = up.InstantaneousAction("Move", a=cell, b=cell)
        for condition in (up.Equals(where(), move.a), near(move.a, move.b), free(move.b)):
            move.add_precondition(condition)
        for changed, value in ((where(), move.b), (free(move.b), False), (free(move.a), True)):
            move.add_effect(changed, value)
        agent.add_action(move)
        problem.add_agent(agent)
        problem.set_initial_value(up.Dot(agent, where()), places[start])
        if name == "R1":
            problem.add_goal(up.Equals(up.Dot(agent, where()), places[goal]))
        else:
            agent.add_private_goal(up.Equals(where(), places[goal]))
    return problem


def test_a_multi_agent_problem() -> None:
    problem, same = agents(), crossing()
    found = translate(problem)
    assert [schema.name for schema in found.domain.schemas] == ["move"], "equal actions are one"
    plans = all_plans(problem)
    ours = [steps_of(translate(same), plan) for plan in all_plans(same)]
    assert sorted(steps_of(found, plan) for plan in plans) == sorted(ours)
    assert {str(a.agent.name) for a in plans[0].get_adjacency_list} == {"R1", "R2"}
    assert verdict(problem, plans[0]).status == Validity.VALID
    assert "R1.Move" in str(plans[0])
    # Agents are of no type of the user, though PDDL calls all things objects.
    thing = up.UserType("object")
    every, lit = up.Variable("every", thing), up.Fluent("lit", up.BoolType(), thing=thing)
    problem, agent = MultiAgentProblem("all"), Agent("r1", MultiAgentProblem("all"))
    problem.ma_environment.add_fluent(lit, default_initial_value=True)
    problem.add_object("lamp", thing)
    done, mark = up.Fluent("done"), up.InstantaneousAction("mark")
    agent.add_public_fluent(done, default_initial_value=False)
    mark.add_precondition(up.Forall(lit(every), every))
    mark.add_effect(done(), value=True)
    agent.add_action(mark)
    problem.add_agent(agent)
    problem.add_goal(up.Dot(agent, done()))
    assert len(all_plans(problem)) == 1


def test_agents_of_different_kinds() -> None:
    """One action name with two meanings, others' fluents (Dot), a private one: guard, guest."""
    problem = MultiAgentProblem("door")
    open_ = up.Fluent("open", up.BoolType())
    problem.ma_environment.add_fluent(open_, default_initial_value=False)
    guard, guest = Agent("guard", problem), Agent("guest", problem)
    tired, inside = up.Fluent("tired", up.BoolType()), up.Fluent("inside", up.BoolType())
    guard.add_private_fluent(tired, default_initial_value=False)
    guest.add_public_fluent(inside, default_initial_value=False)
    act = up.InstantaneousAction("act")
    act.add_precondition(up.Not(tired()))
    act.add_effect(open_(), True)
    act.add_effect(tired(), True)
    guard.add_action(act)
    enter = up.InstantaneousAction("act")
    enter.add_precondition(up.And(open_(), up.Dot(guard, tired())))
    enter.add_effect(inside(), True)
    guest.add_action(enter)
    problem.add_agent(guard)
    problem.add_agent(guest)
    problem.add_goal(up.Dot(guest, inside()))
    found = translate(problem)
    assert sorted(schema.name for schema in found.domain.schemas) == ["act", "act__2"]
    (plan,) = all_plans(problem)
    assert steps_of(found, plan) == [["(act guard)"], ["(act__2 guest)"]]
    actions = plan.convert_to(PlanKind.SEQUENTIAL_PLAN, problem).actions
    assert [f"{a.agent.name}.{a.action.name}" for a in actions] == ["guard.act", "guest.act"]


# Every feature of conditions and effects, against unified-planning's own simulator.


def random_problem(seed: int) -> Any:
    """One robot in places that point at places, with random formulas and effects: conditional,
    universal, copying.  Object fluents are nested, compared, and assigned several times by one
    action, which is not applicable if the values differ.  (Two assignments without a condition
    that are different as written are never applicable to the library, even where the values are
    equal, so all but one speak of ``dark``, which the action a0 may change.)
    """
    random = Random(seed)
    robot, place = up.UserType("robot"), up.UserType("place")
    room = up.UserType("room", place)
    problem = up.Problem(f"random {seed}")
    at, next_ = up.Fluent("at", place, r=robot), up.Fluent("next", place, p=place)
    seen, dark = up.Fluent("seen", up.BoolType(), p=place), up.Fluent("dark", up.BoolType())
    problem.add_fluents([at, next_, seen, dark])
    r = problem.add_object("r", robot)
    places = [problem.add_object(f"p{n}", room if n == 2 else place) for n in range(3)]
    for p in places:
        problem.set_initial_value(next_(p), random.choice(places))
        problem.set_initial_value(seen(p), random.random() < 0.3)
    problem.set_initial_value(at(r), random.choice(places))
    problem.set_initial_value(dark, random.random() < 0.5)

    def value(x: Any, y: Any, depth: int = 2) -> Any:
        if depth == 0 or random.random() < 0.3:
            return random.choice([y, at(x), random.choice(places)])
        return next_(value(x, y, depth - 1))

    def formula(x: Any, y: Any, depth: int = 1) -> Any:
        z = up.Variable(f"z{depth}", place)
        small = up.Variable(f"s{depth}", room)
        if depth == 0 or random.random() < 0.3:
            return random.choice([up.Equals(value(x, y), value(x, y)), seen(value(x, y)), dark()])
        left, right = formula(x, y, depth - 1), formula(x, random.choice([y, z]), depth - 1)
        closed = formula(x, y, depth - 1)
        return random.choice(
            [
                up.And(left, closed),
                up.Or(left, closed),
                up.Not(left),
                up.Implies(left, closed),
                up.Iff(left, closed),
                up.Exists(up.And(up.Equals(next_(z), value(x, y)), right), z),
                up.Forall(up.Or(seen(z), right), z),
                up.Forall(up.Or(seen(small), up.Equals(small, value(x, y))), small),
            ]
        )

    for number in range(3):
        action = up.InstantaneousAction(f"a{number}", x=robot, y=place)
        x, y, v = action.x, action.y, up.Variable("v", place)
        if random.random() < 0.3:
            action.add_precondition(formula(x, y))
        for _ in range(random.randrange(2, 5)):
            now = random.choice([dark(), up.Not(dark())])
            condition = up.And(formula(x, y), now)
            if not action.effects and random.random() < 0.5:
                condition = up.TRUE()
            every = up.And(up.Or(seen(v), up.Not(up.Equals(v, value(x, y, 1)))), now)
            given = random.choice(
                [
                    (at(x), value(x, y), condition),
                    (next_(random.choice([y, places[0]])), value(x, y), condition),
                    (next_(random.choice([v, y])), random.choice([v, y, next_(v)]), every, [v]),
                    (seen(random.choice([y, places[1]])), random.random() < 0.8, condition),
                    (seen(y), formula(x, y), condition),
                    (seen(v), random.random() < 0.6, every, [v]),
                    (dark(), random.random() < 0.5, condition),
                ]
            )
            with suppress(UPConflictingEffectsException):  # the library refuses to model it
                action.add_effect(*given)
        if not number:
            action.add_effect(dark, up.Iff(dark, seen(y)))
        problem.add_action(action)
    problem.add_goal(up.Equals(at(r), random.choice(places)))
    problem.add_goal(seen(random.choice(places)))
    return problem


def shortest(problem: Any) -> tuple[int, int] | None:
    """Length and number of shortest plans, breadth first with unified-planning's simulator."""
    with up.SequentialSimulator(problem) as simulator:
        start = simulator.get_initial_state()
        atoms = [*problem.initial_values]

        def key(state: Any) -> tuple[str, ...]:
            return tuple(str(state.get_value(atom)) for atom in atoms)

        layer, seen, length = {key(start): (start, 1)}, {key(start)}, 0
        while layer:
            goals = sum(ways for state, ways in layer.values() if simulator.is_goal(state))
            if goals:
                return length, goals
            following: dict[tuple[str, ...], tuple[Any, int]] = {}
            for state, ways in layer.values():
                for action, args in simulator.get_applicable_actions(state):
                    after = simulator.apply(state, action, args)
                    if after is not None and key(after) not in seen:
                        _, others = following.get(key(after), (None, 0))
                        following[key(after)] = after, ways + others
            seen |= following.keys()
            layer, length = following, length + 1
    return None


#: Seeds with quick answers of each kind.
SOME = (0, 1, 6, 7, 10)


@pytest.mark.parametrize("seeds", [SOME, *thorough(range(100))], ids=len)
def test_formulas_and_effects_mean_what_they_mean_to_the_library(seeds: Any) -> None:
    answers = Counter[str]()
    for seed in seeds:
        problem = random_problem(seed)
        assert problem.kind <= CoordlangEngine.supported_kind()
        expected = shortest(problem)
        result = solve(problem, robots=("r",))
        if expected is None:
            assert result.status == Status.UNSOLVABLE_PROVEN, seed
            answers["unsolvable"] += 1
            continue
        assert result.status == Status.SOLVED_OPTIMALLY, seed
        assert (int(result.metrics["makespan"]), int(result.metrics["plans"])) == expected, seed
        assert isinstance(result.plan, SequentialPlan)
        answers["long" if expected[0] > 1 else "short"] += 1
    assert min(answers["unsolvable"], answers["long"], answers["short"]) >= 1, answers


# What is done in the same step.


def lifting() -> Any:
    """Two agents at a table with glasses; each may lift its end."""
    problem = MultiAgentProblem("table")
    for name in ("ann", "bob"):
        agent = Agent(name, problem)
        up_ = up.Fluent("up", up.BoolType())
        agent.add_public_fluent(up_, default_initial_value=False)
        lift = up.InstantaneousAction("lift")
        lift.add_precondition(up.Not(up_()))
        lift.add_effect(up_(), True)
        agent.add_action(lift)
        problem.add_agent(agent)
    return problem


PARTNER = {"lift": "(exists (?o - agent) (and (not (= ?o ?agent)) (lift ?o)))"}
ALONE = {"lift": "(forall (?o - agent) (not (lift ?o)))"}


def test_concurrency_constraints() -> None:
    problem = lifting()
    problem.add_goal(up.Dot(problem.agent("ann"), problem.agent("ann").fluent("up")()))
    free, partner, alone = (
        [
            steps_of(translate(problem, None, given), p)
            for p in all_plans(problem, concurrency=given)
        ]
        for given in (None, PARTNER, ALONE)
    )
    both, one = [["(lift ann)", "(lift bob)"]], [["(lift ann)"]]
    assert sorted(free) == sorted([both, one])
    assert partner == [both]
    assert alone == [one]
    problem.add_goal(up.Dot(problem.agent("bob"), problem.agent("bob").fluent("up")()))
    assert solve(problem, concurrency=ALONE).metrics["makespan"] == "2"
    (together,) = all_plans(problem, concurrency=PARTNER)
    assert verdict(problem, together, concurrency=PARTNER).status == Validity.VALID
    assert verdict(problem, together, concurrency=ALONE).status == Validity.INVALID


def test_formulas_name_agents_and_actions_whatever_else_is_called_so() -> None:
    problem = lifting()
    other = Agent("eve", problem)
    problem.add_object("o", up.UserType("agent"))
    other.add_public_fluent("lift", up.BoolType(), default_initial_value=True)
    problem.add_agent(other)
    ann, bob = problem.agent("ann"), problem.agent("bob")
    for agent in (ann, bob):
        problem.add_goal(up.Dot(agent, agent.fluent("up")()))
    assert solve(problem, concurrency=ALONE).metrics["makespan"] == "2"
    bob.action("lift").add_precondition(up.Dot(other, other.fluent("lift")()))
    for formula in (PARTNER["lift"], PARTNER["lift"].upper()):
        with pytest.raises(UsageError, match="'lift', which agents have in different forms"):
            translate(problem, None, {"lift": formula})
    problem.add_goal(ann.fluent("up")())
    with pytest.raises(Unsupported, match="fluent 'up', another agent's own, without Dot"):
        translate(problem)


def test_arguments_of_a_fluent_of_another_agent_are_own() -> None:
    problem = agents()
    plans, one, other = len(all_plans(problem)), problem.agents[0], Agent("eve", problem)
    seen = up.Fluent("seen", up.BoolType(), place=up.UserType("cell"))
    other.add_public_fluent(seen, default_initial_value=True)
    problem.add_agent(other)
    one.action("Move").add_precondition(up.Dot(other, seen(one.fluent("Where")())))
    assert len(all_plans(problem)) == plans


# Joint actions.


def test_joint_actions() -> None:
    """Each action is a whole step; the comments that say so in PDDL are given as an argument."""
    loaded = loaded_from("grid-joint", "three-cells")
    problem = read("grid-joint", "three-cells")
    parts: dict[str, dict[str, str | None]] = {
        schema.name: {
            p.robot: f"({' '.join(p.template)})" if p.template else None for p in schema.parts
        }
        for schema in loaded.domain.schemas
    }
    plans = all_plans(problem, subactions=parts)
    assert len(plans) == Plans.of(search(loaded.model, loaded.tasks[0])).count == 4
    assert all(isinstance(plan, SequentialPlan) and len(plan.actions) == 2 for plan in plans)
    with up.PlanValidator(name="sequential_plan_validator") as validator:
        assert all(validator.validate(problem, plan).status == Validity.VALID for plan in plans)
    assert all(verdict(problem, plan, subactions=parts).status == Validity.VALID for plan in plans)
    # What is done counts, not only by what parts: two actions have the same ones.
    problem = PDDLReader().parse_problem_string(
        """(define (domain d) (:predicates (p) (q) (g))
         (:action make :parameters () :effect (p))
         (:action first :parameters () :precondition (p) :effect (g))
         (:action second :parameters () :effect (g))
         (:action never :parameters () :precondition (q) :effect (g)))""",
        "(define (problem p) (:domain d) (:init ) (:goal (g)))",
    )
    texts = {"make": "(go)", "first": "(never)", "second": "(never)", "never": "(stop)"}
    parts = {name: {"r1": text} for name, text in texts.items()}
    for action in problem.actions:
        found = verdict(problem, SequentialPlan([ActionInstance(action)]), subactions=parts)
        assert (found.status == Validity.VALID) == (action.name == "second"), action.name


# Under a sentence.


def test_a_sentence_leaves_exactly_its_plans() -> None:
    problem = crossing(5)
    found = translate(problem)
    candidates = from_problems(found.domain, [found.problem])
    language = build_language(candidates, "greedy").language
    task_language = next(languages_in_tasks(language, candidates))
    everything = sorted(str(steps_of(found, plan)) for plan in all_plans(problem))
    listed = []
    used = task_language
    sentences = task_sentences(used.space, 0, used.partition, used.plans_with)
    assert len(sentences) > 1
    for sentence in sentences:
        text = " ".join(sentence.words)
        plans = all_plans(problem, language=language, sentence=text)
        assert len(plans) == sentence.plans
        listed += [str(steps_of(found, plan)) for plan in plans]
        assert verdict(problem, plans[0], language=language, sentence=text).status == Validity.VALID
        other = next(" ".join(s.words) for s in sentences if s != sentence)
        wrong = verdict(problem, plans[0], language=language, sentence=other)
        assert wrong.status == Validity.INVALID
        assert text in str(wrong.log_messages)
    assert sorted(listed) == everything
    assert len(all_plans(problem, language=language)) == len(everything)
    one = solve(problem, language=language, sentence=sentences[0].words)
    assert (one.status, one.log_messages) == (Status.SOLVED_OPTIMALLY, [])
    none = solve(problem, language=language, sentence="w1 w0 w1 w0 w1 w0 w1 w0 w1")
    assert none.status == Status.UNSOLVABLE_INCOMPLETELY
    assert "no optimal plan has the sentence" in str(none.log_messages)
    with pytest.raises(UPUsageError, match="no word of this language"):
        solve(problem, language=language, sentence="hello")


def test_a_language_for_plans_within_slack_is_refused(coordlang: Command, tmp_path: Path) -> None:
    """The engine's plans are optimal ones."""
    file = tmp_path / "language.json"
    options = ("--slack", "1", "--words", "1", "-o", file)
    assert coordlang("build", *files_of("three-cells"), *options).code == 0
    with pytest.raises(UPUsageError, match="plans within slack"):
        solve(crossing(), language=str(file))


def test_a_language_file_for_the_problem_that_the_library_read(
    coordlang: Command, tmp_path: Path
) -> None:
    files, file = files_of("handover", "two-doors"), tmp_path / "language.json"
    assert coordlang("build", *files, "--method", "greedy", "-o", file).code == 0
    problem = read("handover", "two-doors")
    result = solve(problem, language=str(file))
    assert (result.status, result.log_messages) == (Status.SOLVED_OPTIMALLY, [])
    problem.clear_goals()
    problem.add_goal(up.TRUE())
    result = solve(problem, language=str(file))
    assert result.status == Status.SOLVED_OPTIMALLY
    assert "does not cover this task" in str(result.log_messages)
    assert coordlang("build", *files, "-o", file, "--words", 1).code == 0
    result = solve(read("handover", "two-doors"), language=str(file))
    assert result.status == Status.SOLVED_OPTIMALLY
    assert "fail in 50 % of all runs" in str(result.log_messages)
    with pytest.raises(UPUsageError, match="unknown predicate"):
        solve(crossing(), language=str(file))


# What goes wrong, and how it is said.


def test_no_plan_and_an_empty_plan() -> None:
    problem = crossing(3)
    result = solve(problem)
    assert (result.status, result.plan) == (Status.UNSOLVABLE_PROVEN, None)
    with up.AnytimePlanner(name="coordlang") as planner:
        assert [r.status for r in planner.get_solutions(problem)] == [Status.UNSOLVABLE_PROVEN]
    problem = crossing()
    problem.clear_goals()
    (plan,) = all_plans(problem)
    assert not plan.get_adjacency_list
    assert verdict(problem, plan).status == Validity.VALID


def test_limits(monkeypatch: pytest.MonkeyPatch) -> None:
    assert {solve(crossing(), timeout=t).status for t in (1e-6, 0, -1)} == {Status.TIMEOUT}
    with up.AnytimePlanner(name="coordlang") as planner:
        stream = planner.get_solutions(crossing(), timeout=60)
        assert next(stream).status == Status.INTERMEDIATE
        monkeypatch.setattr("time.monotonic", lambda: 1e12)
        assert [r.status for r in stream] == [Status.TIMEOUT]
        monkeypatch.undo()
    monkeypatch.setattr(engine_module, "search", Mock(side_effect=MemoryError))
    assert solve(crossing()).status == Status.MEMOUT


class _Derived(up.Problem):  # type: ignore[misc]
    """What a class of somebody else adds to a problem is not known."""


@pytest.mark.filterwarnings("ignore:We cannot establish")
@pytest.mark.parametrize("skip", [False, True])
@pytest.mark.parametrize("kind", [ContingentProblem, _Derived])
def test_a_class_of_problems_that_is_not_read_is_refused(kind: Any, skip: bool) -> None:
    """Features and the classes of examples: `test_examples`."""
    problem, engine = kind("empty"), CoordlangEngine()
    engine.error_on_failed_checks, engine.skip_checks = False, skip
    for result in (engine.solve(problem), *engine.get_solutions(problem)):
        assert (result.status, result.plan) == (Status.UNSUPPORTED_PROBLEM, None)
        assert f"a {kind.__name__} is not supported" in str(result.log_messages)
    with pytest.raises(UPUnsupportedProblemTypeError, match="is not supported"):
        engine.validate(problem, SequentialPlan([]))


def test_a_check_that_fails_is_an_error_where_the_user_wants_it() -> None:
    problem = crossing()
    problem.add_timed_goal(up.GlobalStartTiming(5), problem.fluent("free")(problem.object("c3")))
    with pytest.raises(UPNoSuitableEngineAvailableException):
        up.OneshotPlanner(problem_kind=problem.kind, optimality_guarantee="SOLVED_OPTIMALLY")
    with pytest.raises(UPUsageError, match="cannot establish"):
        CoordlangEngine().solve(problem)


def test_what_nothing_uses_is_no_reason_to_refuse() -> None:
    problem = crossing()
    problem.add_fluent("length", up.IntType(), default_initial_value=3)
    nobody = up.Variable("n", up.UserType("nobody", up.UserType("person")))
    problem.add_goal(up.Not(up.Exists(up.Equals(nobody, nobody), nobody)))
    assert problem.kind <= CoordlangEngine.supported_kind()
    assert solve(problem).status == Status.SOLVED_OPTIMALLY


def test_the_factory_finds_the_engine_for_several_agents() -> None:
    optimal = {"anytime_guarantee": up.AnytimeGuarantee.OPTIMAL_PLANS}
    for mode, asked in ((up.OneshotPlanner, {}), (up.AnytimePlanner, optimal)):
        with mode(problem_kind=agents().kind, **asked) as planner:
            assert planner.name == "coordlang"


@pytest.mark.parametrize(
    ("params", "message"),
    [
        ({"sentence": "w0"}, "needs its language"),
        ({"robots": ("nobody",)}, "no object 'nobody'"),
        ({"robot_type": "cheese"}, "cheese"),
        ({"language": "missing.json"}, "no such file"),
        ({"plan_kind": PlanKind.STN_PLAN}, "partial-order"),
        *(({name: "bogus"}, "bogus") for name in ("cost", "unowned")),
        *(({name: ""}, name) for name in ("cost", "unowned")),
        *(
            ({n: 3}, f"{n}: expected ")
            for n in ("language", "sentence", "subactions", "concurrency")
        ),
        ({"remember_actions": "no"}, "remember_actions"),
        ({"robots": "r1"}, "sequence"),
        ({"robots": (1,)}, "no object or type"),
        ({"robots": ("r1",), "robot_type": "cheese"}, "both say"),
        ({"subactions": {"swapp": {"r1": "(move ?a)"}}}, "no action 'swapp'"),
        ({"subactions": {"move": "(move ?a)"}}, "subactions: '.move .a.' for 'move'"),
        ({"robot": "r1"}, "no parameter 'robot'"),
        ({"robots": 3}, "sequence"),
        ({"concurrency": {"lft": "(up ?agent)"}}, "concurrency: there is no action 'lft'"),
        ({"concurrency": {"lift": 3}}, "concurrency: 3 for 'lift'"),
        ({"concurrency": {"lift": "(exists (?o - agent) (lft ?o))"}}, "lft"),
        ({"concurrency": {"lift": "(and (lift ?agent)"}}, "never closed|unexpected|expected"),
    ],
)
def test_wrong_parameters(params: dict[str, Any], message: str) -> None:
    """They are refused in words of the engine: nobody has typed an option of the command line."""
    with pytest.raises(UPUsageError, match=message) as refused:
        solve(lifting() if "concurrency" in params else crossing(), **params)
    if isinstance(params.get("concurrency"), dict):
        with pytest.raises(UPUsageError, match="without agents"):
            solve(crossing(), **params)
    assert "--" not in str(refused.value)
    assert "`coordlang" not in str(refused.value)
    if message in ("bogus", "cost", "unowned"):
        with pytest.raises(UPUsageError):
            up.OneshotPlanner(name="coordlang", params=params)


def test_who_the_robots_are() -> None:
    problem = crossing()
    kind = problem.user_type("robot")
    robots = problem.objects(kind)
    for params in ({"robots": robots}, {"robots": ("r1", "r2")}, {"robot_type": kind}):
        assert solve(problem, **params).metrics["plans"] == "2"
    nobody = PDDLReader().parse_problem_string(
        "(define (domain d) (:predicates (on)) (:action press :parameters () :effect (on)))",
        "(define (problem p) (:domain d) (:init) (:goal (on)))",
    )
    with pytest.raises(UPUsageError, match="Say robot_type TYPE or robots NAME,NAME"):
        solve(nobody)
    with pytest.raises(UPUsageError, match="no agent"):
        solve(MultiAgentProblem("nobody"))


def test_a_note_is_a_message_in_words_of_the_engine() -> None:
    # One action takes nothing but a vehicle.
    problem = crossing(4, "vehicle", "(:action look :parameters (?r - vehicle) :effect (seen))")
    (message,) = solve(problem).log_messages
    assert "robots are taken to be r1, r2" in str(message)
    assert "Say robot_type vehicle if that is so" in str(message)
    assert solve(crossing()).log_messages == []


def test_invalid_plans() -> None:
    problem = crossing()
    good = solve(problem, plan_kind=PlanKind.SEQUENTIAL_PLAN).plan.actions

    def again(actions: Any) -> list[Any]:
        return [ActionInstance(a.action, a.actual_parameters) for a in actions]

    def refused(plan: Any, reason: Any) -> Any:
        found = verdict(problem, plan)
        assert (found.status, found.reason) == (Validity.INVALID, reason)
        return found

    assert verdict(problem, SequentialPlan(again(good))).status == Validity.VALID
    inapplicable = FailedValidationReason.INAPPLICABLE_ACTION
    late = refused(SequentialPlan(again([*good[:1], *good[:1], *good])), inapplicable)
    assert str(late.inapplicable_action) == str(good[0])
    assert "step 2" in str(late.log_messages)
    refused(SequentialPlan(again(good[:-1])), FailedValidationReason.UNSATISFIED_GOALS)
    one, two = again(good[:2])
    at_once: dict[Any, list[Any]] = {one: [], two: []}
    for order in (at_once, {one: [two], two: [one]}):  # the second has a cycle
        refused(PartialOrderPlan(order), FailedValidationReason.MUTEX_CONFLICT)
    wait = up.InstantaneousAction("wait", r=problem.user_type("robot"))
    elsewhere = (*one.actual_parameters[:2], up.ObjectExp(crossing(5).object("c4")))
    for action in (
        ActionInstance(wait, (up.ObjectExp(problem.object("r1")),)),
        ActionInstance(good[0].action, good[0].actual_parameters, agents().agents[0]),
        solve(agents(), plan_kind=PlanKind.SEQUENTIAL_PLAN).plan.actions[0],
        ActionInstance(one.action, elsewhere),
    ):
        refused(SequentialPlan([action]), inapplicable)
    refused(TimeTriggeredPlan([(Fraction(0), one, Fraction(3))]), inapplicable)
    warned = pytest.warns(UserWarning, match="cannot validate")
    with warned, pytest.raises(UPUsageError, match="a STNPlan cannot be validated"):
        verdict(problem, STNPlan([]))


def test_odd_names() -> None:
    """Capitals, spaces, names of PDDL itself, names that become equal in lower case."""
    problem = up.Problem("Odd (names)")
    robot, thing = up.UserType("Robot"), up.UserType("And")
    done = problem.add_fluent("Is Done?", up.BoolType(), x=thing, default_initial_value=False)
    twin = problem.add_fluent("is done?", up.BoolType(), x=thing, default_initial_value=False)
    things = [problem.add_object(name, thing) for name in ("Not", "not", "a b", "(x)")]
    problem.add_object("R 1", robot)
    problem.add_object("r 1", robot)
    for name in ("Do It", "do it"):
        action = up.InstantaneousAction(name, R=robot, r=thing)
        action.add_precondition(up.Not(done(action.parameter("r"))))
        action.add_effect((done if name == "Do It" else twin)(action.parameter("r")), True)
        problem.add_action(action)
    for thing_ in things[:2]:
        problem.add_goal(up.And(done(thing_), up.Not(twin(thing_))))
    plans = all_plans(problem)
    assert len(plans) == 2  # who does which
    assert {str(a) for a in plans[0].get_adjacency_list} in (
        {"Do It(R 1, Not)", "Do It(r 1, not)"},
        {"Do It(R 1, not)", "Do It(r 1, Not)"},
    )
    assert sequential_verdicts(problem, plans[0]) == {Validity.VALID}
    names = PddlNames()
    made = [names.of("object", n, n) for n in ("x", "X", "?x", "", "-", "object", "x")]
    assert made == ["x", "x__2", "_x", "x__3", "x__4", "object__2", "x"]


@pytest.mark.thorough
def test_the_engine_by_a_file_beside_the_program(tmp_path: Path) -> None:
    """The lines of docs/unified-planning.md: no `register` is needed."""
    page = (ROOT / "docs" / "unified-planning.md").read_text()
    lines = page[page.index("[engine coordlang]") :].split("```")[0]
    (tmp_path / "up.ini").write_text(lines)
    program = tmp_path / "program.py"
    program.write_text(
        "import sys, coordlang.unified\n"
        "print('unified_planning' in sys.modules)  # by `register` only\n"
        "from unified_planning.shortcuts import OneshotPlanner\n"
        "with OneshotPlanner(name='coordlang') as planner:\n    print(planner.name)\n"
    )
    line = [sys.executable, str(program)]
    done = subprocess.run(line, capture_output=True, text=True, check=True)
    said = done.stdout.splitlines()
    assert (said[0], said[-1]) == ("False", "coordlang")


@pytest.mark.parametrize(("robot", "valid"), [("r2", True), ("r1", False)])
def test_a_valid_plan_may_have_an_action_that_is_idling(robot: str, valid: bool) -> None:
    """Only r2 is awake, so only r2 may rest, which does nothing."""
    problem = PDDLReader().parse_problem_string(
        """(define (domain rooms) (:types robot place)
        (:predicates (at ?r - robot ?p - place) (awake ?r - robot))
        (:action go :parameters (?r - robot ?a ?b - place) :precondition (at ?r ?a)
          :effect (and (not (at ?r ?a)) (at ?r ?b)))
        (:action rest :parameters (?r - robot) :precondition (awake ?r))
        (:action wake :parameters (?r - robot) :effect (awake ?r)))""",
        """(define (problem p) (:domain rooms) (:objects r1 r2 - robot a b - place)
        (:init (at r1 a) (awake r2)) (:goal (at r1 b)))""",
    )
    move, idle = (
        ActionInstance(problem.action(name), tuple(map(up.ObjectExp, map(problem.object, given))))
        for name, given in (("go", ("r1", "a", "b")), ("rest", (robot,)))
    )
    found = verdict(problem, SequentialPlan([move, idle]), robot_type="robot")
    with up.PlanValidator(name="sequential_plan_validator") as validator:
        assert validator.validate(problem, SequentialPlan([move, idle])).status == found.status
    assert (found.status == Validity.VALID) == valid
    # Where the order does not say the steps, a message says that another order may be no plan.
    again = ActionInstance(idle.action, idle.actual_parameters)
    for order, said in ((((idle, move), (move, again)), False), (((idle, again),), True)):
        followers = {a: [b for one, b in order if one is a] for a in (idle, move, again)}
        found = verdict(problem, PartialOrderPlan(followers), robot_type="robot")
        assert said == ("may be no plan" in str(found.log_messages)) or not valid
