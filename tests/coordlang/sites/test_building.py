# SPDX-License-Identifier: GPL-3.0-or-later
"""Buildings of Open-RMF: what is read, what may not happen in a step, and what is wrong with files."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable
from functools import cache
from itertools import product
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import pytest
from scipy.optimize import minimize

import coordlang as library
from coordlang.sites.building import Building, read_building
from coordlang.sites.building_pddl import building_files
from coordlang.sites.coordinates import read_coordinates
from planners.system.errors import BadInput, Note, UsageError
from tests.support import thorough
from tests.support.command import Command
from tests.support.domains import SHARED

BUILDINGS = SHARED / "rmf"
#: A square of 20 m with a lane along each side, one of them one-way, and a way out to a charger.
SQUARE = """\
name: square
levels:
  L1:
    elevation: 0
    drawing: {filename: floor.png}
    vertices:
      - [0, 0, 0, North West, {is_charger: [4, true], spawn_robot_name: [1, Ada]}]
      - [100, 0, 0, ""]
      - [100, 100, 0, Lift., {is_parking_spot: [4, true]}]
      - [0, 100, 0, door]
      - [-50, 0, 0, door, {is_charger: [4, false], spawn_robot_name: [1, bob 2]}]
      - [300, 300, 0, wall]
    lanes:
      - [0, 1, {bidirectional: [4, true], graph_idx: [2, 0], speed_limit: [3, 0.5]}]
      - [1, 2, {bidirectional: [4, false]}]
      - [2, 3, {bidirectional: [4, true]}]
      - [3, 0, {bidirectional: [4, true], mutex: [1, ""]}]
      - [0, 4, {bidirectional: [4, true]}]
    measurements:
      - [0, 1, {distance: [3, 20]}]
      - [1, 2, {distance: [3, 20]}]
    doors: [[0, 1, {}], [1, 2, {}]]
    walls: []
