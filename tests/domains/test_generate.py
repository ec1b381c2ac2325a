# SPDX-License-Identifier: GPL-3.0-or-later
"""The generator and its maps: what is shipped is what it writes, and has the rules of the grid."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from collections import Counter
from itertools import product
from pathlib import Path
from xml.etree import ElementTree

import families
import numpy as np
import pytest
from generate import Scenario, main, problem_text
from gridmap import GridMap, open_grid, read_map, ring, three_cells

from planners.loading import build, load
from planners.pddl import parse_problem
from planners.pddl.sexpr import Source
from planners.search.optimal_plans import plan_spaces, search
from planners.search.plan_space import PlanSpace
from planners.search.plans import counts
from planners.search.reachable import Space, explore
from planners.system.errors import BadInput
from tests.support import thorough
from tests.support.domains import DOMAINS, MAPS, read, world_of
from tests.support.texts import model_of

#: What people write in them; everything else there comes from the generator.
BY_HAND = {
    *("README.md", "generate.py", "gridmap.py", "picture.py"),
    *("grid/domain.pddl", "grid-joint/domain.pddl", "corridor/rooms.tasks.json"),
    *("t-map/t-map.map", "t-map/t-map.scen", "corridor/corridor.map"),
    *(f"{folder}/README.md" for folder in MAPS),
}


def files(folder: Path) -> dict[str, bytes]:
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
        and not any(part.startswith((".", "__")) for part in path.relative_to(folder).parts)
    }


def test_the_shipped_files_are_what_the_generator_writes(tmp_path: Path) -> None:
    # In a process of its own with another hash seed: the order of sets must not show.
    command = [sys.executable, str(DOMAINS / "generate.py"), "all", "--into", str(tmp_path)]
    subprocess.run(command, check=True, env={**os.environ, "PYTHONHASHSEED": "77"})
    ours = {name: data for name, data in files(DOMAINS).items() if name.split("/")[0] in MAPS}
    shipped = {name: data for name, data in ours.items() if name not in BY_HAND}
    written = files(tmp_path)
    assert sorted(written) == sorted(shipped)
    assert [name for name in written if written[name] != shipped[name]] == []


@pytest.mark.parametrize(("style", "domain"), [("agents", "grid"), ("joint", "grid-joint")])
def test_one_problem_with_everything(tmp_path: Path, style: str, domain: str) -> None:
    problem, picture, tasks = (tmp_path / name for name in ("p.pddl", "p.svg", "t.json"))
    outputs = ["-o", str(problem), "--picture", str(picture), "--tasks", str(tasks)]
    assert main(["ring", "2x3", "--style", style, "--at-least", "3", *outputs]) == 0
    loaded = load(DOMAINS / domain / "domain.pddl", [problem])
    assert loaded.model.codec.decode(loaded.tasks[0].init) == ["(at r1 c0-0)", "(at r2 c1-2)"]
    assert ElementTree.parse(picture).getroot().tag.endswith("svg")
    # Only corners are 3 apart: 4 pairs for one robot, 5 * 5 places for the other; both far: 4 * 3.
    # 2 * 100 - 12.
    assert len(json.loads(tasks.read_text())["tasks"]) == 188


def test_a_problem_from_a_map_on_stdout(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    path = DOMAINS / "t-map" / "t-map.map"
    ends = ["--starts", "c0-1", "c1-0", "--goals", "c1-0", "c0-1"]
    assert main(["map", str(path), *ends, "--domain", "t-map"]) == 0
    assert capsys.readouterr().out == (DOMAINS / "t-map" / "problem.pddl").read_text()


@pytest.mark.parametrize(
    ("arguments", "code", "message"),
    [
        (["open", "2x2", "--robots", "5"], 2, "cannot place 5 robots on 4 cells"),
        (["open", "2x2", "--robots", "0"], 2, "cannot place 0 robots"),
        (["open", "2x2", "--starts", "c0-0"], 2, "2 robots need 2 start cells, not 1"),
        (["open", "2x2", "--starts", "c0-0", "c9-9"], 2, "no start cell 'c9-9'"),
        (["open", "2x2", "--goals", "c0-0", "c0-0"], 2, "the same goal cell"),
        (["open", "2x2", "--robots", "3", "--style", "joint"], 2, "for two robots"),
        (["map", "no/such.map"], 31, "no/such.map: there is no such file"),
        (["open", "2x2", "-o", "no/such/folder/p.pddl"], 31, "cannot write no/such/folder/p.pddl"),
    ],
)
def test_errors_of_the_command(
    capsys: pytest.CaptureFixture[str], arguments: list[str], code: int, message: str
) -> None:
    assert main(arguments) == code
    captured = capsys.readouterr()
    assert message in captured.err
    assert captured.out == ""


@pytest.mark.parametrize(
    ("folder", "text", "steps", "robots"),
    [
        ("handover", families.handover(2), 10, 2),
        ("handover", families.handover(3, 1), 7, 2),
        ("push-box", families.push_box(3), 1, 2),
        ("push-box", families.push_box(6), 3, 2),
        ("charger", families.charger(1), 3, 2),
        ("charger", families.charger(2), 4, 2),
        ("elevator", families.elevator(3), 6, 3),
        ("vans", families.vans(1), 4, 3),
        ("vans", families.vans(2), 5, 3),
    ],
)
def test_problems_are_read_and_solved(folder: str, text: str, steps: int, robots: int) -> None:
    loaded = model_of((DOMAINS / folder / "domain.pddl").read_text(), text)
    assert len(loaded.model.robots) == robots
    space = search(loaded.model, loaded.tasks[0])
    assert space.cost_of(0)[0] == steps


# ---- maps by size, at random and from files of MovingAI


def written(tmp_path: Path, text: str) -> Path:
    file = tmp_path / "some.map"
    file.write_text(text, newline="")
    return file


@pytest.mark.parametrize(
    "text",
    [
        "type octile\nheight 2\nwidth 3\nmap\n.@G\nST.\n",
        "height 2\nwidth 3\nmap\n.OG\nSW.",
        "type octile\r\nheight 2\r\nwidth 3\r\nmap\r\n.@G\r\nST.\r\n",
        "width 3\nheight 2\nmap\n.@G\nS@.\n\n\n",
    ],
    ids=["movingai", "no type, no last newline", "windows", "other order, blank lines"],
)
def test_read_map(tmp_path: Path, text: str) -> None:
    grid = read_map(written(tmp_path, text))
    assert list(grid.cells) == ["c0-0", "c0-2", "c1-0", "c1-2"]
    assert grid.edges == (("c0-0", "c1-0"), ("c0-2", "c1-2"))


@pytest.mark.parametrize(
    ("text", "line", "message"),
    [
        ("type octile\nheight 2\nwidth 2\nmap\n..\n.x\n", ":6:2:", "unknown character 'x'"),
        ("height 2\nwidth 2\nmap\n..\n...\n", ":5:1:", "has 3 cells where the header says 2"),
        ("height 2\nwidth 2\nmap\n..\n", ":5:1:", "has 1 rows where the header says 2"),
        ("height 2\nwidth 2\nmap\n..\n..\n..\n", ":6:1:", "has 3 rows where the header says 2"),
        ("height two\nwidth 2\nmap\n..\n", ":1:1:", "unexpected 'height two'"),
        ("height 0\nwidth 2\nmap\n", ":1:1:", "unexpected 'height 0'"),
        ("height 2\nheight 2\nmap\n..\n..\n", ":2:1:", "unexpected 'height 2'"),
        ("height 2\nmap\n..\n..\n", ":2:1:", "unexpected 'map'"),
        ("height 2\nwidth 2\n", ":2:1:", "no line 'map'"),
        ("", ":1:1:", "no line 'map'"),
        ("height 1\nwidth 2\nmap\n@T\n", ":", "no passable cell"),
        ("height 1\nwidth 1\nmap\n\u00ff\n", ":4:1:", "this is no map: .*not ASCII"),
        (None, ":", "there is no such file"),
    ],
)
def test_what_is_wrong_with_a_map_and_where(
    tmp_path: Path, text: str | None, line: str, message: str
) -> None:
    file = tmp_path / "none.map" if text is None else written(tmp_path, text)
    with pytest.raises(BadInput, match=message) as caught:
        read_map(file)
    assert str(caught.value).startswith(str(file) + line)


# ---- what the maps contain: the rules of the grid, in both styles


def to_every_state(space: Space) -> PlanSpace:
    """The optimal plans between all pairs of different states."""
    groups = [(space.model.full_state(row), None) for row in space.rows]
    (plans,) = plan_spaces(space, groups)
    return plans


@pytest.mark.parametrize(
    "problem", ["gw1-2x2", "gw2-2x3", "gw4-3x3", "gwb1-2x4", "gwb5-3x3", *thorough("corners-4x4")]
)
def test_both_styles_are_the_same_model(problem: str) -> None:
    one, other = (world_of(style, problem).space for style in ("grid", "grid-joint"))
    assert one.model.codec.facts == other.model.codec.facts
    assert (one.rows == other.rows).all()
    # Only MA-PDDL has the step in which nobody moves.
    still = {(number, (None, None), number) for number in range(len(one))}
    assert steps(one) == steps(other) | still
    first, second = to_every_state(one), to_every_state(other)
    assert counts_at_starts(first) == counts_at_starts(second)


def steps(space: Space) -> set[tuple[int, tuple[str | None, ...], int]]:
    """(state, where each robot moves, next state); a step that is there twice is an error."""
    sources = np.repeat(np.arange(len(space)), np.diff(space.first)).tolist()
    texts = [
        tuple(text and text.split()[-1] for text in space.model.texts(own)) for own in space.labels
    ]
    found = [*zip(sources, texts, space.target.tolist(), strict=True)]
    assert len(set(found)) == len(found)
    return set(found)


def counts_at_starts(plans: PlanSpace) -> list[tuple[int, int, int]]:
    """(goal, initial state, number of optimal plans) of every task."""
    all_counts = counts(plans)
    return [
        (int(plans.goal[node]), int(plans.state[node]), all_counts[node]) for node in plans.starts
    ]


def naive_steps(grid: GridMap, state: tuple[str, ...]) -> set[tuple[str, ...]]:
    """The rules of a step, literally: who moves where, nobody shares a cell, nobody swaps."""
    options = [[cell, *grid.neighbours(cell)] for cell in state]
    return {
        after
        for after in product(*options)
        if len(set(after)) == len(after)
        and not any(
            a != b and (b, a) in zip(state, after, strict=True)
            for a, b in zip(state, after, strict=True)
        )
    }


@pytest.mark.parametrize(
    ("grid", "starts"),
    [
        (three_cells(), ("a", "b")),
        (three_cells(), ("a", "b", "c")),
        (open_grid(2, 2), ("c0-0", "c0-1", "c1-1", "c1-0")),
        (open_grid(2, 3), ("c0-0", "c1-1")),
        (open_grid(2, 3), ("c0-0", "c1-1", "c0-2")),
        (ring(2, 4), ("c0-0", "c1-1", "c0-2")),
    ],
    ids=["triangle-2", "triangle-3", "square-4", "grid-2", "grid-3", "ring-3"],
)
def test_the_grid_domain_against_its_rules(grid: GridMap, starts: tuple[str, ...]) -> None:
    robots = len(starts)
    domain, _ = read("grid", "gw1-2x2")
    text = problem_text(Scenario("naive", grid, starts, starts), "grid")
    loaded = build(domain, [parse_problem(Source("naive", text), domain)])
    space = explore(loaded.model, loaded.tasks[0].init[None, :])
    cells = [
        tuple(re.findall(r"\(at r\d+ (\S+)\)", loaded.model.codec.key(row))) for row in space.rows
    ]

    seen, todo = {starts}, [starts]
    while todo:
        new = naive_steps(grid, todo.pop()) - seen
        seen |= new
        todo += new
    assert set(cells) == seen
    for number, state in enumerate(cells):
        after = [
            cells[target] for target in space.target[space.first[number] : space.first[number + 1]]
        ]
        assert len(state) == robots
        assert Counter(after) == Counter(naive_steps(grid, state))
