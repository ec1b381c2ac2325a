# SPDX-License-Identifier: GPL-3.0-or-later
"""The worlds that are no maps: their rules hold in every step, and what their README files say is
true.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from xml.etree import ElementTree

import pytest

from coordlang.commands.building import build_language
from coordlang.required.miscoordination import Inseparable, miscoordination
from coordlang.verification.by_definition import verify
from planners.classical.fast_downward import optimal_cost
from planners.loading import PlanningInstance, load
from planners.pddl.model_options import Cost, ModelOptions
from planners.pddl.robots import static_atoms
from planners.search.optimal_plans import search
from planners.search.plans import Plans
from planners.search.reachable import Space
from planners.system.limits import time_limit
from tests.support.console import run_command
from tests.support.domains import DOMAINS, Worlds
from tests.support.pages import blocks, commands, links
from tests.support.readme_tables import Row, candidates, files, tables

#: The folders, and how the robots are found in each.
WORLDS = {
    "handover": "type robot",
    "two-arms": "type robot",
    "push-box": ":agent of type robot",
    "tray": ":agent of type robot",
    "vans": ":agent of type driver, van",
    "lock": ":agent of type robot",
    "charger": ":agent of type robot",
    "elevator": "type robot",
    "flags": ":agent of type robot",
}

PROBLEMS = [(folder, row) for folder in WORLDS for row in tables(folder, "problem")]
LANGUAGES = [(folder, row) for folder in WORLDS for row in tables(folder, "language for")]
by_problem = pytest.mark.parametrize(
    ("folder", "row"), [pytest.param(f, r, id=f"{f}-{r['problem']}") for f, r in PROBLEMS]
)
by_language = pytest.mark.parametrize(
    ("folder", "row"),
    [pytest.param(f, r, id=f"{f}-{r['language for']}-{r['--tasks']}") for f, r in LANGUAGES],
)
by_world = pytest.mark.parametrize("folder", WORLDS)


# What the README files say


@by_problem
def test_the_table_of_problems(world: Worlds, folder: str, row: Row) -> None:
    here = world(folder, row["problem"])
    assert len(here.loaded.model.robots) == int(row["robots"])
    assert len(here.space) == int(row["states"])
    assert here.plans.cost_of(0)[0] == int(row["makespan"])
    assert Plans.of(here.plans).count == int(row["optimal plans"])
    assert plans_under(folder, row["problem"], "makespan+actions") == int(
        row["with fewest actions"]
    )
    if "with least fuel" in row:
        assert plans_under(folder, row["problem"], "makespan+cost") == int(row["with least fuel"])
    required = miscoordination(here.plans, 0) is not None
    assert row["coordination"] == ("required" if required else "not required")


def plans_under(folder: str, problem: str, cost: Cost) -> int:
    loaded = load(*files(folder, problem), ModelOptions(cost=cost))
    return Plans.of(search(loaded.model, loaded.tasks[0])).count


@pytest.mark.thorough
@by_language
def test_the_table_of_languages(folder: str, row: Row) -> None:
    tasks = candidates(folder, row)
    assert tasks.count == int(row["tasks"])
    for method in ("greedy", "minimal"):
        built = build_language(tasks, method)
        guarantee = built.language.guarantee
        assert built.first_differences.requiring == int(row["requiring coordination"])
        assert guarantee.size == int(row[f"{method} words"])
        assert guarantee.proved_minimal or method == "greedy"
        assert verify(built.language.partition(tasks.model), tasks.spaces).holds


@by_world
def test_the_commands_in_the_readme(
    folder: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "domains").symlink_to(DOMAINS)
    monkeypatch.chdir(tmp_path)
    page = DOMAINS / folder / "README.md"
    run = [
        command for block in blocks(page) if block.kind == "console" for command in commands(block)
    ]
    assert {command.text.split()[1] for command in run} == {"coordination", "build", "verify"}
    for command in run:
        run_command(command, folder, monkeypatch)


@by_world
def test_the_picture(folder: str) -> None:
    page = DOMAINS / folder / "README.md"
    assert f"{folder}.svg" in links(page)
    root = ElementTree.parse(DOMAINS / folder / f"{folder}.svg").getroot()
    shown = [element.text for element in root.iter("{http://www.w3.org/2000/svg}text")]
    title = root.findtext("{http://www.w3.org/2000/svg}title") or ""
    name, _, problem = title.partition(": ")
    assert name == folder
    # Every robot carries its name, so that no colour has to be told from another one.
    assert set(load(*files(folder, problem)).model.robots) <= set(shown)


@by_world
def test_there_is_a_problem_of_each_kind(folder: str) -> None:
    rows = [row for other, row in PROBLEMS if other == folder]
    assert {row["coordination"] for row in rows} == {"required", "not required"}
    assert 2 <= len(rows) <= 4
    assert all(10 <= int(row["states"]) <= 2000 for row in rows)


# Fast Downward


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("folder", "problem"),
    [
        pytest.param(
            folder,
            row["problem"],
            id=f"{folder}-{row['problem']}",
            marks=[] if first else pytest.mark.slow,
        )
        for (folder, row), first in zip(
            PROBLEMS,
            [n == 0 or PROBLEMS[n - 1][0] != f for n, (f, _) in enumerate(PROBLEMS)],
            strict=True,
        )
    ],
)
def test_fast_downward_agrees(folder: str, problem: str) -> None:
    loaded = load(*files(folder, problem), ModelOptions(cost="makespan+actions"))
    ours = search(loaded.model, loaded.tasks[0]).cost_of(0)
    with time_limit(60):
        assert optimal_cost(loaded.model, loaded.tasks[0]).cost == ours


@pytest.mark.thorough
@pytest.mark.parametrize(("problem", "fuel"), [("one-van", 5), ("two-each", 6)])
def test_fast_downward_agrees_about_fuel(problem: str, fuel: int) -> None:
    loaded = load(*files("vans", problem), ModelOptions(cost="makespan+cost"))
    ours = search(loaded.model, loaded.tasks[0]).cost_of(0)
    assert ours[1] == fuel
    with time_limit(60):
        assert optimal_cost(loaded.model, loaded.tasks[0]).cost == ours


# The rules of each world, in every joint step that there is


@by_world
def test_who_the_robots_are(folder: str) -> None:
    for other, row in PROBLEMS:
        if other == folder:
            assert load(*files(folder, row["problem"])).team.by == WORLDS[folder]


State = frozenset[tuple[str, ...]]
#: (state with the static facts, subactions by robot, next state); the words of an atom or a
#: subaction are apart.
Step = tuple[State, dict[str, tuple[str, ...]], State]


@cache
def atoms(key: str) -> State:
    return frozenset(tuple(atom.split()) for atom in re.findall(r"\(([^()]*)\)", key))


def steps(loaded: PlanningInstance, space: Space) -> Iterator[Step]:
    model = space.model
    fixed = frozenset(
        (atom.predicate, *atom.args) for atom in static_atoms(loaded.domain, loaded.problems[0])
    )
    keys = [atoms(model.codec.key(row)) for row in space.rows]
    for source, before in enumerate(keys):
        for edge in range(space.first[source], space.first[source + 1]):
            texts = zip(model.robots, model.texts(space.labels[edge]), strict=True)
            chosen = {robot: tuple(text.strip("()").split()) for robot, text in texts if text}
            yield before | fixed, chosen, keys[space.target[edge]]


def handover_rule(before: State, chosen: dict[str, tuple[str, ...]], after: State) -> bool:
    """Giver and taker choose a hand-over together, at the two sides of a door."""
    given = {action for action in chosen.values() if action[0] == "hand-over"}
    return all(
        chosen.get(giver) == chosen.get(taker) == action
        and ("door", here, there) in before
        and ("holds", taker, parcel) in after
        for action in given
        for _, giver, taker, parcel, here, there in [action]
    )


def two_arms_rule(before: State, chosen: dict[str, tuple[str, ...]], after: State) -> bool:
    """One arm over a place; nobody swings to where somebody was."""
    over = [atom[2] for atom in after if atom[0] == "over"]
    was = {atom[2] for atom in before if atom[0] == "over"}
    return len(set(over)) == len(over) and not any(
        a[0] == "swing" and a[3] in was for a in chosen.values()
    )


def push_box_rule(before: State, chosen: dict[str, tuple[str, ...]], after: State) -> bool:
    """The box moves exactly if at least two push, all the same way, and nobody walks through that
    door.
    """
    pushes = [action[2:] for action in chosen.values() if action[0] == "push"]
    doors = {frozenset(way[1:]) for way in pushes}
    walks = {frozenset(action[2:]) for action in chosen.values() if action[0] == "go"}
    places = [{atom[2] for atom in state if atom[0] == "stands"} for state in (before, after)]
    moved = places[0] != places[1]
    return len(set(pushes)) == moved and (not moved or len(pushes) >= 2) and not doors & walks


def tray_rule(before: State, chosen: dict[str, tuple[str, ...]], after: State) -> bool:
    """Glasses slide exactly if one end is lifted or lowered alone; nobody carries alone."""
    kinds = [action[0] for action in chosen.values()]
    alone = kinds.count("lift") == 1 or kinds.count("lower") == 1
    spilled = (("spilled",) in after) == (("spilled",) in before or alone)
    return spilled and kinds.count("carry") in (0, 2)


def vans_rule(before: State, chosen: dict[str, tuple[str, ...]], after: State) -> bool:
    """A van that drives has somebody in it, before and after the step, and never two."""
    drivers = [
        [atom[1] for atom in state if atom[0] == "aboard" and atom[2] == van]
        for van, action in chosen.items()
        if action[0] == "drive"
        for state in (before, after)
    ]
    seats = [atom[2] for atom in after if atom[0] == "aboard"]
    return (
        all(len(d) == 1 for d in drivers)
        and drivers[::2] == drivers[1::2]
        and len(set(seats)) == len(seats)
    )


def lock_rule(before: State, chosen: dict[str, tuple[str, ...]], after: State) -> bool:
    """A door that is passed is held by somebody else, and the switches of one door only are held."""
    held = {robot: action[2] for robot, action in chosen.items() if action[0] == "hold"}
    passed = {robot: action[2] for robot, action in chosen.items() if action[0] == "pass"}
    return (
        len(set(held.values())) <= 1
        and set(passed.values()) <= set(held.values())
        and not held.keys() & passed
    )


def charger_rule(before: State, chosen: dict[str, tuple[str, ...]], after: State) -> bool:
    """One robot charges at a time, and no two mop one room."""
    kinds = [action[0] for action in chosen.values()]
    mopped = [action[2] for action in chosen.values() if action[0] == "mop"]
    return kinds.count("charge") <= 1 and len(set(mopped)) == len(mopped)


def elevator_rule(before: State, chosen: dict[str, tuple[str, ...]], after: State) -> bool:
    """Whoever is inside is where the elevator is; nobody enters or leaves while it moves."""
    (cabin,) = [atom[1] for atom in after if atom[0] == "stops"]
    inside = {atom[1] for atom in after if atom[0] == "inside"}
    moving = any(action[0] == "move" for action in chosen.values())
    return all(("on", walker, cabin) in after for walker in inside) and not (
        moving and len(chosen) > 1
    )


def flags_rule(before: State, chosen: dict[str, tuple[str, ...]], after: State) -> bool:
    """Every robot waits or shows one flag, and nobody marches unless some colour is shown twice."""
    shown = [atom[2] for atom in before if atom[0] == "shows"]
    marching = any(action[0] == "march" for action in chosen.values())
    ready = [atom[1] for atom in after if atom[0] in ("waits", "shows")]
    return (not marching or len(set(shown)) < len(shown)) and sorted(ready) == ["r1", "r2", "r3"]


RULES: dict[str, Callable[[State, dict[str, tuple[str, ...]], State], bool]] = {
    "handover": handover_rule,
    "two-arms": two_arms_rule,
    "push-box": push_box_rule,
    "tray": tray_rule,
    "vans": vans_rule,
    "lock": lock_rule,
    "charger": charger_rule,
    "elevator": elevator_rule,
    "flags": flags_rule,
}


@by_problem
def test_the_rules_hold_in_every_step(world: Worlds, folder: str, row: Row) -> None:
    rule, here = RULES[folder], world(folder, row["problem"])
    broken = [step for step in steps(here.loaded, here.space) if not rule(*step)]
    assert broken[:1] == []


def test_no_state_tells_who_holds_the_switch() -> None:
    """Two actions without effects, either of which will do: only remembering tells them apart."""
    row = {"language for": "three-robots", "--tasks": "its own", "options": ""}
    with pytest.raises(Inseparable):
        build_language(candidates("lock", row))