lifts: {}
"""


def written(folder: Path, text: str = SQUARE) -> Path:
    path = folder / "some.building.yaml"
    path.write_text(text)
    return path


def level(
    vertices: str, lanes: str, more: str = "measurements: [[0, 1, {distance: [3, 1]}]]"
) -> str:
    return f"levels:\n  L1:\n    vertices: {vertices}\n    lanes: {lanes}\n    {more}\n"


def driven(building: Building) -> set[tuple[str, str]]:
    return {(lane.start, lane.end) for lane in building.lanes}


def test_what_is_read(tmp_path: Path) -> None:
    found = read_building(written(tmp_path))
    assert [*found.places] == ["north-west", "l1-1", "lift", "door", "door-l1-4"]
    assert found.coordinates() == {
        "north-west": (0, 0), "l1-1": (20, 0), "lift": (20, 20), "door": (0, 20), "door-l1-4": (-10, 0)
    }  # fmt: skip
    both = {
        ("north-west", "l1-1"),
        ("lift", "door"),
        ("door", "north-west"),
        ("north-west", "door-l1-4"),
    }
    assert driven(found) == both | {(b, a) for a, b in both} | {("l1-1", "lift")}
    assert found.spawning == {"ada": "north-west", "bob-2": "door-l1-4"}
    assert [name for name, place in found.places.items() if place.is_charger] == ["north-west"]
    assert [name for name, place in found.places.items() if place.is_parking] == ["lift"]
    assert found.unused == {"doors": 2, "speed_limit": 1}
    assert ({lane.graph for lane in found.lanes}, found.unscaled) == ({0}, ())


def test_the_problem_is_understood(tmp_path: Path) -> None:
    with pytest.warns(Note, match=r"clearance 0 m|not used: doors \(2\) and speed_limit \(1\)"):
        site = library.import_site(written(tmp_path), task=["Ada:lift", "bob 2:door-l1-4"])
    with pytest.raises(UsageError, match="cannot be made"):
        site.save("")
    site.save(tmp_path / "pddl")
    files = tmp_path / "pddl" / "domain.pddl", tmp_path / "pddl" / "problem.pddl"
    found = library.inspect(*files, states=True).data()
    assert (found["robots"], found["states"]) == (("ada", "bob-2"), 5 * 4)
    assert found["goal"] == "(and (at ada lift) (at bob-2 door-l1-4))"
    assert found["statics"] == {"charger": 1, "lane": 9, "parking": 1}
    assert (library.plans(*files).makespan, library.check(*files).agree) == (2, True)
    places = {*read_building(written(tmp_path)).places}
    assert {*read_coordinates(tmp_path / "pddl" / "coordinates.json")} == places


def test_vertices_at_one_point_are_one_place(tmp_path: Path) -> None:
    text = level(
        '[[0, 0, 0, ""], [1, 0, 0, "", {is_charger: [4, false], mutex: [1, m]}], '
        "[1, 0, 0, b, {is_charger: [4, true], mutex: [1, n], spawn_robot_name: [1, z]}], "
        "[2, 0, 0, c]]",
        "[[0, 1], [2, 3, {bidirectional: [4, true]}]]",
    )
    found = read_building(written(tmp_path, text))
    assert driven(found) == {("l1-0", "b"), ("b", "c"), ("c", "b")}
    assert found.places["b"].is_charger
    assert found.places["b"].groups == {"mutex m", "mutex n"}
    assert (found.spawning, found.unused) == ({"z": "b"}, {})


def test_places_that_could_not_be_told_apart_on_a_page(tmp_path: Path) -> None:
    near = level('[[0, 0, 0, ""], [1, 0, 0, ""], [1.0001, 0, 0, ""]]', "[[0, 1], [1, 2]]")
    with pytest.raises(BadInput, match="two places have the same coordinates"):
        library.import_site(written(tmp_path, near), robots=1)


SCALED = {
    "mean of two": (
        "measurements: [[0, 1, {distance: [3, 5]}], [0, 2, {distance: [3, 20]}]]",
        (7.5, 0),  # 0.5 and 1 metres for a pixel
    ),
    "none": ("walls: []", (10, 0)),
}


@pytest.mark.parametrize("name", SCALED)
def test_scale(name: str, tmp_path: Path) -> None:
    more, point = SCALED[name]
    text = level("[[0, 0, 0, a], [10, 0, 0, b], [20, 0, 0, c]]", "[[0, 1]]", more)
    found = read_building(written(tmp_path, text))
    assert found.places["b"].point == pytest.approx(point)
    assert found.unscaled == (("L1",) if name == "none" else ())
    if name == "none":
        with pytest.raises(UsageError, match="--clearance 1: L1 has no measurement"):
            building_files(found, 1, [], 1.0)


def test_other_coordinate_systems(tmp_path: Path) -> None:
    cells = level("[[1, 2, 0, a], [4, 6, 0, b]]", "[[0, 1]]")
    metres = read_building(written(tmp_path, "coordinate_system: cartesian_meters\n" + cells))
    assert metres.coordinates() == {"a": (1, -2), "b": (4, -6)}
    there = level("[[103.78, 1.3, 0, a], [103.781, 1.301, 0, b]]", "[[0, 1]]")
    earth = read_building(written(tmp_path, "coordinate_system: wgs84\n" + there))
    (ax, ay), (bx, by) = earth.coordinates().values()
    # A thousandth of a degree at the equator: 111.3 m to the east, 110.6 m to the north.
    assert [bx - ax, ay - by] == pytest.approx([111.29, 110.58], abs=0.05)


TWO_LEVELS = """
levels:
  L1:
    vertices: [[0, 0, 0, a, {spawn_robot_name: [1, r]}], [10, 0, 0, "", {lift_cabin: [1, Up]}], [0, 9, 0, x]]
    lanes: [[0, 1, {bidirectional: [4, true], graph_idx: [2, 3]}], [0, 2, {graph_idx: [2, 1]}], [2, 1, {graph_idx: [2, 1]}]]
    measurements: [[0, 1, {distance: [3, 10]}]]
    fiducials: [[0, 0, one], [10, 0, two]]
  2:
    vertices: [[0, 0, 0, a, {spawn_robot_name: [1, s]}], [20, 0, 0, "", {lift_cabin: [1, Up]}]]
    lanes: [[0, 1, {bidirectional: [4, true], graph_idx: [2, 3]}]]
    measurements: [[0, 1, {distance: [3, 77]}]]
    fiducials: [[0, 0, one], [20, 0, two], [1, 1, three]]
