# SPDX-License-Identifier: GPL-3.0-or-later
"""State variables have exactly one value in every reachable state, and their bounds are right."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

from planners.joint.states import TrueFacts
from planners.loading import PlanningInstance, load
from planners.search.goals import FAR, goal_facts
from planners.search.optimal_plans import distances
from planners.search.projections import Projections
from planners.search.reachable import Space, explore
from planners.search.relaxed import relaxed
from planners.search.state_variables import StateVariable, state_variables
from tests.support.domains import DOMAINS
from tests.support.random_instances import explored, random_instance


def checked(loaded: PlanningInstance, space: Space) -> list[StateVariable]:
    """The variables, each with exactly one value in every reachable state."""
    variables = state_variables(loaded.model, loaded.tasks[0].init)
    truth = loaded.model.codec.truth(space.rows)
    for variable in variables:
        assert (truth[:, list(variable.facts)].sum(axis=1) == 1).all()
    return variables


def consistent(loaded: PlanningInstance, space: Space, variables: list[StateVariable]) -> int:
    """Bounds are 0 in goal states, no larger than distances, and fall by at most 1 in a step."""
    model, goal = loaded.model, loaded.tasks[0].goal
    reached = model.holds(goal, space.rows)
    far = distances(space, reached[None, :])[0]
    largest = 0
    for bound in (Projections(model, goal, variables).value, relaxed(model, goal)):
        value = bound(space.rows)
        assert (value[reached] == 0).all()
        assert (value[far >= 0] <= far[far >= 0]).all()
        assert (value[space.sources] <= value[space.target] + 1).all()
        largest = max(largest, int(value[value < FAR].max(initial=0)))
    return largest


def test_variables_and_bounds_of_random_models() -> None:
    met: Counter[str] = Counter()
    for seed in range(160):
        loaded = random_instance(seed)
        if loaded is None or (space := explored(loaded)) is None or len(space) > 3_000:
            continue
        variables = checked(loaded, space)
        met["with variables" if variables else "without"] += 1
        met["bounded"] += consistent(loaded, space, variables) > 1
    assert met["with variables"] >= 20
    assert met["without"] >= 5
    assert met["bounded"] >= 10


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
    space = explored(loaded)
    assert space is not None
    found = checked(loaded, space)
    assert len(found) == variables
    assert sum(len(variable.facts) for variable in found) == facts


def test_labels_too_late_for_a_robots_own_variable_lead_nowhere_in_time() -> None:
    loaded = load(DOMAINS / "grid" / "domain.pddl", [DOMAINS / "grid" / "gw4-3x3.pddl"])
    model, task = loaded.model, loaded.tasks[0]
    space = explore(model, task.init[None, :])
    variables = state_variables(model, task.init)
    projections = Projections(model, task.goal, variables)
    assert goal_facts(model, task.goal)
    for left in range(5):

        def only(rows, options, left=left):  # type: ignore[no-untyped-def]
            return projections.in_time(rows, options, left)[0]

        kept = model.successors(space.rows, only)
        every = model.successors(space.rows)
        late = projections.value(every.result) > left
        assert len(kept) == int((~late).sum())
        assert (kept.result == every.result[~late]).all()


def test_true_facts_of_rows() -> None:
    random = np.random.default_rng(5)
    rows = random.integers(0, 2**63, (50, 3)).astype(np.uint64) & random.integers(
        0, 2**63, (50, 3)
    ).astype(np.uint64)
    rows[7] = 0
    rows[9] = ~np.uint64(0)
    found = TrueFacts.of(rows)
    bits = np.unpackbits(
        np.ascontiguousarray(rows, "<u8").view(np.uint8), axis=1, bitorder="little"
    )
    row, fact = np.nonzero(bits)
    assert (found.row == row).all()
    assert (found.fact == fact).all()
