"""The fast joint model and plan search against brute force, on small random models of every kind."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from itertools import islice
from typing import Any
from unittest.mock import patch

import pytest
from hypothesis import Phase, event, given, settings
from hypothesis import strategies as st
from naive import TooLarge, Twin
from random_pddl import KINDS, Kind, RandomModel, random_model

from planners.check.validate import State, validate
from planners.errors import BadInput, ProvedImpossible
from planners.grounding import instantiate
from planners.grounding.reachability import reachable_arguments
from planners.joint.model import own_text
from planners.loading import ModelOptions, PlanningInstance, build, task_of
from planners.pddl import parse_domain, parse_problem
from planners.pddl.lifted import And, Atom, Domain, Formula, Not, Problem
from planners.pddl.robots import RobotSelection
from planners.pddl.sexpr import Source
from planners.search.optimal_plans import plan_spaces, search
from planners.search.plans import Plans
from planners.search.reachable import explore

_MOST_STATES = 128
_MOST_TRIES = 3_000
_MOST_PLANS = 300


@pytest.fixture(autouse=True, scope="module")
def one_reachability_per_model() -> Iterator[None]:
    """Every model is built for two costs: compile and run Tarski's program once."""
    asked: dict[str, dict[str, list[tuple[str, ...]]]] = {}

    def remembered(
        domain: Domain, objects: dict[str, tuple[str, ...]], init: Iterable[Atom]
    ) -> Any:
        init = list(init)
        key = domain.source.text + str((objects, init))
        if key not in asked:
            asked.clear()
            asked[key] = reachable_arguments(domain, objects, init)
        return asked[key]

    with patch.object(instantiate, "reachable_arguments", remembered):
        yield


def _load(text: RandomModel, cost: str = "makespan") -> PlanningInstance:
    domain = parse_domain(Source("domain", text.domain))
    problem = parse_problem(Source("problem", text.problem), domain)
    options = ModelOptions(robots=RobotSelection(unowned=text.unowned), cost=cost)  # type: ignore[arg-type]
    return build(domain, [problem], options)


def _twin(loaded: PlanningInstance, text: RandomModel) -> Twin:
    domain, (problem,) = loaded.domain, loaded.problems
    return Twin(domain, problem, loaded.team, loaded.model.keeps_idle, _MOST_TRIES)


def _key(state: State) -> list[str]:
    return sorted("(" + " ".join((atom.predicate, *atom.args)) + ")" for atom in state)


def _fast_steps(
    loaded: PlanningInstance, state: State
) -> set[tuple[tuple[str | None, ...], tuple[str, ...]]]:
    model = loaded.model
    steps = model.successors(model.codec.encode(_key(state))[None, :])
    found = [
        (model.texts(labels), tuple(model.codec.decode(row)))
        for labels, row in zip(steps.labels, steps.result, strict=True)
    ]
    assert len(set(found)) == len(found), "a joint step is listed twice"
    return set(found)


def _check_model(text: RandomModel, note: Callable[[str], None]) -> None:
    loaded = _load(text)
    twin = _twin(loaded, text)
    try:
        states = twin.reachable(_MOST_STATES)
    except TooLarge:
        note("too large")
        return
    except BadInput:
        note(
            "ambiguous parts"
        )  # exit 31: two joint actions with the same parts do different things
        with pytest.raises(BadInput, match="different results"):
            explore(loaded.model, loaded.tasks[0].init[None, :])
        return
    for state in states:
        slow = {(labels, tuple(_key(after))) for labels, after in twin.successors(state)}
        assert _fast_steps(loaded, state) == slow, _key(state)
    note("one state" if len(states) == 1 else "several states")
    if not all(loaded.model.keeps_idle):
        note("nobody has to idle")
        _check_idling_adds_nothing(twin)
    if len(states) == 1:
        _check_plans(loaded, twin, loaded.problems[0], note)
        return
    for one in (loaded, _load(text, "makespan+actions")):
        _check_plans(one, twin, one.problems[0], note)
        _check_plans(one, twin, _far(twin, states[-1]), note)


def _check_idling_adds_nothing(twin: Twin) -> None:
    """Where a robot may not idle, its do-nothing action leads everywhere that idling would lead."""
    rules = twin.rules
    free = Twin(rules.domain, rules.problem, rules.team, budget=_MOST_TRIES)
    for state in free.reachable(_MOST_STATES):
        assert {t for _, t in free.successors(state)} == {t for _, t in twin.successors(state)}, (
            _key(state)
        )


def _far(twin: Twin, state: State) -> Problem:
    """The same problem with the last state that the twin reached as its goal, as far as it differs
    from the first.
    """
    goals: list[Formula] = [*sorted(state - twin.init, key=str)]
    goals += [Not(atom) for atom in sorted(twin.init - state, key=str)]
    return replace(twin.rules.problem, goal=And(tuple(goals)))


