# SPDX-License-Identifier: GPL-3.0-or-later
"""Features: their values by definition, by hand, and read back from their text."""

from __future__ import annotations

from functools import cache
from random import Random

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from coordlang.lifted import features as f
from coordlang.lifted.pool import pool_of
from coordlang.lifted.world import States, World
from planners.joint.tables import Rows
from planners.loading import PlanningInstance
from planners.search.reachable import explore
from planners.system.errors import BadInput, Position
from tests.support import thorough
from tests.support.domains import loaded_from
from tests.support.naive_features import members, value

HERE = Position("test")
WORLDS = ("grid/gwb2-3x3", "elevator/same-floor")
MORE = thorough(
    *("handover/exchange", "push-box/next-door", "grid/gw2-2x3"),
    *("charger/queue", "vans/two-vans", "t-map/problem"),
)


def world_of(loaded: PlanningInstance, points: dict[str, tuple[float, float]]) -> World:
    return World(loaded.domain, loaded.problems[0], loaded.model, points)


@cache
def states_of(name: str, each: int = 1) -> States:
    """Every so many-th reachable state of a shipped problem."""
    folder, stem = name.split("/")
    loaded = loaded_from(folder, stem)
    rows = explore(loaded.model, loaded.tasks[0].init[None, :]).rows
    return States(world_of(loaded, {}), rows[::each])


def atoms_of(world: World, row: Rows) -> dict[str, list[tuple[str, ...]]]:
    found: dict[str, list[tuple[str, ...]]] = {}
    for fact in world.model.codec.true_facts(row):
        atom = world.model.codec.facts.atoms[fact]
        found.setdefault(atom.predicate, []).append(atom.args)
    return found


def types_of(world: World) -> dict[str, frozenset[str]]:
    return {
        name: frozenset(kind for kind, own in world.types.items() if name in own)
        for name in world.objects
    }


def by_definition(feature: f.Feature, states: States) -> list[int]:
    world = states.world
    return [
        value(feature, types_of(world), world.statics, atoms_of(world, row)) for row in states.rows
    ]


