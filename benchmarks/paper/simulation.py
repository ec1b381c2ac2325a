# SPDX-License-Identifier: GPL-3.0-or-later
"""Robots with wheels in a simulator: what is promised of joint steps, looked at on a floor.

Two experiments: tasks that require coordination, with a language and without, robots keeping step
in three ways; and the detour of the motivating scenario.  Each run stands beside what the joint
model says of the same choices.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from random import Random
from typing import Any

from benchmarks.frame import markdown
from benchmarks.paper.driving import counted, drive, is_well, mission_of
from benchmarks.paper.floors import FLOORS, foreign_map, tasks_of
from benchmarks.paper.recipe import Recipe, Record, Result, Section, Settings, Unit
from benchmarks.paper.scenario import PLACE, detour, drawn_task, trading_rooms
from benchmarks.paper.suite import CORRIDOR, language_for
from benchmarks.paper.task_choices import draw_plan, first_plan, languages_in_tasks, plans_of
from coordlang.simulation.record import RunRecord, WishRecord
from coordlang.simulation.simulator import Settings as How
from coordlang.simulation.simulator import require_simulator
from coordlang.simulation.team import Agreement
from planners.system.errors import UsageError

#: The ways to keep step, which these languages need.
_PACES = ("clock", "barrier", "word")
#: How robots drive: by each way to keep step, and where no lidar stops who was about to collide.
_BLIND = "clock, no lidar"
_WAYS = {**{pace: How(step=pace) for pace in _PACES}, _BLIND: How(step="clock", lidar=False)}
#: What robots have agreed on, and how they drive then: without a sentence there is no word.
_DRIVEN: Mapping[Agreement, Sequence[str]] = {
    "sentence": tuple(_WAYS),
    "nothing": tuple(way for way in _WAYS if way != "word"),
}
#: Steps that r1 has done when the place becomes interesting.
_LEARNED = 3


def units(settings: Settings) -> list[Unit]:
    """List a unit for each floor, and for the detour."""
    floors = ("T-map, 2 robots", "handover, 2 robots") if settings.quick else tuple(FLOORS)
    found: dict[str, dict[str, Any]] = {
        name: {"world": FLOORS[name].world.name, "floor": name} for name in floors
    }
    if not settings.quick:
        found["detour"] = {"detour": PLACE}
    runs = {"runs": settings.samples}
    return [Unit("simulation", key, {**own, **runs}) for key, own in found.items()]


def run(unit: Unit, settings: Settings) -> Result:
    """Run what a unit says; ``absent`` names what there is not, if there is something."""
    try:
        require_simulator()
    except UsageError:
        return {"absent": "the package ir-sim"}
    if "floor" in unit.parameters:
        return _run_floor(unit, settings)
    return _run_detour(unit, settings)


def _run_floor(unit: Unit, settings: Settings) -> Result:
    """Draw tasks that require coordination; run each with every way to keep step."""
    floor = FLOORS[unit.parameters["floor"]]
    if floor.foreign and not foreign_map(floor).is_file():
        return {"absent": f"the map {floor.foreign}"}
    language, tasks = tasks_of(floor, settings.seed)
    plans = plans_of(tasks)
    found: dict[Agreement, dict[str, list[RunRecord]]] = {
        agreement: {way: [] for way in ways} for agreement, ways in _DRIVEN.items()
    }
    for number in range(unit.parameters["runs"]):
        random = Random(f"{settings.seed} {floor.key} {number}")
        task = random.randrange(len(tasks))
        plan = draw_plan(plans[task], random)
        for agreement, by_way in found.items():
            prepared = mission_of(tasks[task], plan, agreement)
            for way, runs in by_way.items():
                runs.append(drive(prepared, _WAYS[way], number, dict(floor.known)))
    return {
        "words": len(language.words),
        "method": "greedy" if floor.draws else "minimal",
        "tasks": len(tasks),
        **{
            agreement: {way: counted(runs) for way, runs in by_way.items()}
            for agreement, by_way in found.items()
        },
    }


def _run_detour(unit: Unit, settings: Settings) -> Result:
    """Let the place become interesting when r1 has done some steps; r2 is not informed."""
    candidates, language = language_for(CORRIDOR, "minimal", settings.seed, trading_rooms())
    used = drawn_task(list(languages_in_tasks(language, candidates)))
    first, _ = first_plan(used)
    prepared = mission_of(used, first, "sentence")
    wish = WishRecord("r1", _LEARNED, prepared.atom_at("r1", PLACE))
    found: Result = {"words": len(language.words), "known": detour(used), "steps": prepared.steps}
    for pace in _PACES:
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
    """Render the tables, and where robots with wheels and joint steps disagree."""
    found = [record for record in records if "absent" not in record.result]
    floors = [record for record in found if "floor" in record.parameters]
    blocks = [_DEFINITION]
    if floors:
        blocks += [_FLOORS, _sums(floors), _computed(floors)]
    blocks += [_detour_text(record) for record in found if "detour" in record.parameters]
    blocks += [
        f"Not run: {record.key}, for want of {record.result['absent']}."
        for record in records
        if "absent" in record.result
    ]
    return Section(blocks)


_DEFINITION = """\
Discs of radius 0.2 m with two driven wheels, in cells of 1 m: `coordlang simulate`. Wheels have
10 % noise; robots know their place up to a standard deviation of 1 cm and 0.01 rad. Lidars stop
robots for what is ahead. Every robot draws uniformly among its own choices. A *clock*, or a
*barrier* before each step or *word*, [keeps step](simulation.md#ways-to-keep-step). A run
ends *well* if all arrive in time and nobody touches anything."""

_FLOORS = """\
Tasks that require coordination, on shipped maps and a maze of others. *Sentence*: of a plan drawn
uniformly. *Nothing*: each robot follows an optimal plan of its own. *Messages* and simulated
*seconds*: of a run on average. *Nearest*: the least distance of two middles in metres; discs touch
at 0.4 m. *Joint model*: runs in which the robots' subplans, done in step, are an optimal plan.
*Agree*: runs that end well exactly if they are. The simulator does not see the doors of *handover*:
its runs with nothing agreed are no evidence."""


def _computed(floors: Sequence[Record]) -> str:
    """How many seconds of processor time a run takes on the floors."""
    ways = sum(map(len, _DRIVEN.values()))
    seconds = [record.cpu / record.parameters["runs"] / ways for record in floors]
    return f"A run takes {min(seconds):.2f} to {max(seconds):.2f} s of processor time."


def _sums(floors: Sequence[Record]) -> str:
    """How runs ended on all floors together, by what was agreed and way by way."""
    counts = ("runs", "well", "collisions", "deadlocks", "late", "mixes", "agree")
    rows = []
    for agreement, ways in _DRIVEN.items():
        for way in ways:
            results = [record.result[agreement][way] for record in floors]
            sums = {what: sum(r[what] for r in results) for what in (*counts, *_MEANS)}
            nearest = min(r["nearest"] for r in results if r["nearest"] is not None)
            means = (f"{sums[what] / sums['runs']:.1f}" for what in _MEANS)
            row = [f"{agreement}, {way}", *(sums[what] for what in counts), *means]
            rows.append([*row, f"{nearest:.2f}"])
    heads = (*counts[:-2], "joint model", "agree", *_MEANS, "nearest")
    return markdown(("all floors: agreed, step", *heads), rows)


#: What is told of a run on average.
_MEANS = ("messages", "seconds")


def _detour_text(record: Record) -> str:
    result = record.result
    counts = ("runs", "by_chance", "granted", "passed", "other_same", "well", "collisions")
    rows = [
        [
            pace,
            *(result[pace][what] for what in counts),
            *(f"{total / result[pace]['runs']:.1f}" for total in result[pace]["messages"]),
        ]
        for pace in _PACES
    ]
    head = (
        *("step", "runs", "passed without the wish", "granted", "passed", "r2 does the same"),
        *("well", "collisions", "messages without the wish", "messages"),
    )
    return (
        f"The motivating scenario. When r1 has done {_LEARNED} of {result['steps']} steps, it "
        f"learns that {PLACE} is of interest, and asks its choices for a way through it. *Without "
        "the wish*: runs with the same seed in which nothing becomes interesting. *r2 does the "
        "same*: its subactions are equal in both.\n\n" + markdown(head, rows)
    )


RECIPE = Recipe("simulation", "Simulation: robots with wheels", units, run, section)
