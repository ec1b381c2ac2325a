# SPDX-License-Identifier: GPL-3.0-or-later
"""The recipes that search and draw: small runs of each, looked at."""

from __future__ import annotations

import pytest

from benchmarks.paper import planning_cost, scenario
from benchmarks.paper.__main__ import RECIPES
from benchmarks.paper.grid import cell_position, entered_cells, task_cells
from benchmarks.paper.planning_cost import manhattan
from benchmarks.paper.recipe import Settings
from benchmarks.paper.reported import TABLE_1
from benchmarks.paper.suite import CORRIDOR, OTHERS, ROWS, WORLDS, language_for
from benchmarks.paper.task_choices import languages_in_tasks
from coordlang.execution.guided_search import ExpandedStates
from planners.joint.tables import Rows
from planners.loading import load
from planners.search.heuristics import HEURISTICS
from planners.search.plans import Plans
from planners.search.reachable import explore
from tests.support.domains import DOMAINS
from tests.support.task_languages import three_cells

THOROUGH = pytest.mark.thorough


@pytest.mark.parametrize(
    "name",
    [
        name if name in ("GW1", "GW2", "GWB5", "GWB6") else pytest.param(name, marks=THOROUGH)
        for name in TABLE_1
    ],
)
def test_rows_are_the_papers(name: str) -> None:
    candidates = WORLDS[name].candidates()
    assert (candidates.count, candidates.states) == (TABLE_1[name].tasks, TABLE_1[name].states)


def test_units_have_names_of_their_own() -> None:
    assert [world.name for world in ROWS] == list(TABLE_1)
    whole = Settings()
    for settings in (Settings(quick=True), whole):
        for recipe in RECIPES:
            units = recipe.units(settings)
            assert len({unit.key for unit in units}) == len(units)
            assert {unit.experiment for unit in units} == {recipe.name}
    # Each on grids and on worlds that are none.
    for recipe in RECIPES:
        worlds = {u.parameters.get("world", u.key.split("/")[0]) for u in recipe.units(whole)}
        assert 0 < len(worlds & {w.name for w in OTHERS}) < len(worlds)


def test_expansions_on_three_cells() -> None:
    """By hand: the start, then a state after one step; from all but one of them the goal is a step
    away, and comes up next.
    """
    one = three_cells()
    terrain = ExpandedStates(one.model, one.partition)
    assert planning_cost.expansions(one, HEURISTICS["blind"], terrain) == (2, 2, 2)
    assert planning_cost.expansions(one, HEURISTICS["relaxed"], terrain) == (2, 2, 2)


def test_the_papers_bound_is_the_farthest_robots_distance() -> None:
    loaded = load(DOMAINS / "grid" / "domain.pddl", [DOMAINS / "grid" / "gwb5-3x3.pddl"])
    goal = loaded.tasks[0].goal
    space = explore(loaded.model, loaded.tasks[0].init[None, :])

    def cells(row: Rows) -> dict[str, tuple[int, int]]:
        atoms = (loaded.model.codec.facts.atoms[f] for f in loaded.model.codec.true_facts(row))
        return {atom.args[0]: cell_position(atom.args[1]) for atom in atoms}

    (ends,) = (cells(row) for row in space.rows if loaded.model.holds(goal, row[None, :])[0])
    for row, bound in zip(space.rows, manhattan(loaded.model, goal, ())(space.rows), strict=True):
        away = [abs(x - ends[r][0]) + abs(y - ends[r][1]) for r, (x, y) in cells(row).items()]
        assert bound == max(away)


def test_the_detour_is_optimal_and_nobody_else_moves_otherwise() -> None:
    candidates, language = language_for(CORRIDOR, "greedy", 0, scenario.trading_rooms())
    assert candidates.count == 36 * 36
    one = next(
        s
        for s in languages_in_tasks(language, candidates)
        if task_cells(s.space, s.task) == (scenario.START, scenario.GOAL)
    )
    found = scenario.detour(one)
    way, (agreed, other) = found["detour"], found["agreed"]
    assert scenario.PLACE in way
    assert scenario.PLACE not in agreed
    assert found["optimal"] is True
    for r1, r2 in ((agreed, other), (way, other)):
        assert (r1[0], r2[0], r1[-1], r2[-1]) == (*scenario.START, *scenario.GOAL)
        assert len(r1) == len(r2) == len(agreed)
        assert all(a != b for a, b in zip(r1, r2, strict=True))  # never in one cell
    # All parts of robot 1 through the place, by listing the plans.
    wanted = {n for n, cell in enumerate(entered_cells(one.model, 0)) if cell == scenario.PLACE}
    parts = {tuple(step[0] for step in plan) for plan in Plans.of(one.space, one.task)}
    assert found["parts"] == sum(bool(wanted & set(part)) for part in parts)
    assert 0 < found["ways"] <= found["parts_that_fit"] <= found["parts"]