@pytest.mark.parametrize("name", [*WORLDS, *MORE])
def test_values_are_those_of_the_definition(name: str) -> None:
    every = states_of(name)
    states = States(every.world, every.rows[:: -(-len(every) // 20)])
    pool = list(pool_of([states], 7).features)
    assert len(pool) > 10
    pool = Random(1).sample(pool, min(len(pool), 60))
    defined = 0
    for feature in pool:
        expected = by_definition(feature, states)
        assert states.get(feature).tolist() == expected, str(feature)
        defined += any(v != f.UNDEFINED for v in expected)
        assert f.feature_of(str(feature), HERE) == feature
    assert defined > 10


def concepts(world: World) -> st.SearchStrategy[f.Concept]:
    """Concepts over what a world has, and over names that it does not have."""
    fluents = [name for name, _ in world.fluents]
    sets = [*world.types, *fluents, *world.statics, "nothing"]
    roles = [*fluents, *world.relations, "nowhere"]
    role = st.builds(f.Role, st.sampled_from(roles), st.booleans(), st.booleans())
    simple: st.SearchStrategy[f.Concept] = st.builds(f.Named, st.sampled_from(sets)) | st.builds(
        f.One, st.sampled_from([*world.objects, "nobody"])
    )

    def larger(inner: st.SearchStrategy[f.Concept]) -> st.SearchStrategy[f.Concept]:
        both, some = st.builds(f.Both, inner, inner), st.builds(f.Some, role, inner)
        return st.builds(f.Without, inner) | both | some

    return st.recursive(simple, larger, max_leaves=4)


@pytest.mark.parametrize("name", [*WORLDS[1:], *MORE])
@settings(max_examples=25, deadline=None)
@given(data=st.data())
def test_concepts_are_those_of_the_definition(name: str, data: st.DataObject) -> None:
    states = states_of(name, 9)
    world = states.world
    one, other = data.draw(concepts(world)), data.draw(concepts(world))
    names = np.array(world.objects, object)
    for row, found in zip(states.rows[:4], states.get(one)[:4], strict=True):
        expected = members(one, types_of(world), world.statics, atoms_of(world, row))
        assert set(names[found]) == expected, str(one)
    few = States(world, states.rows[:4])
    relation = data.draw(st.sampled_from([*world.relations, "nowhere"]))
    for number in (f.Size(one), f.Gap(relation, one, other)):
        feature = f.Least(number, 3)
        assert few.get(feature).tolist() == by_definition(feature, few), str(feature)
        assert f.feature_of(str(feature), HERE) == feature


def feature(text: str) -> f.Feature:
    return f.feature_of(text, HERE)


def test_by_hand() -> None:
    world = states_of("grid/gw2-2x3").world
    wanted = ("r1", "c0-1"), ("r2", "c1-2")
    row = world.model.state([a for a in world.model.codec.facts.atoms if a.args in wanted])
    here = States(world, row[None, :])
    texts = {
        "(mod (column (at r1)) 3)": 1,
        "(mod (row (at r2)) 3)": 1,
        "(sign (- (column (at r1)) (column (at r2))))": -1,
        "(mod (distance adjacent (at r1) (at r2)) 2)": 0,
        "(min (degree adjacent (at r1)) 3)": 3,
        "(min (degree adjacent (at r2)) 3)": 2,
        "(min (count at _ _) 3)": 2,
        "(min (count at r1 _) 3)": 1,
        "(min (count at _ c1-2) 1)": 1,
        "(same (at r1) (at r2))": 0,
        "(same (at r1) (at r1))": 1,
        "(same (adjacent c0-0) (at r1))": 1,  # what never changes is true, too
        "(min (count adjacent c0-1 _) 3)": 3,
        "(min (row (inverse at r1)) 1)": f.UNDEFINED,
        "(min (size (some (inverse at) robot)) 3)": 2,
        "(min (size (some adjacent (some (inverse at) (one r1)))) 3)": 3,
        "(min (size (and cell (not (some (inverse at) all)))) 3)": 3,
        "(min (size (and (some adjacent (some (inverse at) (one r1))) (some adjacent (some "
        "(inverse at) (one r2))))) 3)": 2,
        "(mod (gap adjacent (one c0-0) (some (inverse at) (one r2))) 4)": 3,
        "(min (gap adjacent (one r1) (one r2)) 3)": f.UNDEFINED,
        # What is not there is not counted.
        "(same (at r9) (at r1))": f.UNDEFINED,
        "(min (distance road (at r1) (at r2)) 2)": f.UNDEFINED,
        "(min (count holds _ _) 2)": 0,
        "(min (size (some holds all)) 2)": 0,
    }
    for text, expected in texts.items():
        assert here.get(feature(text)).tolist() == [expected], text
    loaded = loaded_from("grid", "gw2-2x3")
    assert world_of(loaded, {"c0-1": (7, 7)}).points["c0-1"] == (7, 7)


@pytest.mark.parametrize(
    "text",
    [
        "", "()", "(", ")", "((mod", "at", "(mod (row (at r1)) x)", "(mod (row (at r1)) 0)",
        "(mod (row (at r1)) 03)", "(min (row (at r1)) -1)", "(sign (row (at r1)))",
        "(mod (row r1) 3)", "(mod (row (at r1)) 3) x", "(" * 600 + ")" * 600, "(max (count at) 1)",
        "(mod (degree (at r1)) 3)",
    ],
)  # fmt: skip
def test_what_is_no_feature(text: str) -> None:
    with pytest.raises(BadInput, match="defines no feature"):
        feature(text)


def test_equal_features_are_kept_once() -> None:
    states = [states_of("grid/gw2-2x3"), states_of("grid/gw3-2x4")]
    pool = pool_of(states, 8)
    assert 3 < len(pool.features) < pool.tried
    partitions = set()
    for feature_, row in zip(pool.features, pool.values, strict=True):
        assert row.tolist() == np.concatenate([own.get(feature_) for own in states]).tolist()
        partitions.add(tuple(map(row.tolist().index, row.tolist())))
    assert len(partitions) == len(pool.features)
    assert (0,) * len(pool.values[0]) not in partitions


def test_coordinates_of_a_file() -> None:
    """From the least one; where they are no whole numbers, in their order."""
    loaded, names = (
        loaded_from("handover", "exchange"),
        ("east", "east-north", "west", "west-north"),
    )
    rows = loaded.tasks[0].init[None, :]
    column = feature("(mod (column (at r1)) 4)")  # r1 is at west
    for xs, expected in (((3, 3, 5, 5), 2), ((0.5, 0.5, 0.7, 0.9), 1)):
        points = {name: (x, float(k)) for k, (name, x) in enumerate(zip(names, xs, strict=True))}
        assert States(world_of(loaded, points), rows).get(column).tolist() == [expected]
    assert States(world_of(loaded, {}), rows).get(column).tolist() == [f.UNDEFINED]


#: Definition # formula # a value # what it means # in English.
WORDED = """
(mod (column (at r1)) 3) # column(at(r1)) mod 3 # 1 # column(at(r1)) mod 3 = 1 # the column of the object in (at r1 ..), modulo 3
(min (count holds _ box) 2) # min(#holds(_, box), 2) # 2 # #holds(_, box) >= 2 # the number of true atoms (holds .. box), where 2 stands for 2 or more
(sign (- (size (and room (not clean))) (size (some (inverse at) (one r1))))) # sign(|(room and not clean)| - |some at^-1.{r1}|) # -1 # |(room and not clean)| < |some at^-1.{r1}| # which is larger, the number of objects that are (room and not clean) or the number of objects that are inversely at-related to something r1
(same (at r1) (inverse holds r2)) # [at(r1) = holds^-1(r2)] # 0 # at(r1) != holds^-1(r2) # whether the object in (at r1 ..) is the object in (holds .. r2)
(min (gap door (one hall) (some (closure door) all)) 1) # min(door-distance({hall}, some door+.all), 1) # 0 # door-distance({hall}, some door+.all) = 0 # the fewest links of door between an object that is hall and one that is door-related in one or more steps to something any, where 1 stands for 1 or more
(mod (position next (on r1)) 2) # next-position(on(r1)) mod 2 # undefined # next-position(on(r1)) mod 2 undefined # the position along next of the object in (on r1 ..), modulo 2
(min (degree door (at r1)) 1) # min(door-degree(at(r1)), 1) # 1 # door-degree(at(r1)) >= 1 # the number of objects that door links with the object in (at r1 ..), where 1 stands for 1 or more
(mod (distance door (at r1) (at r2)) 2) # door-distance(at(r1), at(r2)) mod 2 # 0 # door-distance(at(r1), at(r2)) mod 2 = 0 # the links of door between the object in (at r1 ..) and the object in (at r2 ..), modulo 2
"""


@pytest.mark.parametrize("row", WORDED.strip().splitlines())
def test_worded(row: str) -> None:
    text, as_formula, value, meaning, said = row.split(" # ")
    found = feature(text)
    assert f.formula(found) == as_formula
    assert f.condition(found, f.UNDEFINED if value == "undefined" else int(value)) == meaning
    assert f.english(found) == said
