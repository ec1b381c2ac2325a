# SPDX-License-Identifier: GPL-3.0-or-later
"""The motivating scenario: a place of interest appears, and one robot makes a detour.

On the map `corridor` two robots exchange rooms through a corridor with one passing place.  They
have agreed on the sentence of the first optimal plan.  Then a place becomes interesting that is not
on the path of robot 1.  If one of its choices under the sentence leads there, it takes it; robot 2
does its own part without being informed, and both are still on an optimal plan.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from functools import partial
from itertools import groupby, product
from random import Random
from typing import TYPE_CHECKING, Any

from benchmarks.paper.grid import cell_position, entered_cells, placement, task_cells
from benchmarks.paper.plots import drawing
from benchmarks.paper.recipe import Figure, Recipe, Record, Result, Section, Settings, Unit
from benchmarks.paper.suite import CORRIDOR, METHODS, OTHERS, WORLDS, language_for, method_of
from benchmarks.paper.tables import elsewhere, in_percent, table
from benchmarks.paper.task_choices import (
    choices_under,
    first_plan,
    languages_in_tasks,
    optimal_choices,
)
from coordlang.execution.automaton import Automaton
from coordlang.execution.task_language import TaskLanguage
from coordlang.language.listed import ListedTask
from planners.joint.model import JointModel
from planners.search.plans import Plan, Plans

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: One robot's part of a plan, as label numbers.
Part = tuple[int, ...]

#: The cells of the two rooms.
ROOMS = tuple(
    tuple(f"c{row}-{column}" for row in range(3) for column in columns)
    for columns in ((0, 1), (7, 8))
)
#: The scenario that is drawn: where robots 1 and 2 start and go to, and the place that becomes
#: interesting.
START, GOAL, PLACE = ("c0-0", "c0-8"), ("c2-8", "c2-0"), "c2-7"


def trading_rooms() -> tuple[ListedTask, ...]:
    """Return the candidate tasks of the corridor.

    Robot 1 moves from any cell of the left room to any of the right one, robot 2 the other way.
    """
    left, right = ROOMS
    return tuple(
        ListedTask(placement(start), placement(goal))
        for start in product(left, right)
        for goal in product(right, left)
    )


def units(settings: Settings) -> list[Unit]:
    """List a unit for each method on the corridor, and for each other world and method."""
    found: list[tuple[str, str, int | None]] = [
        ("corridor", m, None) for m in (METHODS[:1] if settings.quick else METHODS)
    ]
    for world in OTHERS[: 1 if settings.quick else None]:
        found += [(world.name, method, 3 * settings.samples) for method in METHODS]
    return [
        Unit("scenario", f"{world}/{m}", {"world": world, "method": m, "samples": samples})
        for world, m, samples in found
    ]


def run(unit: Unit, settings: Settings) -> Result:
    """Measure the freedom of the robots under a language; on the corridor, also the detour."""
    world, samples = unit.parameters["world"], unit.parameters["samples"]
    listed = trading_rooms() if world == "corridor" else ()
    method, seed = unit.parameters["method"], settings.seed
    candidates, language = language_for(WORLDS[world], method, seed, listed)
    tasks = list(languages_in_tasks(language, candidates))
    result: Result = {"words": len(language.words)}
    if listed:
        result["drawn"] = detour(drawn_task(tasks))
    elif samples < len(tasks):
        tasks = Random(f"{settings.seed} {world}").sample(tasks, samples)
    return result | {"tasks": len(tasks), **freedom(tasks)}


def drawn_task(tasks: Sequence[TaskLanguage]) -> TaskLanguage:
    """Return the task from `START` to `GOAL`."""
    return next(one for one in tasks if task_cells(one.space, one.task) == (START, GOAL))


def freedom(tasks: Sequence[TaskLanguage]) -> dict[str, int]:
    """Count the options of robots beyond their parts of the first plans, over tasks and robots.

    An option is a cell that a robot enters or, where there are no cells, a subaction.

    ``plan``: options in the robots' parts of the agreed plans; ``sentence``: further
    ones in their choices under the plans' sentences; ``optimal``: further ones in all optimal plans
    of the tasks, which would take another agreement.
    """
    plan = sentence = optimal = 0
    for one in tasks:
        first, words = first_plan(one)
        for robot, choices in enumerate(choices_under(one, words)):
            agreed = _options(one.model, robot, {step[robot] for step in first})
            every = optimal_choices(one, robot)
            plan += len(agreed)
            sentence += len(_options(one.model, robot, choices.labels) - agreed)
            optimal += len(_options(one.model, robot, every.labels) - agreed)
    return {"plan": plan, "sentence": sentence, "optimal": optimal}


def _options(model: JointModel, robot: int, labels: set[int]) -> set[str]:
    """The cells that labels lead to, or the texts of those that lead to none."""
    entered = entered_cells(model, robot)
    found = set()
    for label in labels:
        text = model.label_text(robot, label)
        if text is not None:
            found.add(entered[label] or text)
    return found


def detour(language: TaskLanguage) -> Result:
    """Return what happens when `PLACE` becomes interesting: the agreed parts and r1's detour."""
    plan, words = first_plan(language)
    model, plans = language.model, Plans.of(language.space, language.task)
    choices = choices_under(language, words)[0]
    own = _through_place(model, subplans(choices))
    # All parts of robot 1 through the place on some optimal plan, and those that are optimal
    # together with robot 2's agreed part.
    parts = _through_place(model, {tuple(step[0] for step in other) for other in plans})
    fitting = [part for part in parts if plans.rank(_mixed(part, plan)) is not None]
    found: Result = {
        "sentence": [language.partition.words[word] for word in words],
        "agreed": [_cells(model, plan, robot) for robot in range(2)],
        "ways": len(own),
        "detour": None,
        "plans": plans.count,
        "parts": len(parts),
        "parts_that_fit": len(fitting),
    }
    if own:
        agreed = [step[0] for step in plan]
        executed = _mixed(_most_similar(own, agreed), plan)
        found["detour"] = _cells(model, executed, 0)
        found["optimal"] = plans.rank(executed) is not None
    return found


