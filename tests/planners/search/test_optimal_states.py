# SPDX-License-Identifier: GPL-3.0-or-later
"""No solver is asked where ways from most states are found without one; a way that is found is one."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from planners.search.exact_bound import exact_bound
from planners.search.heuristics import search_heuristic
from planners.search.optimal_plans import distances, search_with_effort
from planners.search.optimal_states import mostly_lead
from planners.search.plans import counts
from planners.search.reachable import PieceSizes
from planners.search.state_variables import state_variables
from tests.support.domains import world_of
from tests.support.random_instances import explored, random_instance


def test_ways_are_found_only_where_they_are() -> None:
    found = 0
    for seed in range(100):
        loaded = random_instance(seed, "makespan")
        if loaded is None:
            continue
        space = explored(loaded)
        if space is None:
            continue
        model, task = loaded.model, loaded.tasks[0]
        far = distances(space, model.holds(task.goal, space.rows)[None, :])[0]
        heuristic = search_heuristic("relaxed", model, task, state_variables(model, task.init))
        for left in (1, 2, 3):
            open_ = space.rows[far != 0]  # a search ends where it meets a goal state
            leads = ((far > 0) & (far <= left))[far != 0]
            for some in (slice(None), leads):
                if len(open_[some]):
                    asked = leads[some][:: -(-len(leads[some]) // 50)]
                    mostly = mostly_lead(model, task.goal, heuristic, open_[some], left, 10**6)
                    assert not mostly or asked.mean() > 0.5
                    found += mostly
            assert not len(open_) or not mostly_lead(model, task.goal, heuristic, open_, left, -1)
    assert found > 30


def test_on_open_grids_no_solver_is_asked(monkeypatch: pytest.MonkeyPatch) -> None:
    loaded = world_of("grid", "corners-8x8").loaded
    model, task = loaded.model, loaded.tasks[0]
    asked: list[int] = []

    def noting(*args: Any) -> Any:
        asked.append(1)
        return exact_bound(*args)

    monkeypatch.setattr("planners.search.bounded_search.exact_bound", noting)
    plans, effort = search_with_effort(model, task, PieceSizes(probe=400))
    assert (counts(plans)[int(plans.starts[0])], effort.rounds, asked) == (8_383_608, 2, [])
    monkeypatch.setattr("planners.search.bounded_search.mostly_lead", lambda *_: False)
    again, _ = search_with_effort(model, task, PieceSizes(probe=400))
    assert asked == [1]
    assert np.array_equal(again.labels, plans.labels)
