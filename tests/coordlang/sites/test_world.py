# SPDX-License-Identifier: GPL-3.0-or-later
"""What is found to draw in the shipped domains: places, links, things, and what each atom says."""

from __future__ import annotations

import pytest

from coordlang.sites.world import World, find_world
from planners.search.reachable import Space, explore
from tests.support.domains import loaded_from


def world_of(domain: str, problem: str) -> tuple[World, Space]:
    loaded = loaded_from(domain, problem)
    space = explore(loaded.model, loaded.tasks[0].init[None, :])
    return find_world(space.model, [space.model.codec.decode(row) for row in space.rows]), space


#: Problem -> things, number of places, and what some atoms say.
WORLDS: dict[str, tuple[str, int, dict[str, str]]] = {
    "t-map/problem": ("r1 r2", 4, {"(at r1 c0-1)": "at r1 c0-1"}),
    "lock/let-in": ("r1 r2", 4, {}),
    "grid-joint/t-map": ("r1 r2", 4, {"(at r1 c0-1)": "at r1 c0-1"}),
    "handover/three-rooms": (
        "r1 r2 r3 box",
        7,
        {"(lies box west)": "at box west", "(holds r1 box)": "with r1 box", "(free r1)": "other"},
    ),
    "elevator/two-calls": (
        "lift r1 r2",
        3,
        {"(stops first)": "at lift first", "(on r1 first)": "at r1 first", "(inside r1)": "other"},
    ),
    "vans/two-each": ("d1 d2 v1 v2", 4, {"(aboard d1 v2)": "with d1 v2"}),
    "tray/serve": (
        "r1 r2 back front tray",
        2,
        {"(tray-at kitchen)": "at tray kitchen", "(spilled)": "other"},
    ),
    "charger/three-robots": ("r1 r2 r3", 2, {"(clean bath)": "mark bath clean"}),
    "two-arms/exchange": ("arm1 arm2 blue red", 4, {"(on red right)": "at red right"}),
    "push-box/around": ("r1 r2 box", 4, {"(stands box yard)": "at box yard"}),
}


@pytest.mark.parametrize("name", WORLDS)
def test_worlds(name: str) -> None:
    """What is found, and that no thing is in two places of a reachable state."""
    world, space = world_of(*name.split("/"))
    things, places, roles = WORLDS[name]
    assert world.things == tuple(things.split())
    assert len(world.places) == places
    assert {atom: " ".join(world.roles[atom]) for atom in roles} == roles
    for row in space.rows:
        said = [world.roles[atom] for atom in space.model.codec.decode(row)]
        where = [role[1] for role in said if role[0] == "at"]
        assert len(where) == len(set(where))


def test_links_are_ways_and_what_statics_relate() -> None:
    world, _ = world_of("handover", "two-doors")
    moves = {link.ends for link in world.links if link.moves}
    assert ("west", "west-north") in moves
    doors = {link.ends for link in world.links if not link.moves}
    assert doors == {("east-north", "west-north"), ("east-south", "west-south")}


@pytest.mark.parametrize(
    ("domain", "problem"), [("t-map", "problem"), ("grid-joint", "t-map"), ("push-box", "around")]
)
def test_moves_are_what_happens(domain: str, problem: str) -> None:
    """Where a subaction is said to bring a thing, there it is after every such joint step."""
    world, space = world_of(domain, problem)
    model = space.model
    steps = model.successors(space.rows)
    checked = 0
    for number in range(len(steps)):
        after = {
            world.roles[a][1:]
            for a in model.codec.decode(steps.result[number])
            if world.roles[a][0] == "at"
        }
        for robot, label in enumerate(steps.labels[number].tolist()):
            brought = world.moves(model, robot, label)
            assert after.issuperset(brought)
            checked += len(brought)
    assert checked > 20