def _through_place(model: JointModel, parts: Iterable[Part]) -> list[Part]:
    """The parts of robot 1 on which it enters `PLACE`."""
    entered = entered_cells(model, 0)
    return [part for part in parts if any(entered[label] == PLACE for label in part)]


def subplans(automaton: Automaton) -> list[Part]:
    """Return all subplans that an automaton accepts, as label numbers."""
    found: list[tuple[Part, int]] = [((), 0)]
    for _ in range(automaton.steps):
        found = [
            ((*part, label), to)
            for part, state in found
            for label, to in automaton.moves[state].items()
        ]
    return [part for part, _ in found]


def _most_similar(parts: Sequence[Part], agreed: Sequence[int]) -> Part:
    """The part with most labels of the agreed one; the first of these in lexicographic order."""
    return max(
        sorted(parts), key=lambda part: sum(a == b for a, b in zip(part, agreed, strict=True))
    )


def _mixed(part: Part, plan: Plan) -> Plan:
    """The plan with another part of robot 1."""
    return tuple((label, *step[1:]) for label, step in zip(part, plan, strict=True))


def _cells(model: JointModel, plan: Plan, robot: int) -> list[str]:
    """The cells of a robot, step by step."""
    entered = entered_cells(model, robot)
    cells = [START[robot]]
    for step in plan:
        cells.append(entered[step[robot]] or cells[-1])
    return cells


def section(records: Sequence[Record]) -> Section:
    """Render the detour, and the freedom of the robots on all worlds."""
    blocks: list[str | Figure] = [_DEFINITION]
    shown = [r for r in records if "drawn" in r.result and r.result["drawn"]["detour"]]
    if shown:
        figure = Figure("scenario", _ALT, partial(_figure, shown[-1]))
        blocks += [figure, _detour_text(shown[-1])]
    mine = [record for record in records if record.parameters["world"] == CORRIDOR.name]
    others = [record for record in records if record.parameters["world"] != CORRIDOR.name]
    blocks += [_FREEDOM, table("language", method_of, _COLUMNS, mine)]
    return Section(blocks, elsewhere=elsewhere({"share": _COLUMNS["share"]}, others))


_DEFINITION = f"""\
Two robots exchange rooms on the map `domains/corridor`: r1 from {START[0]} to {GOAL[0]}, r2 from
{START[1]} to {GOAL[1]}. The robots have agreed on the sentence of the first plan. Then {PLACE}
becomes a place of interest. r1 finds a path through it among its own choices. r2 is not informed
and does not change its part; no robot is late."""

_ALT = "The agreed plan in the corridor, and below it the detour of r1"

_FREEDOM = """\
Cells in the agreed plan; further ones under the sentence, without communication; further ones in
all optimal plans. Sums over a task's robots; *share* in percent:"""


