# SPDX-License-Identifier: GPL-3.0-or-later
"""Distances to goals against breadth-first search written down from the definition."""

from __future__ import annotations

from random import Random

import numpy as np
import pytest

from planners.joint.tables import Bools
from planners.loading import build
from planners.search.optimal_plans import distances
from planners.search.reachable import Space, explore
from tests.support.random_models import random_model


def by_definition(space: Space, reached: Bools) -> list[list[int]]:
    """Steps until a state of the goal, trying all joint steps; -1 where none leads there."""
    following = [
        set(space.target[space.first[s] : space.first[s + 1]].tolist()) for s in range(len(space))
    ]
    rows = []
    for goal in reached:
        far = [0 if there else -1 for there in goal.tolist()]
        for steps in range(1, len(space) + 1):
            for state, after in enumerate(following):
                if far[state] < 0 and any(far[t] == steps - 1 for t in after):
                    far[state] = steps
        rows.append(far)
    return rows


@pytest.mark.parametrize("few", [0, 2, 8, 10**9])
@pytest.mark.parametrize("seed", range(6))
def test_distances(seed: int, few: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whether all joint steps are looked at in each layer, or only those into new states."""
    monkeypatch.setattr("planners.search.optimal_plans._FEW", few)
    random = Random(seed)
    domain, problem, options = random_model(seed, random.choice([2, 3]))
    loaded = build(domain, [problem], options)
    space = explore(loaded.model, np.stack([task.init for task in loaded.tasks]))
    # More goals than states, some of which no state satisfies: what batches are made of.
    share = random.choice([0.0, 0.05, 0.5])
    reached = np.array(
        [[random.random() < share for _ in range(len(space))] for _ in range(2 * len(space) + 3)]
    )
    assert distances(space, reached).tolist() == by_definition(space, reached)
