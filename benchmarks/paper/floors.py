# SPDX-License-Identifier: GPL-3.0-or-later
"""Floors: maps that robots with wheels drive on, with tasks that require coordination."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from random import Random

from gridmap import GridMap, of_cells, read_map

from benchmarks.frame import DOMAINS, SHARED, on_grid
from benchmarks.paper.grid import cell_position, is_cell, placement
from benchmarks.paper.suite import CORRIDOR, WORLDS, World, language_for
from benchmarks.paper.task_choices import languages_in_tasks
from coordlang.commands.building import build_language
from coordlang.execution.task_language import TaskLanguage
from coordlang.language.candidates import Candidates, from_listed
from coordlang.language.listed import ListedTask
from coordlang.language.words import Language
from coordlang.required.choices import Choices
from coordlang.sites.coordinates import Point
from planners.pddl import read_domain, read_problem
from planners.system.errors import BadInput, ProvedImpossible

#: Tasks of a floor whose tasks are drawn, and draws after which there are as many as there are.
TASKS, DRAWS = 10, 400
#: The folder of maps that others made.
FOREIGN = SHARED / "mapf"


@dataclass(frozen=True, slots=True)
class Floor:
    """A map and a number of robots.

    ``name``: what tables call it.  ``robots``: how many robots are on it.  ``world``: a shipped
    domain with its candidate tasks; or one whose map is used, with drawn tasks; or the grid domain,
    for a foreign map.  ``draws``: whether tasks are drawn.  ``foreign``: the name of a map in
    `FOREIGN`, read there and only there.  ``known``: coordinates of places whose names do not say
    them.
    """

    name: str
    robots: int
    world: World
    draws: bool = False
    foreign: str = ""
    known: tuple[tuple[str, Point], ...] = ()

    @property
    def key(self) -> str:
        """Its name among all floors."""
        return f"{self.name}, {self.robots} robots"


_GRID = World("grid", "grid", "gw1-2x2", "problem")
_DOORS = (
    ("west", (0.0, 1.0)),
    ("west-north", (1.0, 0.0)),
    ("west-south", (1.0, 2.0)),
    ("east-north", (2.0, 0.0)),
    ("east-south", (2.0, 2.0)),
    ("east", (3.0, 1.0)),
)
#: No task of three robots on the T-map requires coordination: nobody can pass anybody there.
FLOORS = {
    floor.key: floor
    for floor in (
        Floor("T-map", 2, World("t-map", "t-map", "problem")),
        Floor("corridor", 2, CORRIDOR),
        Floor("GWB7", 2, WORLDS["GWB7"]),
        Floor("maze 11x11", 2, _GRID, draws=True, foreign="maze-11-11.map"),
        Floor("corridor", 3, CORRIDOR, draws=True),
        Floor("GWB7", 3, WORLDS["GWB7"], draws=True),
        Floor("maze 11x11", 3, _GRID, draws=True, foreign="maze-11-11.map"),
        Floor("handover", 2, WORLDS["handover"], known=_DOORS),
    )
}


def foreign_map(floor: Floor) -> Path:
    """Return where the foreign map of a floor would be."""
    return FOREIGN / floor.foreign


def tasks_of(floor: Floor, seed: int) -> tuple[Language, list[TaskLanguage]]:
    """Return a language for the tasks of a floor, in those that require coordination.

    A floor whose tasks are drawn has a greedy language, for up to `TASKS` tasks: starts and goals
    are drawn until so many require coordination.  Others have a minimal one for all tasks of their
    world.
    """
    if floor.draws:
        candidates, language = _drawn(floor, seed)
    else:
        candidates, language = language_for(floor.world, "minimal", seed)
    requiring = {id(space): Choices(space).requires[space.starts] for space in candidates.spaces}
    every = languages_in_tasks(language, candidates)
    return language, [used for used in every if requiring[id(used.space)][used.task]]


def _drawn(floor: Floor, seed: int) -> tuple[Candidates, Language]:
    grid = _map(floor)
    random = Random(f"{seed} {floor.key}")
    found: list[ListedTask] = []
    for _ in range(DRAWS):
        start, goal = (random.sample(list(grid.cells), floor.robots) for _ in range(2))
        task = ListedTask(placement(start), placement(goal))
        if _fits(task, found[:1], grid):
            found.append(task)
        if len(found) == TASKS:
            break
    candidates = _candidates(found, grid)
    built = build_language(candidates, "greedy", seed=seed)
    if built.stopped is not None:
        raise built.stopped
    return candidates, built.language


def _fits(task: ListedTask, first: Sequence[ListedTask], grid: GridMap) -> bool:
    """Say whether a task requires coordination, and robots can get there from the first one."""
    try:
        (space,) = _candidates([task], grid).spaces
        if Choices(space).requires[space.starts[0]]:
            _candidates([*first, task], grid)  # not so where robots are on a ring
            return True
    except (ProvedImpossible, BadInput):
        pass
    return False


def _candidates(listed: Sequence[ListedTask], grid: GridMap) -> Candidates:
    """Tasks on a map, as candidates; the problem starts where the first one does."""
    starts = [text.strip("()").split()[-1] for text in listed[0].init]
    domain, problem = on_grid("floor", grid, len(starts), starts)
    return from_listed(domain, [problem], listed)


def _map(floor: Floor) -> GridMap:
    if floor.foreign:
        return read_map(foreign_map(floor))
    folder = DOMAINS / floor.world.folder
    domain = read_domain(folder / "domain.pddl")
    names = read_problem(folder / f"{floor.world.problem}.pddl", domain).objects
    return of_cells({cell_position(name) for name in names if is_cell(name)})
