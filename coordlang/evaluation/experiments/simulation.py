# SPDX-License-Identifier: GPL-3.0-or-later
"""Robots with wheels in a simulator: what is promised of joint steps, looked at on a floor.

Three experiments: tasks that require coordination, with a language and without, robots keeping step
in three ways; deliveries with a human in the way, whom only lidars see; and the detour of the
motivating scenario.  Each run stands beside what the joint model says of the same choices.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from random import Random
from typing import Any

from coordlang.evaluation.experiments.scenario import (
    CORRIDOR,
    GOAL,
    PLACE,
    START,
    detour,
    drawn_task,
    trading_rooms,
)
from coordlang.evaluation.lab.plots import Series, by_category
from coordlang.evaluation.lab.recipe import (
    Figure,
    Recipe,
    Record,
    Result,
    Section,
    Settings,
    Unit,
    done,
    percent,
    table,
)
from coordlang.evaluation.material.driving import Said, counted, drive, is_well, said, said_of
from coordlang.evaluation.material.floors import FLOORS, foreign_map, map_hash, tasks_of
from coordlang.evaluation.material.grid import task_cells
from coordlang.evaluation.material.languages import TITLES, language_for
from coordlang.evaluation.material.task_choices import TaskChoices
from coordlang.evaluation.material.warehouse import WAREHOUSES, deliveries, human_in, listed_tasks
from coordlang.tolerance.sampled import wilson
from coordlang.use.sentence.task_language import languages_in_tasks
from coordlang.use.simulation.pace import PACES
from coordlang.use.simulation.record import RunRecord, WishRecord
from coordlang.use.simulation.settings import Settings as How
from coordlang.use.simulation.simulator import require_simulator
from coordlang.use.simulation.team import Agreement
from planners.errors import UsageError
from planners.search.plans import Plans

#: How robots drive: by each way to keep step, and where no lidar stops who was about to collide.
_BLIND = "clock, no lidar"
_WAYS = {**{pace: How(step=pace) for pace in PACES}, _BLIND: How(step="clock", lidar=False)}
#: What robots have agreed on, and how they drive then: without a sentence there is no word.
_DRIVEN: Mapping[Agreement, Sequence[str]] = {
    "sentence": tuple(_WAYS),
    "nothing": tuple(way for way in _WAYS if way != "word"),
}
#: Warehouses, with the layout and the method of the language.
_WAREHOUSES = (
    ("open 3x3", "across", "minimal"),
    ("open 3x3", "along", "minimal"),
    ("open 4x4", "along", "greedy"),
    ("ring 3x4", "across", "minimal"),
)
#: Steps that r1 has done when the place becomes interesting.
_LEARNED = 3


def units(settings: Settings) -> list[Unit]:
    """List a unit for each floor and agreement, for each warehouse, and for the detour."""
    floors = ("T-map, 2 robots", "handover, 2 robots") if settings.quick else tuple(FLOORS)
    runs = settings.samples
    found = []
    for name in floors:
        floor = FLOORS[name]
        parameters = {"world": floor.world.name, "floor": name, "runs": runs}
        found.append(Unit("simulation", name, parameters, floor.world.files, 60.0))
    for name, layout, method in _WAREHOUSES[: 1 if settings.quick else None]:
        parameters = {
            "warehouse": name,
            "layout": layout,
            "method": method,
            "runs": runs,
        }
        key = f"{name}/{layout}/{method}"
        files = WAREHOUSES[name][0].files
        found.append(Unit("simulation", key, parameters, files, 50.0))
    if not settings.quick:
        parameters = {"detour": PLACE, "runs": runs}
        found.append(Unit("simulation", "detour", parameters, CORRIDOR.files, 40.0))
    return found


def run(unit: Unit, settings: Settings) -> Result:
    """Run what a unit says; ``absent`` names what there is not, if there is something."""
    try:
        require_simulator()
    except UsageError:
        return {"absent": "the package ir-sim"}
    if "floor" in unit.parameters:
        return _run_floor(unit, settings)
    if "warehouse" in unit.parameters:
        return _run_warehouse(unit, settings)
    return _run_detour(unit, settings)


def _run_floor(unit: Unit, settings: Settings) -> Result:
    """Draw tasks that require coordination; run each with every way to keep step."""
    floor = FLOORS[unit.parameters["floor"]]
    if floor.foreign and not foreign_map(floor, settings).is_file():
        return {"absent": f"the map {floor.foreign}"}
    language, tasks = tasks_of(floor, settings)
    found: dict[Agreement, dict[str, list[tuple[Said, RunRecord]]]] = {
        agreement: {way: [] for way in ways} for agreement, ways in _DRIVEN.items()
    }
    for number in range(unit.parameters["runs"]):
        random = Random(f"{settings.seed} {floor.key} {number}")
        one = said(tasks[random.randrange(len(tasks))], random)
        for agreement, by_way in found.items():
            prepared = one.mission(agreement)
            for way, runs in by_way.items():
                record = drive(prepared, _WAYS[way], number, dict(floor.known))
                runs.append((one, record))
    return {
        "words": len(language.words),
        "method": "greedy" if floor.draws else "minimal",
        "tasks": len(tasks),
        "map": map_hash(floor, settings),
        **{
            agreement: {way: counted(runs) for way, runs in by_way.items()}
            for agreement, by_way in found.items()
        },
    }


def _run_warehouse(unit: Unit, settings: Settings) -> Result:
    """Draw tasks and where a human stands; run each with the plan, and with its sentence."""
    parameters = unit.parameters
    world, rows, columns = WAREHOUSES[parameters["warehouse"]]
    listed = listed_tasks(deliveries(rows, columns, parameters["layout"]))
    candidates, language = language_for(world, parameters["method"], settings, listed)
    tasks = list(languages_in_tasks(language, candidates))
    choices = TaskChoices(tasks[0])
    corners = {cell for used in tasks for cell in task_cells(used.space, used.task)[0]}
    cells = sorted({atom.args[1] for atom in candidates.model.codec.facts.atoms} - corners)
    found: dict[str, list[list[bool]]] = {"plan": [], "sentence": []}
    touched = dict.fromkeys(found, 0)
    for number in range(parameters["runs"]):
        random = Random(f"{settings.seed} {unit.key} {number}")
        used = tasks[random.randrange(len(tasks))]
        human = random.choice(cells)
        together = Said(used, (), ()).mission("plan")
        one = said_of(used, together.agreed_plan(number))
        forbidden = human_in(candidates.model, human)
        model_says = {
            "plan": not forbidden.breaks(one.plan),
            "sentence": choices.succeeds(used.task, one.words, forbidden),
        }
        for agreement, prepared in (("plan", together), ("sentence", one.mission("sentence"))):
            record = drive(prepared, How(human=human), number)
            found[agreement].append([is_well(record), model_says[agreement]])
            touched[agreement] += record.collisions > 0
    return {
        "words": len(language.words),
        "tasks": len(tasks),
        **{
            agreement: {
                "runs": len(pairs),
                "well": sum(well for well, _ in pairs),
                "collisions": touched[agreement],
                "model": sum(says for _, says in pairs),
                "model_only": sum(says and not well for well, says in pairs),
                "floor_only": sum(well and not says for well, says in pairs),
            }
            for agreement, pairs in found.items()
        },
    }


def _run_detour(unit: Unit, settings: Settings) -> Result:
    """Let the place become interesting when r1 has done some steps; r2 is not informed."""
    candidates, language = language_for(CORRIDOR, "minimal", settings, trading_rooms())
    used = drawn_task(list(languages_in_tasks(language, candidates)))
    first = next(iter(Plans.of(used.space, used.task)))
    prepared = said_of(used, first).mission("sentence")
    wish = WishRecord("r1", _LEARNED, prepared.atom_at("r1", PLACE))
    found: Result = {"words": len(language.words), "known": detour(used), "steps": prepared.steps}
    for pace in PACES:
        pairs = [
            (drive(prepared, How(step=pace), n), drive(prepared, How(step=pace), n, wishes=[wish]))
            for n in range(unit.parameters["runs"])
        ]
        found[pace] = {
            "runs": len(pairs),
            "granted": sum(
                event.granted is True for _, with_wish in pairs for event in with_wish.events
            ),
            "by_chance": sum(_passes(without) for without, _ in pairs),
            "passed": sum(_passes(with_wish) for _, with_wish in pairs),
            "other_same": sum(
                without.subplans["r2"] == with_wish.subplans["r2"] for without, with_wish in pairs
            ),
            "well": sum(is_well(with_wish) for _, with_wish in pairs),
            "collisions": sum(with_wish.collisions > 0 for _, with_wish in pairs),
            "messages": [
                sum(one.messages for one in column) for column in zip(*pairs, strict=True)
            ],
        }
    return found


def _passes(found: RunRecord) -> bool:
    """Say whether r1 was in the place of interest."""
    return any(
        step.robot == "r1" and step.place == PLACE and step.end is not None for step in found.steps
    )


def section(records: Sequence[Record]) -> Section:
    """Render the tables, a figure, and where robots with wheels and joint steps disagree."""
    found = [record for record in done(records) if "absent" not in record.result]
    floors = [record for record in found if "floor" in record.parameters]
    warehouses = [record for record in found if "warehouse" in record.parameters]
    blocks: list[str | Figure] = [_DEFINITION]
    if floors:
        blocks += _floor_blocks(floors)
    if warehouses:
        blocks += [_HUMAN, _human_table(warehouses)]
    blocks += [_detour_text(record) for record in found if "detour" in record.parameters]
    blocks += [
        f"Not run: {record.unit.key}, for want of {record.result['absent']}."
        for record in done(records)
        if "absent" in record.result
    ]
    return Section(tuple(blocks))


_DEFINITION = """\
Discs of 0.2 m with two driven wheels, in cells of 1 m, in ir-sim: `coordlang simulate`. What their
wheels do has 10 % noise; where they believe to be is right but for a standard deviation of 1 cm and
0.01 rad. Lidars look all around; robots stop for what is ahead. Every robot has logic of its own:
it knows the task, the language and the sentence, and draws uniformly among its own choices. A
*clock* begins each joint step at the same time for all; a *barrier* opens when all have told that
they have done the step before; with barriers before *words* only, robots run freely within a word.
A run ends well if all arrive in time and nobody touches anything."""

_FLOORS = """\
Tasks that require coordination, drawn uniformly, on shipped maps and on a maze of others (read, not
shipped). *Sentence*: that of a plan drawn uniformly. *Nothing*: each robot follows an optimal plan
of its own. *No lidar*: nothing stops robots that are about to collide. *Joint model*: runs in which
the robots' own subplans, done in step, are an optimal plan: what joint steps promise. *Agree*: runs
that end well exactly if they are. *Late*: runs, and how many joint steps together, where a joint
step is a period of the clock, in which the longest way takes its time: who keeps step in another
way has some to spare. *Messages* and simulated *seconds* are of one run on average, *nearest* is
the least distance of two robots' middles in metres over all runs; discs touch at 0.4 m. The
simulator moves robots and nothing else: that they stand at different doors of *handover* is seen by
the joint model alone, so that its runs that end well are no evidence, with nothing agreed."""

_HUMAN = """\
A human stands in a cell that is no corner, drawn uniformly, and only lidars see that, up to two
cells away. The tasks are the legs of deliveries, as in the section on navigation, drawn uniformly,
with the same plan for *plan* and *sentence*, by the clock. *Floor*: runs that end well, of robots
with wheels; a robot that sees the human asks its choices (`coordlang.use` monitor) for a way that
avoids the cell. *Joint model*: the same tasks, plans and cells in joint steps, where all know of
the human before they start. In brackets 95 % intervals (Wilson). *Only there*: runs that end well
in the joint model and not on the floor; *only here*: the other way round."""


def _floor_blocks(floors: Sequence[Record]) -> list[str | Figure]:
    figure = Figure(
        "simulation",
        "Runs that end well on each floor, with a sentence by three ways to keep step, and without",
        partial(_figure, floors),
    )
    return [_FLOORS, _floor_table(floors), figure, *_ends(floors), _computed(floors)]


def _floor_table(floors: Sequence[Record]) -> str:
    rows = [
        _floor_row(record, agreement, way)
        for record in floors
        for agreement, ways in _DRIVEN.items()
        for way in ways
    ]
    runs = floors[0].parameters["runs"]
    head = (
        f"floor, agreed, step; {runs} runs each",
        "words",
        "well",
        "collisions",
        "deadlocks",
        "late",
        "messages",
        "seconds",
        "nearest",
        "joint model",
        "agree",
    )
    return table(head, rows)


def _floor_row(record: Record, agreement: Agreement, way: str) -> list[object]:
    r = record.result[agreement][way]
    return [
        f"{record.parameters['floor']}, {agreement}, {way}",
        record.result["words"] if agreement == "sentence" else None,
        r["well"],
        r["collisions"],
        r["deadlocks"],
        f"{r['late']} ({r['late_steps']})" if r["late"] else 0,
        f"{r['messages'] / r['runs']:.1f}",
        f"{r['seconds'] / r['runs']:.1f}",
        None if r["nearest"] is None else f"{r['nearest']:.2f}",
        r["mixes"],
        r["agree"],
    ]


def _computed(floors: Sequence[Record]) -> str:
    """How many seconds of processor time a run takes on each floor."""
    ways = sum(map(len, _DRIVEN.values()))
    told = (
        f"{record.parameters['floor']} {record.cpu / record.parameters['runs'] / ways:.2f}"
        for record in floors
    )
    return f"Seconds of processor time for a run, with the search for tasks: {', '.join(told)}."


def _figure(floors: Sequence[Record]) -> Any:
    names = [record.parameters["floor"] for record in floors]
    looks = {"clock": "minimal", "barrier": "separating", "word": "greedy"}

    def series(agreement: Agreement, pace: str, kind: str) -> Series:
        points = [_point(record.result[agreement][pace]) for record in floors]
        return Series(kind, f"{agreement}, {pace}", *zip(*points, strict=True))

    shown = [series("sentence", pace, looks[pace]) for pace in PACES]
    shown.append(series("nothing", "clock", "plan"))
    return by_category(names, shown, "runs that end well (%); line: 95 %")


def _point(result: Mapping[str, Any]) -> tuple[float, float, float]:
    low, high = wilson(result["well"], result["runs"])
    return 100 * result["well"] / result["runs"], 100 * low, 100 * high


def _ends(floors: Sequence[Record]) -> list[str]:
    """How runs ended, by what was agreed and way by way, with one that ended badly."""
    found = []
    for way in _WAYS:
        bad = [(record, end) for record in floors for end in record.result["sentence"][way]["bad"]]
        text = f"**With a sentence, {_KEPT[way]}**: {_summed(floors, 'sentence', way)}."
        why = f" {_WORDS}" if way == "word" and bad else ""
        found.append(text + why + (f" For instance {_told(*bad[0])}" if bad else ""))
    told = (f"{_KEPT[way]} {_summed(floors, 'nothing', way)}" for way in _DRIVEN["nothing"])
    return [*found, f"**With nothing agreed**: {'; '.join(told)}."]


def _summed(floors: Sequence[Record], agreement: Agreement, way: str) -> str:
    results = [record.result[agreement][way] for record in floors]
    runs, well, touched, agree = (
        sum(result[what] for result in results) for what in ("runs", "well", "collisions", "agree")
    )
    return (
        f"{well:,} of {runs:,} runs end well, {touched:,} with a collision; {agree:,} end as the "
        "joint model says"
    )


_WORDS = (
    "The sentence promises that mixtures of joint steps are plans, and within a word nobody is in "
    "step: who rests or turns less is ahead of the others, and meets them where they are only to "
    "be when it has gone, or the other way round."
)
_KEPT = {
    "clock": "by a common clock",
    "barrier": "with a barrier before each step",
    "word": "with a barrier before each word only",
    _BLIND: "by a common clock and without a lidar",
}


def _told(record: Record, end: Mapping[str, Any]) -> str:
    """A run that ended badly, in words."""
    where = "; ".join(
        f"{robot} has done {end['steps'][robot]} steps and is "
        + (f"in {places[0]}" if len(places) == 1 else f"on its way from {places[0]} to {places[1]}")
        for robot, places in end["places"].items()
    )
    if end["kind"] == "arrived":
        how = f"all arrive, {end['late']} joint steps late"
    elif end["kind"] == "deadlock":
        how = "nobody moves any more"
    else:
        how = f"touching {end['touched'] or 'each other'}"
    return (
        f"{record.parameters['floor']}, task `{end['task']}`, sentence `{end['sentence']}`, seed "
        f"{end['seed']}: {how}; {where}."
    )


def _human_table(warehouses: Sequence[Record]) -> str:
    rows = []
    for record in warehouses:
        asked, result = record.parameters, record.result
        for agreement in ("plan", "sentence"):
            r = result[agreement]
            rows.append(
                [
                    f"{asked['warehouse']}, {asked['layout']}, {TITLES[asked['method']]}: "
                    f"{agreement}",
                    result["words"] if agreement == "sentence" else None,
                    _share(r["well"], r["runs"]),
                    _share(r["model"], r["runs"]),
                    r["model_only"],
                    r["floor_only"],
                    r["collisions"],
                ]
            )
    runs = warehouses[0].result["plan"]["runs"]
    head = (
        f"map, layout, language: agreed; {runs} runs each",
        "words",
        "floor",
        "joint model",
        "only there",
        "only here",
        "collisions",
    )
    return table(head, rows)


def _share(successes: int, runs: int) -> str:
    low, high = wilson(successes, runs)
    return f"{percent(successes / runs)} ({100 * low:.1f} to {100 * high:.1f})"


def _detour_text(record: Record) -> str:
    result = record.result
    known = result["known"]
    rows = [
        [
            pace,
            result[pace]["runs"],
            result[pace]["by_chance"],
            result[pace]["granted"],
            result[pace]["passed"],
            result[pace]["other_same"],
            result[pace]["well"],
            result[pace]["collisions"],
            *(f"{total / result[pace]['runs']:.1f}" for total in result[pace]["messages"]),
        ]
        for pace in PACES
    ]
    head = (
        "step",
        "runs",
        "passed without the wish",
        "granted",
        "passed",
        "r2 does the same",
        "well",
        "collisions",
        "messages without the wish",
        "messages",
    )
    return (
        f"The motivating scenario: r1 drives from {START[0]} to {GOAL[0]} and r2 from {START[1]} "
        f"to {GOAL[1]} through the corridor, {result['steps']} joint steps, under the sentence "
        f"`{' '.join(known['sentence'])}` of {result['words']} words. When r1 has done {_LEARNED} "
        f"steps, {PLACE} becomes a place of interest, and only r1 learns of it: it asks its "
        "choices for a way through it. Each run stands beside the run with the same seed in which "
        "nothing becomes interesting; *r2 does the same* if its subactions are the same in "
        f"both. In joint steps {known['ways']} of the {known['parts']} parts of r1 through {PLACE} "
        "are open under the sentence, whatever r2 does.\n\n" + table(head, rows)
    )


RECIPE = Recipe("simulation", "Simulation: robots with wheels", units, run, section)
