# SPDX-License-Identifier: GPL-3.0-or-later
"""Heuristics against the true distances: admissible, consistent, zero exactly at the goals; and the
state variables that they are made of.
"""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

from planners.joint.tables import Ints
from planners.loading import PlanningInstance, load
from planners.search.goals import FAR
from planners.search.heuristics import HEURISTICS, Bound, heuristic
from planners.search.plan_formula import mutexes
from planners.search.reachable import Space, explore
from planners.search.state_variables import StateVariable, state_variables
from tests.support.domains import DOMAINS
from tests.support.random_spaces import explored, random_instance


def check(bound: Bound, loaded: PlanningInstance, space: Space) -> Counter[int]:
    """How far below the true distance the bounds are; -1: it is said that there is no way."""
    model, task = loaded.model, loaded.tasks[0]
    true = distances(space, model.holds(task.goal, space.rows).tolist())
    least = heuristic(bound, model, task.goal, task.init)(space.rows)
    assert (least[true >= 0] <= true[true >= 0]).all()
    assert ((least == 0) == (true == 0)).all()
    assert (least[space.sources] <= least[space.target] + 1).all()
    gaps = Counter((true - least)[(true >= 0) & (least < FAR)].tolist())
    return gaps + Counter({-1: int((least >= FAR).sum())})


def distances(space: Space, goals: list[bool]) -> Ints:
    """The least joint steps from every state to a goal, -1 if there is no way, backward."""
    before: dict[int, set[int]] = {}
    for source, target in zip(space.sources.tolist(), space.target.tolist(), strict=True):
        before.setdefault(target, set()).add(source)
    found = {state: 0 for state, reached in enumerate(goals) if reached}
    layer, steps = set(found), 0
    while layer:
        steps += 1
        layer = {s for t in layer for s in before.get(t, ())} - found.keys()
        found.update(dict.fromkeys(layer, steps))
    return np.array([found.get(state, -1) for state in range(len(space))])


def variables_of(loaded: PlanningInstance, space: Space) -> list[StateVariable]:
    """The variables, each with exactly one value in every reachable state."""
    variables = state_variables(loaded.model, loaded.tasks[0].init)
    truth = loaded.model.codec.truth(space.rows)
    for variable in variables:
        assert (truth[:, list(variable.facts)].sum(axis=1) == 1).all()
    return variables


def mutexes_of(loaded: PlanningInstance, space: Space) -> list[tuple[int, int]]:
    """Pairs of facts that are true together in no reachable state."""
    truth = loaded.model.codec.truth(space.rows)
    found = mutexes(loaded.model, loaded.tasks[0].init)
    assert not any((truth[:, p] & truth[:, q]).any() for p, q in found)
    assert mutexes(loaded.model, loaded.tasks[0].init, block=1) == found
    return found


def test_random_models() -> None:
    seen: Counter[object] = Counter()
    for seed in range(96):
        loaded = random_instance(seed)
        if loaded is None or (space := explored(loaded)) is None or len(space) > 3_000:
            continue
        for name in ("blind", "projections", "relaxed"):
            seen += Counter(
                {(name, gap): n for gap, n in check(HEURISTICS[name], loaded, space).items()}
            )
        variables = variables_of(loaded, space)
        seen["with variables" if variables else "without"] += 1
        if not loaded.model.is_joint_action:
            seen["mutexes"] += sum(
                not any({*pair} <= {*variable.facts} for variable in variables)
                for pair in mutexes_of(loaded, space)
            )
    assert seen["with variables"] >= 20
    assert seen["without"] >= 5
    assert seen["mutexes"] >= 5, "of facts of different variables"
    assert all(seen[name, 1] > 5 for name in ("blind", "projections", "relaxed"))
    assert min(seen["projections", -1], seen["relaxed", -1]) > 5, "no dead end was found"


@pytest.mark.parametrize(
    "problem",
    [
        *("grid/corners-3x3", "grid/gwb5-3x3", "grid-joint/corners-3x3", "corridor/problem"),
        *("push-box/around", "charger/queue", "elevator/two-calls", "handover/exchange"),
        *("vans/one-van", "two-arms/exchange", "lock/let-in", "tray/serve"),
    ],
)
def test_shipped_domains(problem: str) -> None:
    folder = DOMAINS / problem.split("/")[0]
    loaded = load(folder / "domain.pddl", [DOMAINS / f"{problem}.pddl"])
    space = explore(loaded.model, loaded.tasks[0].init[None, :])
    for name in HEURISTICS:
        gaps = check(HEURISTICS[name], loaded, space)
        if name == "relaxed" and problem.startswith("grid"):
            # On an open map robots are seldom in each other's way.
            assert gaps[0] > sum(gaps.values()) / 2


@pytest.mark.parametrize(
    ("folder", "problem", "variables", "facts"),
    [
        ("grid", "corners-4x4", 2, 32),  # where each robot is
        ("handover", "exchange", 4, 12),  # and who has a parcel
        ("push-box", "around", 2, 8),  # not the box: two robots push it together
    ],
)
def test_variables_of_domains(folder: str, problem: str, variables: int, facts: int) -> None:
    loaded = load(DOMAINS / folder / "domain.pddl", [DOMAINS / folder / f"{problem}.pddl"])
    found = variables_of(loaded, explore(loaded.model, loaded.tasks[0].init[None, :]))
    assert (len(found), sum(len(variable.facts) for variable in found)) == (variables, facts)
