"""The fast joint model and plan search against brute force, on small random models of every kind."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from itertools import islice
from typing import Any
from unittest.mock import patch

import pytest
from hypothesis import Phase, event, given, settings
from hypothesis import strategies as st
from naive import TooLarge, Twin
from random_pddl import KINDS, Kind, RandomModel, random_model

from planners.errors import BadInput, ProvedImpossible
from planners.grounding import instantiate
from planners.grounding.reachability import reachable_arguments
from planners.model import Loaded, ModelOptions, build, task_of
from planners.optimal import TaskGroup, plan_spaces, search
from planners.pddl import parse_domain, parse_problem
from planners.pddl.lifted import And, Atom, Domain, Formula, Not, Problem
from planners.pddl.sexpr import Source
from planners.plans import Plans
from planners.robots import RobotChoice, find_team
from planners.space import explore
from planners.validate import State, validate

_MOST_STATES = 128
_MOST_TRIES = 3_000
_MOST_PLANS = 300


@pytest.fixture(autouse=True, scope="module")
def one_reachability_per_model() -> Iterator[None]:
    """Tarski's program runs in a process of its own, and every model is built for two costs: run it once."""
    asked: dict[str, dict[str, list[tuple[str, ...]]]] = {}

    def remembered(domain: Domain, objects: dict[str, tuple[str, ...]], init: Iterable[Atom]) -> Any:
        init = list(init)
        key = domain.source.text + str((objects, init))
        if key not in asked:
            asked.clear()
            asked[key] = reachable_arguments(domain, objects, init)
        return asked[key]

    with patch.object(instantiate, "reachable_arguments", remembered):
        yield


def _load(text: RandomModel, cost: str = "makespan") -> Loaded:
    domain = parse_domain(Source("domain", text.domain))
    problem = parse_problem(Source("problem", text.problem), domain)
    options = ModelOptions(robots=RobotChoice(unowned=text.unowned), cost=cost)  # type: ignore[arg-type]
    return build(domain, [problem], options)


def _twin(loaded: Loaded, text: RandomModel) -> Twin:
    domain, (problem,) = loaded.domain, loaded.problems
    team = find_team(domain, problem, RobotChoice(unowned=text.unowned))
    return Twin(domain, problem, team, loaded.model.keeps_idle, _MOST_TRIES)


def _key(state: State) -> list[str]:
    return sorted("(" + " ".join((atom.predicate, *atom.args)) + ")" for atom in state)


def _fast_steps(loaded: Loaded, state: State) -> set[tuple[tuple[str | None, ...], tuple[str, ...]]]:
    model = loaded.model
    steps = model.successors(model.codec.encode(_key(state))[None, :])
    found = [
        (model.texts(labels), tuple(model.codec.decode(row)))
        for labels, row in zip(steps.labels, steps.result, strict=True)
    ]
    assert len(set(found)) == len(found), "a joint step is listed twice"
    return set(found)


def _check_model(text: RandomModel) -> None:
    loaded = _load(text)
    twin = _twin(loaded, text)
    try:
        states = twin.reachable(_MOST_STATES)
    except TooLarge:
        event("too large")
        return
    except BadInput:
        event("ambiguous parts")  # exit 31: two joint actions with the same parts do different things
        with pytest.raises(BadInput, match="different results"):
            explore(loaded.model, loaded.tasks[0].init[None, :])
        return
    for state in states:
        slow = {(labels, tuple(_key(after))) for labels, after in twin.successors(state)}
        assert _fast_steps(loaded, state) == slow, _key(state)
    event("one state" if len(states) == 1 else "several states")
    if not all(loaded.model.keeps_idle):
        event("nobody has to idle")
        _check_idling_adds_nothing(twin)
    if len(states) == 1:
        _check_plans(loaded, twin, loaded.problems[0])
        return
    for one in (loaded, _load(text, "makespan+actions")):
        _check_plans(one, twin, one.problems[0])
        _check_plans(one, twin, _far(twin, states[-1]))


def _check_idling_adds_nothing(twin: Twin) -> None:
    """Where a robot may not idle, its do-nothing action leads everywhere that idling would lead."""
    rules = twin.rules
    free = Twin(rules.domain, rules.problem, rules.team, budget=_MOST_TRIES)
    for state in free.reachable(_MOST_STATES):
        assert {t for _, t in free.successors(state)} == {t for _, t in twin.successors(state)}, _key(state)


def _far(twin: Twin, state: State) -> Problem:
    """The same problem with the last state that the twin reached as its goal, as far as it differs from the first."""
    goals: list[Formula] = [*sorted(state - twin.init, key=str)]
    goals += [Not(atom) for atom in sorted(twin.init - state, key=str)]
    return replace(twin.rules.problem, goal=And(tuple(goals)))


def _check_plans(loaded: Loaded, twin: Twin, problem: Problem) -> None:
    """The same optimal cost, the same number of plans, the same plans, and all of them valid."""
    model = loaded.model
    task = task_of(model, loaded.domain, problem)
    wanted = twin.optimal(problem.goal, actions=model.cost == "makespan+actions")
    if wanted is None:
        event("unsolvable")
        with pytest.raises(ProvedImpossible):
            search(model, task)
        return
    event(f"makespan {wanted.makespan}")
    plans = Plans.of(search(model, task))
    assert plans.space.cost_of(0) == (wanted.makespan, wanted.second)
    assert plans.count == wanted.count()
    (space,) = plan_spaces(explore(model, task.init[None, :]), [TaskGroup(task.goal, task.init[None, :])])
    assert space.cost_of(0) == plans.space.cost_of(0)
    assert Plans.of(space).count == plans.count
    listed = [tuple(model.texts(step) for step in plan) for plan in islice(plans, _MOST_PLANS)]
    if plans.count <= _MOST_PLANS:
        assert sorted(map(str, listed)) == sorted(map(str, wanted.plans()))
    _check_verdicts(twin, problem, model.keeps_idle, listed[:20])


def _check_verdicts(
    twin: Twin, problem: Problem, keeps_idle: tuple[bool, ...], plans: list[tuple[tuple[str | None, ...], ...]]
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
    _check_model(random_model(seed, kind))
