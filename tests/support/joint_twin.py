# SPDX-License-Identifier: GPL-3.0-or-later
"""The joint model and plan search of a text against brute force."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import islice

import pytest

from planners.check.meaning import State
from planners.check.rules import validate
from planners.loading import PlanningInstance, task_of
from planners.pddl.lifted import And, Formula, Not, Problem
from planners.pddl.model_options import ModelOptions
from planners.search.optimal_plans import plan_spaces, search
from planners.search.plans import Plans
from planners.search.reachable import explore
from planners.system.errors import BadInput, ProvedImpossible
from tests.support.naive_joint_steps import TooLarge, Twin
from tests.support.random_pddl import RandomModel
from tests.support.texts import model_of

_MOST_STATES = 128
_MOST_TRIES = 3_000
_MOST_PLANS = 300


def built(text: RandomModel, cost: str = "makespan") -> PlanningInstance:
    options = ModelOptions(unowned=text.unowned, cost=cost)  # type: ignore[arg-type]
    return model_of(text.domain, text.problem, options)


def twin_of(loaded: PlanningInstance) -> Twin:
    return Twin(loaded.domain, loaded.problems[0], loaded.team, _MOST_TRIES)


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


def check_model(text: RandomModel, note: Callable[[str], None]) -> None:
    loaded = built(text)
    twin = twin_of(loaded)
    try:
        states = twin.reachable(_MOST_STATES)
    except TooLarge:
        note("too large")
        return
    except BadInput:
        note("ambiguous parts")  # two joint actions with the same parts do different things
        with pytest.raises(BadInput, match="different results"):
            explore(loaded.model, loaded.tasks[0].init[None, :])
        return
    for state in states:
        slow = {(labels, tuple(_key(after))) for labels, after in twin.successors(state)}
        assert _fast_steps(loaded, state) == slow, _key(state)
    note("one state" if len(states) == 1 else "several states")
    if len(states) == 1:
        _check_plans(loaded, twin, loaded.problems[0], note)
        return
    for one in (loaded, built(text, "makespan+actions")):
        _check_plans(one, twin, one.problems[0], note)
        _check_plans(one, twin, far(twin, states[-1]), note)


def far(twin: Twin, state: State) -> Problem:
    """The problem whose goal is how a state of the twin differs from the first one."""
    goals: list[Formula] = [*sorted(state - twin.init, key=str)]
    goals += [Not(atom) for atom in sorted(twin.init - state, key=str)]
    return replace(twin.rules.problem, goal=And(tuple(goals)))


def _check_plans(
    loaded: PlanningInstance, twin: Twin, problem: Problem, note: Callable[[str], None]
) -> None:
    """The same optimal cost, the same number of plans, the same plans, and all of them valid."""
    model = loaded.model
    task = task_of(model, loaded.domain, problem)
    counting = model.cost == "makespan+actions"
    wanted = twin.optimal(problem.goal, twin.actions if counting else lambda _: 0)
    if wanted is None:
        note("unsolvable")
        with pytest.raises(ProvedImpossible):
            search(model, task)
        return
    note(f"makespan {wanted.makespan}")
    plans = Plans.of(search(model, task))
    assert plans.space.cost_of(0) == (wanted.makespan, wanted.second)
    assert plans.count == wanted.count
    (space,) = plan_spaces(explore(model, task.init[None, :]), [(task.goal, task.init[None, :])])
    assert space.cost_of(0) == plans.space.cost_of(0)
    assert Plans.of(space).count == plans.count
    listed = [tuple(model.texts(step) for step in plan) for plan in islice(plans, _MOST_PLANS)]
    if plans.count <= _MOST_PLANS:
        assert sorted(map(str, listed)) == sorted(map(str, wanted.plans))
    _check_verdicts(twin, problem, listed[:20])


def _check_verdicts(
    twin: Twin, problem: Problem, plans: list[tuple[tuple[str | None, ...], ...]]
) -> None:
    domain, team = twin.rules.domain, twin.rules.team
    for plan in plans:
        verdict = validate(domain, problem, team, plan)
        assert verdict.valid, verdict
        if plan:  # one step fewer would be a plan shorter than the optimal ones
            shorter = validate(domain, problem, team, plan[:-1])
            assert (shorter.valid, shorter.step) == (False, len(plan) - 1)