def _check_plans(
    loaded: PlanningInstance, twin: Twin, problem: Problem, note: Callable[[str], None]
) -> None:
    """The same optimal cost, the same number of plans, the same plans, and all of them valid."""
    model = loaded.model
    task = task_of(model, loaded.domain, problem)
    wanted = twin.optimal(problem.goal, actions=model.cost == "makespan+actions")
    if wanted is None:
        note("unsolvable")
        with pytest.raises(ProvedImpossible):
            search(model, task)
        return
    note(f"makespan {wanted.makespan}")
    plans = Plans.of(search(model, task))
    assert plans.space.cost_of(0) == (wanted.makespan, wanted.second)
    assert plans.count == wanted.count()
    (space,) = plan_spaces(explore(model, task.init[None, :]), [(task.goal, task.init[None, :])])
    assert space.cost_of(0) == plans.space.cost_of(0)
    assert Plans.of(space).count == plans.count
    listed = [tuple(model.texts(step) for step in plan) for plan in islice(plans, _MOST_PLANS)]
    if plans.count <= _MOST_PLANS:
        assert sorted(map(str, listed)) == sorted(map(str, wanted.plans()))
    _check_verdicts(twin, problem, model.keeps_idle, listed[:20])


def _check_verdicts(
    twin: Twin,
    problem: Problem,
    keeps_idle: tuple[bool, ...],
    plans: list[tuple[tuple[str | None, ...], ...]],
) -> None:
    domain, team = twin.rules.domain, twin.rules.team
    for plan in plans:
        verdict = validate(domain, problem, team, plan, allow_idle=keeps_idle)
        assert verdict.valid, verdict
        assert verdict.makespan == len(plan)
        if plan:  # one step fewer would be a plan shorter than the optimal ones
            shorter = validate(domain, problem, team, plan[:-1], allow_idle=keeps_idle)
            assert (shorter.valid, shorter.step) == (False, len(plan) - 1)


@pytest.mark.parametrize("kind", KINDS)
@settings(max_examples=110, deadline=None, derandomize=True, phases=[Phase.generate])
@given(seed=st.integers(0, 2**40))
def test_same_joint_steps_and_optimal_plans(kind: Kind, seed: int) -> None:
    """Exactly the same joint steps in every reachable state, and exactly the same optimal plans."""
    _check_model(random_model(seed, kind), event)


# -- by hand: rules that random models meet rarely
# ---------------------------------------------------------------


@pytest.mark.parametrize(
    "effect",
    [
        # A negative formula does not link, wherever it stands: one deletes what two requires.
        ":precondition (and (p) (or (q) (not (one r1)) (not (one r2)))) :effect (n)",
        ":precondition (p) :effect (when (not (one r1)) (n))",
        ":precondition (p) :effect (when (not (not (one r1))) (n))",
        # In the condition of an effect it may speak of the acting robot, in a precondition not.
        ":precondition () :effect (and (q) (when (forall (?o - robot) (not (two ?o))) (n)))",
        ":precondition (forall (?o - robot) (or (not (two ?o)) (q))) :effect (n)",
        ":precondition () :effect (when (or (not (two ?r)) (p)) (n))",
        # Links by a positive formula lift all but delete against add.
        ":precondition (and (p) (exists (?o - robot) (one ?o))) :effect (n)",
        ":precondition (exists (?o - robot) (one ?o)) :effect (p)",
        ":precondition (one ?r) :effect (n)",
    ],
)
def test_formulas_about_the_joint_step(effect: str) -> None:
    domain = f"""(define (domain d) (:types robot) (:constants r1 r2 - robot) (:predicates (p) (q) (n))
      (:action one :agent ?r - robot :parameters () :effect (not (p)))
      (:action two :agent ?r - robot :parameters () {effect})
      (:action back :agent ?r - robot :parameters () :precondition (q) :effect (and (p) (not (q)) (not (n)))))"""
    problem = "(define (problem p) (:domain d) (:init (p) (q)) (:goal (and (n) (not (p)))))"
    _check_model(RandomModel(domain, problem), note=lambda _: None)


# -- by hand: when a robot may not idle
# ---------------------------------------------------------------------------

_ROOMS = """(define (domain rooms) (:types robot place) (:predicates (at ?r - robot ?p - place) (ok ?r - robot))
  (:action move :agent ?r - robot :parameters (?from ?to - place) :precondition (at ?r ?from)
    :effect (and (not (at ?r ?from)) (at ?r ?to)))
  {more})"""
_TASK = """(define (problem p) (:domain rooms) (:objects r1 r2 - robot a b - place)
  (:init (at r1 a) (at r2 b) (ok r1)) (:goal (and (at r1 b) (at r2 b))))"""


def _rooms(*more: str) -> PlanningInstance:
    return _load(RandomModel(_ROOMS.format(more=" ".join(more)), _TASK))


_WAIT = "(:action wait :agent ?r - robot :parameters () {precondition} :effect ())"