"""


def test_lifts_join_levels_and_fiducials_scale_them(tmp_path: Path) -> None:
    found = read_building(written(tmp_path, TWO_LEVELS))
    assert [*found.places] == ["a", "l1-1", "x", "a-p-2-0", "p-2-1"]
    assert found.coordinates()["p-2-1"] == (25, 0)  # 10 m from (15, 0), where the level begins
    rides = [
        (lane.graph, lane.start, lane.end) for lane in found.lanes if "lift_cabin Up" in lane.groups
    ]
    assert rides == [(3, "l1-1", "p-2-1"), (3, "p-2-1", "l1-1")]
    assert {lane.graph for lane in found.lanes} == {1, 3}
    texts, robots = building_files(found, ["s", "r"], ["s:L1:0"], 0)
    assert robots == ("s", "r")
    # The first graph with a lane where r starts leads into the lift, and not out of it again.
    assert "(uses s graph-3) (uses r graph-1)" in texts["problem.pddl"]
    own = building_files(found, ["s"], ["s:p-2-1"], 0)[0]
    assert "graph" not in own["domain.pddl"] + own["problem.pddl"]
    for task, message in (("r:p-2-1", "no lanes lead"), ("s:a", "vertex: L1:0 or 2:0")):
        with pytest.raises(UsageError, match=message):
            building_files(found, None, [task], 0)
    roof = "  roof:\n    walls: []\n"
    renamed = TWO_LEVELS.replace("[1, s]", "[1, r1]") + roof
    found = read_building(written(tmp_path, renamed))
    assert (found.unscaled, building_files(found, 3, [], 0)[1]) == ((), ("r", "r1", "r2"))


def test_one_robot_is_in_a_lift(tmp_path: Path) -> None:
    text = re.sub(r", \[\d, \d, {graph_idx: \[2, 1\]}\]", "", TWO_LEVELS)
    found = read_building(written(tmp_path, text))
    files = saved(tmp_path, building_files(found, None, ["r:a-p-2-0", "s:L1:0"], 0)[0])
    with pytest.raises(library.ProvedImpossible):
        library.plans(*files)  # the shaft holds one robot: they cannot trade places
    files = saved(tmp_path, building_files(found, ["r"], ["r:a-p-2-0"], 0)[0])
    assert library.plans(*files).makespan == 3


def test_lifts_of_one_place_come_in_order(tmp_path: Path) -> None:
    cabins = "".join(f', [9, 0, 0, "", {{lift_cabin: [1, {name}]}}]' for name in "gaecfbd")
    one = f"{{vertices: [[0, 0, 0, a]{cabins}], lanes: [[0, 1]]}}"
    found = read_building(written(tmp_path, f"levels: {{L1: {one}, L2: {one}}}"))
    rides = [name for lane in found.lanes for name in lane.groups if lane.start == "l1-1"]
    assert rides == [f"lift_cabin {name}" for name in "abcdefg"]


def saved(folder: Path, texts: dict[str, str]) -> tuple[Path, Path]:
    for name, text in texts.items():
        (folder / name).write_text(text)
    return folder / "domain.pddl", folder / "problem.pddl"


# A step by its definition: distances from an optimiser, groups as the file has them.

Step = tuple[str, str]


def least(distance: Callable[[np.ndarray[Any, Any]], float], size: int) -> float:
    """The least value of a convex function of numbers from 0 to 1."""
    found = minimize(distance, [0.5] * size, bounds=[(0, 1)] * size, method="L-BFGS-B", tol=1e-14)
    return math.sqrt(max(0.0, float(found.fun)))


@cache
def apart(one: tuple[Any, Any], other: tuple[Any, Any]) -> float:
    """How near two segments are; both are driven evenly where one ends as the other begins."""
    (a, b), (c, d) = (tuple(map(np.array, each)) for each in (one, other))
    is_following = one[0] == other[1] or one[1] == other[0]

    def squared(at: np.ndarray[Any, Any]) -> float:
        difference = (a + at[0] * (b - a)) - (c + at[-1] * (d - c))
        return float(difference @ difference)

    return least(squared, 1 if is_following else 2)


def groups(building: Building, step: Step) -> set[str]:
    lanes = [lane for lane in building.lanes if (lane.start, lane.end) == step]
    return set().union(*(building.places[p].groups for p in step), *(n.groups for n in lanes))


def allowed(building: Building, one: Step, other: Step, clearance: float) -> bool:
    """Whether two robots may do this in one step."""
    point = {name: place.point for name, place in building.places.items()}
    if one[1] == other[1] or (one[0] != one[1] and one == other[::-1]):
        return False
    for mine, theirs in ((one, other), (other, one)):
        for place in {*theirs} - {*mine} if mine[0] != mine[1] else ():
            here = point[place], point[place]
            if apart((point[mine[0]], point[mine[1]]), here) < clearance:
                return False
            if groups(building, mine) & groups(building, (place, place)):
                return False
    if one[0] == one[1] or other[0] == other[1]:
        return True
    ways = [(point[start], point[end]) for start, end in (one, other)]
    return apart(*ways) >= clearance and not groups(building, one) & groups(building, other)


def reachable(building: Building, start: tuple[str, str], clearance: float) -> tuple[int, int]:
    """How many states two robots reach, and by how many steps."""
    lanes = driven(building)
    found, left, steps = {start}, [start], 0
    known: dict[tuple[Step, Step], bool] = {}
    while left:
        ways = [[(p, p), *((a, b) for a, b in lanes if a == p)] for p in left.pop()]
        for one, other in product(*ways):
            if (one, other) not in known:
                known[one, other] = allowed(building, one, other, clearance)
            if known[one, other]:
                steps += 1
                if (state := (one[1], other[1])) not in found:
                    found.add(state)
                    left.append(state)
    return len(found), steps


def random_building(random: Random) -> str:
    points = random.sample([(x, y) for x in range(6) for y in range(6)], 7)
    vertices = [
        f"[{x}, {y}, 0, '', {{mutex: [1, {random.choice(['', '', 'm', 'n'])!r}]}}]"
        for x, y in points
    ]
    ends = {tuple(sorted((k, random.randrange(k)))) for k in range(1, 7)}
    ends |= {tuple(sorted(random.sample(range(7), 2))) for _ in range(3)}
    lanes = [
        f"[{a}, {b}, {{bidirectional: [4, {random.choice(['true', 'true', 'false'])}],"
        f" mutex: [1, {random.choice(['', '', '', 'm'])!r}]}}]"
        for a, b in sorted(ends)
    ]
    text = level(f"[{', '.join(vertices)}]", f"[{', '.join(lanes)}]", "walls: []")
    return "coordinate_system: cartesian_meters\n" + text


@pytest.mark.parametrize("seed", [*range(6), *thorough(*range(6, 12))])
def test_steps_are_those_of_the_definition(seed: int, tmp_path: Path) -> None:
    random = Random(seed)
    clearance = random.choice([0.0, 0.29, 0.83, 1.13])  # no distance of these points
    found = read_building(written(tmp_path, random_building(random)))
    texts, _ = building_files(found, 2, [], clearance)
    inspected = library.inspect(*saved(tmp_path, texts), states=True).data()
    (first, second), goal = inspected["robots"], inspected["goal"]
    start = tuple(goal.split(f"(at {robot} ")[1].split(")")[0] for robot in (first, second))
    assert len(start) == 2
    assert (inspected["states"], inspected["joint_steps"]) == reachable(found, start, clearance)


# What is wrong, and where.

BOMB = "a: &a [x, x]\nb: &b [*a, *a]\nc: [*b, *b]\n" + SQUARE
WRONG: list[tuple[str | tuple[str, str], str, str]] = [
    (("true]}", "!!python/object/apply:os.system [id]}"), ":9:", "tags are not read"),
    (("name: square", "name: !!str square"), ":1:7:", "tags are not read"),
    (("name: square", "name: ! square"), ":1:7:", "tags are not read"),
    (BOMB, ":1:4:", "anchors and aliases are not read"),
    ("levels: " + "[" * 40 + "]" * 40, ":1:40:", "more than 32 lists and mappings in one"),
    ("levels: " + "[" * 100_000, ":1:", ""),  # some versions of libyaml refuse it before we do
    ("levels: [", ":", "this is no YAML"),
    ("levels: {}\n---\nlevels: {}\n", ":2:1:", "this is no YAML: but found another document"),
    ("\tlevels: {}", ":1:1:", "this is no YAML"),
    ("levels: {}\x07", "", "this is no YAML"),
    ("", "", "the file is empty"),
    ("[1, 2]", ":1:1:", "expected a mapping, found a list"),
    ("just a text", ":1:1:", "expected a mapping, found 'just a text'"),
    ("name: x\n", ":1:1:", "this building has no lanes"),
    ("levels: {}\n", ":1:9:", "this building has no lanes"),
    ("levels: [1]\n", ":1:9:", "expected a mapping, found a list"),
    ("levels:\n  L1: 7\n", ":2:7:", "expected a mapping, found '7'"),
    (("name: square", "name: square\nname: round"), ":2:1:", "the key 'name' occurs twice"),
    (("[100, 0, 0", "[100, 0x0, 0"), ":8:", "expected a number, found '0x0'"),
    (("[100, 0, 0", "[100, 010, 0"), ":8:", "expected a number, found '010'"),
    (("[100, 0, 0", "[100, .nan, 0"), ":8:", "expected a number, found '.nan'"),
    (("[100, 0, 0", "[100, 1e999, 0"), ":8:", "expected a number, found '1e999'"),
    (("[100, 0, 0", "[100, '0', 0"), ":8:", "expected a number, found '0'"),
    (("[100, 0, 0", "[100, [0], 0"), ":8:", "expected a number, found a list"),
    (
        ('[100, 0, 0, ""]', "[100, 0, 0]"),
        ":8:9:",
        "expected a list of 4 or more, found a list of 3",
    ),
    (("door]", "{a: b}]"), ":10:", "expected a text, found a mapping"),
    (("[0, 1, {bi", "[0, 6, {bi"), ":14:13:", "expected a whole number from 0 to 5, found '6'"),
    (("[0, 1, {bi", "[-1, 1, {bi"), ":14:10:", "expected a whole number from 0 to 5, found '-1'"),
    (("[0, 1, {bi", "[1, 1, {bi"), ":14:9:", "both ends are at one point"),
    (
        ("300, 300, 0, wall", "0, 0, 0, w, {spawn_robot_name: [1, c]}"),
        ":7:9:",
        "two robots start at",
    ),
    (("[300, 300", "[., 300"), ":12:10:", "expected a number"),
    (("graph_idx: [2, 0]", "graph_idx: [2, many]"), ":14:", "expected a whole number from 0"),
    (("graph_idx: [2, 0]", "graph_idx: 2"), ":14:", "expected a list of 2 or more, found '2'"),
    (("[4, false]}]\n      - [2", "[4, 0]}]\n      - [2"), ":15:", "expected true or false"),
    (("distance: [3, 20]", "distance: [3, 0]"), ":20:9:", "a measurement needs a distance above 0"),
    (("distance: [3, 20]", "length: [3, 20]"), ":20:9:", "a measurement needs a distance above 0"),
    (("name: square", "coordinate_system: web_mercator"), ":1:20:", "'web_mercator' is not read"),
    (("name: square", "reference_level_name: L2"), ":1:23:", "there is no level 'L2'"),
    (("bob 2", "ADA"), ":11:9:", "no name for a robot here: 'ADA'"),
    (("bob 2", '"?!"'), ":11:9:", "no name for a robot here: '?!'"),
    (("North West", '"a\\nb"'), ":7:", "holds the character U+000A"),
    (("North West", '"\\u202eb"'), ":7:", "holds the character U+202E"),
    (("Ada", '"\\e[31m"'), ":7:9:", "holds the character U+001B"),
    (("  L1:", '  "L\\n1":'), ":4:5:", "holds the character U+000A"),
]


MANY = ("levels: [" + "1," * 4_000_001 + "1]", ":1:", "more than 4,000,000 values")  # 8 MB


@pytest.mark.parametrize(
    ("change", "line", "message"), [*WRONG, *thorough(MANY)], ids=range(len(WRONG) + 1)
)
def test_what_is_wrong_and_where(
    change: str | tuple[str, str], line: str, message: str, tmp_path: Path
) -> None:
    if isinstance(change, tuple):
        assert change[0] in SQUARE
        change = SQUARE.replace(*change, 1)
    path = written(tmp_path, change)
    with pytest.raises(BadInput, match=re.escape(message)) as caught:
        read_building(path)
    assert str(caught.value).startswith(str(path) + line)
    assert caught.value.remedy


def test_bytes_that_are_no_text(tmp_path: Path) -> None:
    path = written(tmp_path)
    for data, message in (
        (b"name: \xff\n", "no UTF-8 text"),
        (b"x" * (2**25 + 1), "more than 32 MiB"),
    ):
        path.write_bytes(data)
        with pytest.raises(BadInput, match=message):
            read_building(path)
    path.write_bytes(b"\xef\xbb\xbf" + SQUARE.replace("\n", "\r\n").encode())
    assert len(read_building(path).places) == 5


def test_the_slow_parser_reads_the_same(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """PyYAML is also installed without libyaml."""
    import yaml

    path = written(tmp_path)
    expected = read_building(path)
    monkeypatch.setattr("coordlang.sites.yaml_file._LOADER", yaml.SafeLoader)
    assert read_building(path) == expected
    path.write_text(BOMB)
    with pytest.raises(BadInput, match="anchors and aliases"):
        read_building(path)


NAMES = [
    *("not", "and", "at", "move", "lane", "robot", "place", "object", "either", "number"),
    *("?x", "(", ";", "é", "1", "graph-0"),
]


def test_names_of_all_kinds_are_names_of_pddl(tmp_path: Path) -> None:
    vertices = [f"[{k}, 0, 0, {json.dumps(name)}]" for k, name in enumerate(NAMES)]
    lanes = [f"[{k}, {k + 1}, {{bidirectional: [4, true]}}]" for k in range(len(NAMES) - 1)]
    text = level(f"[{', '.join(vertices)}]", f"[{', '.join(lanes)}]")
    found = read_building(written(tmp_path, text))
    texts, _ = building_files(found, ["r", "at-robot"], ["r:1"], 0)
    inspected = library.inspect(*saved(tmp_path, texts), states=True).data()
    # In a row of places nobody passes: one of the two is always on the left.
    assert inspected["states"] == len(NAMES) * (len(NAMES) - 1) // 2
    assert "graph-0" not in found.places  # a graph has this name: it would be declared twice


ASKED = [
    (["--robots", "0"], "at least one is needed"),
    (["--robots", "1000000"], "there is room for 5 robots"),
    (["--robots", "Ada,ada"], "'ada' cannot be used"),
    (["--robots", "door,Ada"], "'door' cannot be used"),
    (["--robots", ","], "'' cannot be used"),
    (["--task", "Ada"], "there is no such place"),
    (["--task", "Ada:nowhere"], "there is no such place"),
    (["--task", "Eve:door"], "'Eve' is no robot"),
    (["--task", "Ada:lift", "--task", "ada:lift"], "'ada' has a task already"),
    (["--task", "Ada:lift", "--task", "bob-2:lift"], "ada and bob-2 end in lift and lift"),
    (["--clearance", "10.5"], "ada and bob-2 start in north-west and door-l1-4"),
    (["--clearance", "-1"], "expected metres from 0"),
    (["--clearance", "nan"], "expected metres from 0"),
]


@pytest.mark.parametrize(("options", "message"), ASKED, ids=range(len(ASKED)))
def test_robots_and_tasks_that_there_are_not(
    options: list[str], message: str, coordlang: Command, tmp_path: Path
) -> None:
    outcome = coordlang("import", written(tmp_path), "-o", tmp_path / "new", *options)
    assert (outcome.code, message in outcome.err) == (2, True), outcome.err
    assert not (tmp_path / "new").exists()


def test_command(coordlang: Command, tmp_path: Path) -> None:
    path, folder = written(tmp_path), tmp_path / "new"
    outcome = coordlang("import", path, "-o", folder, "--robots", 3, "--json")
    assert outcome.code == 0
    assert json.loads(outcome.out) == {
        "folder": str(folder),
        "files": ["coordinates.json", "domain.pddl", "problem.pddl"],
        "robots": ["ada", "bob-2", "r1"],
        "unused": {"doors": 2, "speed_limit": 1},
    }
    for said in ("r1 in lift", "clearance 0 m", "no --task", "doors (2)"):
        assert said in outcome.err
    assert (
        "(:goal (and (at ada north-west) (at bob-2 door-l1-4) (at r1 lift)))"
        in (folder / "problem.pddl").read_text()
    )
    again = coordlang("import", path, "-o", folder, "--robots", 2)
    assert (again.code, "says something else" in again.err) == (2, True)
    path.rename(tmp_path / "some.txt")
    assert coordlang("import", tmp_path / "some.txt", "-o", folder).code == 2
    assert coordlang("import", tmp_path / "none.yaml", "-o", folder).code == 31


def test_no_robot_spawns(coordlang: Command, tmp_path: Path) -> None:
    path = written(tmp_path, SQUARE.replace("spawn_robot_name", "name"))
    outcome = coordlang("import", path, "-o", tmp_path / "new")
    assert (outcome.code, "no robot spawns" in outcome.err) == (31, True)
    with pytest.raises(UsageError, match="at least one is needed"):
        library.import_site(path, robots=[])
    assert coordlang("import", path, "-o", tmp_path / "new", "--robots", "x,y").code == 0


#: Places and directed lanes of each building of others, graphs, robots that spawn.
OTHERS = {
    "office": (29, 60, 1, 2),
    "triple_H": (23, 44, 1, 4),
    "hotel": (75, 268, 3, 4),
    "campus": (145, 181, 1, 3),
}


@pytest.mark.foreign
@pytest.mark.parametrize("name", OTHERS)
def test_buildings_of_others(name: str, tmp_path: Path) -> None:
    found = read_building(BUILDINGS / f"{name}.building.yaml")
    graphs = {lane.graph for lane in found.lanes}
    counts = tuple(map(len, (found.places, found.lanes, graphs, found.spawning)))
    assert counts == OTHERS[name]
    assert found.unscaled == ()
    texts, robots = building_files(found, None, [], 0.2)
    domain, problem = saved(tmp_path, texts)
    assert library.inspect(domain, problem).data()["robots"] == tuple(sorted(robots))
    assert len(read_coordinates(tmp_path / "coordinates.json")) <= len(found.places)


@pytest.mark.foreign
def test_robots_ride_the_lifts_of_the_hotel(tmp_path: Path) -> None:
    found = read_building(BUILDINGS / "hotel.building.yaml")
    tasks = ["tinyBot_1:L3_master_suite", "deliveryBot_1:L2_room1"]
    files = saved(tmp_path, building_files(found, ["tinyBot_1", "deliveryBot_1"], tasks, 0)[0])
    plans = library.plans(*files, cost="makespan+actions")
    assert (plans.makespan, plans.count) == (17, 70)
    assert [step for step in plans[0] if "(move tinybot_1 l1-95 l3-122)" in step]


#: Two robots, all pairs of states: tasks, those that require coordination, divergences; from an
#: independent reference (the README of the folder has them).
REFERENCE = {"triple_H": (255_530, 20_986, 3_426), "office": (658_532, 50_676, 16_936)}


@pytest.mark.foreign
@pytest.mark.parametrize("name", ["triple_H", pytest.param("office", marks=[pytest.mark.slow])])
def test_numbers_of_an_independent_reference(name: str, tmp_path: Path) -> None:
    found = read_building(BUILDINGS / f"{name}.building.yaml")
    files = saved(tmp_path, building_files(found, 2, [], 0)[0])
    built = library.build(*files, tasks="all", method="greedy").data()
    names = ("tasks", "tasks_requiring_coordination", "divergences")
    assert tuple(built[key] for key in names) == REFERENCE[name]