def _detour_text(record: Record) -> str:
    r = record.result["drawn"]
    return (
        f"The language is {method_of(record)} ({record.result['words']} words), "
        f"the sentence `{' '.join(r['sentence'])}`. On the task's {r['plans']:,} optimal plans r1 "
        f"can pass {PLACE} in {r['parts']} ways; {r['parts_that_fit']} of them are optimal with "
        f"what r2 does. The sentence leaves r1 {r['ways']} of them, whatever r2 selects."
    )


_COLUMNS = {
    "words": lambda r: r.result["words"],
    "tasks": lambda r: r.result["tasks"],
    "in the plan": lambda r: f"{r.result['plan'] / r.result['tasks']:.2f}",
    "more under the sentence": lambda r: f"{r.result['sentence'] / r.result['tasks']:.2f}",
    "more in optimal plans": lambda r: f"{r.result['optimal'] / r.result['tasks']:.2f}",
    "share": lambda r: (
        in_percent(r.result["sentence"] / r.result["optimal"]) if r.result["optimal"] else None
    ),
}


def _figure(record: Record) -> Any:
    r = record.result["drawn"]
    agreed = dict(zip(("r1", "r2"), r["agreed"], strict=True))
    executed = {**agreed, "r1": r["detour"]}
    cells = {*ROOMS[0], *ROOMS[1], *r["detour"], *r["agreed"][0], *r["agreed"][1]}
    after = f"executed: {PLACE} has become interesting, r1 passes it, r2 is not informed"
    with drawing(8.2, 6.4, rows=2) as (figure, [above, below]):
        _draw_map(above, cells, agreed, None, "agreed: the first optimal plan")
        _draw_map(below, cells, executed, PLACE, after)
        return figure


#: For each robot a colour, distinguishable with every kind of colour vision, and by how much its
#: path is shifted from the middle of a cell.
_ROBOTS = {"r1": ("#0072B2", -0.13), "r2": ("#D55E00", 0.13)}


def _draw_map(
    axes: Axes,
    cells: Collection[str],
    paths: Mapping[str, Sequence[str]],
    star: str | None,
    title: str,
) -> None:
    """Draw cells, each robot's path (a cell for each time from 0), and a star in one cell."""
    from matplotlib.patches import Rectangle

    for row, column in map(cell_position, sorted(cells)):
        corner = (column - 0.5, row - 0.5)
        axes.add_patch(Rectangle(corner, 1, 1, facecolor="#f4f4f4", edgecolor="#bbbbbb"))
    if star is not None:
        row, column = cell_position(star)
        axes.plot(column + 0.33, row - 0.3, "*", markersize=15, color="#E69F00", zorder=5)
    for robot, path in paths.items():
        _draw_path(axes, robot, path)
    axes.set_title(title, fontsize=10, loc="left")
    axes.set_aspect("equal")
    axes.autoscale_view()
    axes.invert_yaxis()
    axes.set_axis_off()


def _draw_path(axes: Axes, robot: str, path: Sequence[str]) -> None:
    """Draw a line from the robot's name to a hollow circle, with the times at each cell."""
    hue, shift = _ROBOTS[robot]
    points = [(column + shift, row + shift) for row, column in map(cell_position, path)]
    axes.plot(*zip(*points, strict=True), color=hue, linewidth=2, zorder=3)
    style: Any = {"fontsize": 7.5, "ha": "center", "va": "center", "zorder": 7}
    round_ = {"boxstyle": "circle", "edgecolor": hue}
    axes.annotate(robot, points[0], color="white", bbox={**round_, "facecolor": hue}, **style)
    for cell, times in _times(path).items():
        row, column = cell_position(cell)
        at, box = (column + 1.7 * shift, row + 2.8 * shift), {"facecolor": "#f4f4f4", "pad": 0.6}
        if cell == path[-1]:
            at, box = points[-1], {**round_, "facecolor": "white"}
        axes.annotate(", ".join(times), at, color=hue, bbox={"edgecolor": "none", **box}, **style)


def _times(path: Sequence[str]) -> dict[str, list[str]]:
    """The times at which a robot is at each of its cells: ``3``, or ``4–5`` where it waits."""
    found: dict[str, list[str]] = {}
    time = 0
    for cell, stay in groupby(path):
        last = time + len(list(stay)) - 1
        found.setdefault(cell, []).append(f"{time}" if last == time else f"{time}–{last}")
        time = last + 1
    return found


RECIPE = Recipe(
    "scenario", "Motivating scenario: a detour without communication", units, run, section
)
