# SPDX-License-Identifier: GPL-3.0-or-later
"""Floor plans: their names do not overlap, and their heat is counted by definition."""

from __future__ import annotations

from collections import Counter
from itertools import combinations, product
from random import Random

import pytest

from coordlang.report.plan import WIDTH, Heat, counted_heat, drawn_plan, floor_plan, heat_of
from coordlang.report.task import select_tasks
from planners.search.plan_space import PlanSpace
from tests.coordlang.report.conftest import make_language
from tests.support import naive, thorough
from tests.support.domains import all_tasks


def test_names_and_places_do_not_overlap() -> None:
    random, hidden = Random(0), 0
    for number in (2, 15, 70):
        names = [f"place_{k}" if k % 2 else f"l1-{k}" for k in range(number)]
        points = [(random.uniform(0, 90), random.uniform(-9, 30)) for _ in names]
        links = [(k, k + 1) for k in range(number - 1)]
        plan = floor_plan(names, points, links)
        assert plan["links"] == links
        boxes = [(x - 4, y - 4, x + 4, y + 4) for x, y in plan["points"]]
        for label in plan["labels"]:
            wide, y = 6.4 * len(label["text"]), label["y"]
            left = label["x"] - {"start": 0, "middle": wide / 2, "end": wide}[label["anchor"]]
            boxes.append((left, y - 10, left + wide, y + 3))
        named = boxes[number:]
        assert all(a >= 0 and b >= 0 and c <= WIDTH and d <= plan["height"] for a, b, c, d in boxes)
        for one, other in combinations(boxes, 2):
            apart = one[2] <= other[0] or other[2] <= one[0]
            apart = apart or one[3] <= other[1] or other[3] <= one[1]
            assert apart or (one not in named and other not in named)
        given = sum("_" in label["text"] for label in plan["labels"])
        hidden += number - len(named)
        assert 2 * given + 1 >= len(named)  # names that somebody gave come first
    assert hidden


def by_definition(spaces: list[PlanSpace]) -> Heat:
    """All plans of all tasks listed, their divergences by states, and the places read off them."""
    found: set[tuple[int, frozenset[int]]] = set()
    for space in spaces:
        for task in range(len(space.starts)):
            plans = naive.listed(space, task, 10_000)
            for some in naive.failing(plans, space.robots):
                parting = naive.divergence([naive.states(space, task, plan) for plan in some])
                assert parting is not None
                found.add(parting)
    codec, rows = spaces[0].model.codec, spaces[0].rows

    def at(state: int) -> dict[str, str]:
        atoms = (text.strip("()").split() for text in codec.decode(rows[state]))
        return {atom[1]: atom[2] for atom in atoms if atom[0] == "at"}

    places, lanes = Counter[str](), Counter[tuple[str, str]]()
    known = naive.minimal(found)
    for last, after in known:
        here, there = at(last), [at(state) for state in after]
        torn = {robot for robot in here if any(one[robot] != there[0][robot] for one in there)}
        for place in {here[robot] for robot in torn}:
            places[place] += 1
        driven = {frozenset((here[r], one[r])) for r, one in product(torn, there)}
        for lane in driven:
            if len(lane) == 2:
                a, b = sorted(lane)
                lanes[a, b] += 1
    return Heat(places, lanes, len(known), sum(len(space.starts) for space in spaces), True)


@pytest.mark.parametrize(
    ("domain", "problem"),
    [("t-map", "problem"), ("three-cells", "problem"), *thorough(("grid", "gw2-2x3"))],
)
def test_heat_is_that_of_the_definition(domain: str, problem: str) -> None:
    language, lifted, asked = make_language(domain, problem)
    candidates = all_tasks(domain, problem)
    selection = select_tasks(language, lifted, [asked], 3, 0)
    found = heat_of(selection, lifted, [asked], candidates.loaded.options)
    assert found is not None
    assert found == by_definition(list(candidates.spaces))
    assert found.most > 0


def test_no_heat_is_drawn_where_no_robot_is_torn() -> None:
    """In ``domains/vans`` the driver sits in one of two vans: the plans part, and no robot does."""
    places = [{"name": name, "x": x, "y": 0} for x, name in enumerate("ab")]
    data = {"places": places, "links": [(0, 1)], "pair": None, "grid": False}
    for after, top in (([{}, {}], None), ([{"r1": "a"}, {"r1": "b"}], "a (1) and a – b (1)")):
        heat = drawn_plan(data, counted_heat([({"r1": "a"}, after)], 1, every=True))["heat"]
        assert (heat["top"] if heat else None) == top