@pytest.mark.parametrize(
    ("more", "keeps_idle"),
    [
        ("", (True, True)),
        (_WAIT.format(precondition=""), (False, False)),
        # One of a group of facts always holds: every action that ends one makes another one true.
        (
            "(:action stay :agent ?r - robot :parameters (?p - place) :precondition (at ?r ?p))",
            (False, False),
        ),
        # Only r1 is ok at the start, and nobody ever stops being ok.
        (
            _WAIT.format(precondition=":precondition (ok ?r)")
            + "(:action heal :agent ?r - robot :parameters () :effect (ok ?r))",
            (False, True),
        ),
        (
            _WAIT.format(precondition=":precondition (ok ?r)")
            + "(:action fall :agent ?r - robot :parameters () :effect (not (ok ?r)))",
            (True, True),
        ),
        (
            _WAIT.format(precondition=":precondition (not (ok ?r))")
            + "(:action heal :agent ?r - robot :parameters () :effect (ok ?r))",
            (True, True),
        ),
        # A formula needs it.
        (
            _WAIT.format(precondition="")
            + "(:action watch :agent ?r - robot :parameters (?o - robot) :precondition (wait ?o) :effect (ok ?r))",
            (True, True),
        ),
        # It does something.
        (_WAIT.format(precondition="").replace(":effect ()", ":effect (ok ?r)"), (True, True)),
    ],
)
def test_when_idling_is_dropped(more: str, keeps_idle: tuple[bool, bool]) -> None:
    loaded = _rooms(more)
    assert loaded.model.keeps_idle == keeps_idle
    # r1 walks over, r2 stays where it is: one plan, and not one more for every way to do nothing.
    if not any(keeps_idle):
        plans = [
            [loaded.model.texts(step) for step in plan]
            for plan in Plans.of(search(loaded.model, loaded.tasks[0]))
        ]
        assert all(label is not None for plan in plans for step in plan for label in step)


def test_a_shared_do_nothing_action_is_nobodys_own() -> None:
    text = RandomModel(
        """(define (domain d) (:types robot) (:predicates (p ?r - robot))
        (:action meet :parameters (?r ?q - robot))
        (:action go :parameters (?r - robot) :effect (p ?r)))""",
        "(define (problem p) (:domain d) (:objects r1 r2 - robot) (:init) (:goal (p r1)))",
    )
    # (meet r1 r1) belongs to r1 alone; without it there is only meeting the other one.
    assert _load(text).model.keeps_idle == (False, False)
    apart = text.domain.replace(
        "(?r ?q - robot))", "(?r ?q - robot) :precondition (not (= ?r ?q)))"
    )
    assert _load(RandomModel(apart, text.problem)).model.keeps_idle == (True, True)


def test_a_wait_that_others_disturb_does_not_replace_idling() -> None:
    """r1 pushes r2 away, which deletes what r2's ``stay`` requires: r2 must be able to idle."""
    text = RandomModel(
        """(define (domain push) (:types robot place) (:predicates (at ?r - robot ?p - place) (next ?p ?q - place))
        (:action stay :agent ?r - robot :parameters (?p - place) :precondition (at ?r ?p))
        (:action push :agent ?r - robot :parameters (?o - robot ?from ?to - place)
          :precondition (and (at ?o ?from) (next ?from ?to) (not (= ?r ?o)))
          :effect (and (not (at ?o ?from)) (at ?o ?to))))""",
        """(define (problem p) (:domain push) (:objects r1 r2 - robot a b - place)
        (:init (at r1 a) (at r2 a) (next a b)) (:goal (and (at r1 a) (at r2 b))))""",
    )
    loaded = _load(text)
    twin = _twin(loaded, text)
    _check_idling_adds_nothing(twin)
    plans = Plans.of(search(loaded.model, loaded.tasks[0]))
    assert [[loaded.model.texts(step) for step in plan] for plan in plans] == [
        [("(push r1 r2 a b)", None)]
    ]


def test_an_effect_on_every_object() -> None:
    """A universal effect whose variable has no type but ``object``."""
    _check_model(
        RandomModel(
            """(define (domain d) (:types robot) (:predicates (p ?x) (q ?x))
            (:action all :agent ?r - robot :parameters () :effect (forall (?x) (p ?x)))
            (:action none :agent ?r - robot :parameters () :precondition (p ?r)
              :effect (forall (?x - object) (when (not (q ?x)) (and (q ?x) (not (p ?x)))))))""",
            "(define (problem p) (:domain d) (:objects r1 r2 - robot o) (:init) (:goal (and (q o) (not (p r1)))))",
        ),
        note=lambda _: None,
    )


@pytest.mark.parametrize(
    ("text", "robot", "own"),
    [
        ("(move r1 a b)", "r1", "move a b"),
        ("(pass r1 r2 ball)", "r1", "pass r2 ball"),
        ("(pass r1 r2 ball)", "r2", "pass r1 ball"),
        ("(move a b)", "r1", "move a b"),
        ("(point r1 r1)", "r1", "point r1"),
        ("(r1 r1 a)", "r1", "r1 a"),
        ("(wait)", "r1", "wait"),
        ("none", "r1", "none"),
    ],
)
def test_a_label_without_the_robots_name(text: str, robot: str, own: str) -> None:
    assert own_text(text, robot) == own
