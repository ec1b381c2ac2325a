# SPDX-License-Identifier: GPL-3.0-or-later
"""No solver is asked where ways from most states are found without one; a way that is found is one."""

from __future__ import annotations

import numpy as np
import pytest

from planners.search.heuristics import search_heuristic
from planners.search.optimal_plans import distances, search_with_effort
from planners.search.plans import counts
from planners.search.reachable import PieceSizes
from planners.search.sampled_ways import mostly_lead
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
    task = world_of("grid", "corners-8x8").loaded
    plans, effort = search_with_effort(task.model, task.tasks[0], PieceSizes(probe=400))
    assert (counts(plans)[int(plans.starts[0])], effort.rounds) == (8_383_608, 2)
    assert "SAT" not in effort.heuristic
    monkeypatch.setattr("planners.search.bounded_search.mostly_lead", lambda *_: False)
    again, effort = search_with_effort(task.model, task.tasks[0], PieceSizes(probe=400))
    assert "SAT" in effort.heuristic
    assert np.array_equal(again.labels, plans.labels)
