# SPDX-License-Identifier: GPL-3.0-or-later
"""Delays: each robot is late with some probability a step, and goes on with its part.

Coordination languages promise that mixtures of plans done in step are plans again.  Robots that are
late are not in step.  How often does a run still end in the goal, and how late?
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from math import sqrt
from random import Random
from typing import Any

from benchmarks.frame import markdown
from benchmarks.paper.late_robots import DelayTrials, EventTrials
from benchmarks.paper.plots import Lines, Series, lines
from benchmarks.paper.recipe import Figure, Recipe, Record, Result, Section, Settings, Unit
from benchmarks.paper.suite import OTHERS, TASKS, TITLES, WORLDS, World, language_for
from benchmarks.paper.tables import by_world, rate
from benchmarks.paper.task_choices import languages_in_tasks

#: What is said: the whole plan, or a sentence of one of these languages.
SAID = ("plan", "minimal", "slack", "few", "silence", "graph", "mixed", "free")
#: Of these the ways of robots that keep no common step (`EventTrials`).
_PASSINGS = ("graph", "mixed", "free")
#: Probabilities with which a robot is delayed in a step.
DELAYS = (0.0, 0.05, 0.1, 0.2, 0.3)
_WORLDS = ("GW1", "GWB5", *(world.name for world in OTHERS if world.name != "push-box"))
#: Whether robots wait for each other where they cannot all do their steps.
_YIELDING = {"as they come": False, "yielding": True}
#: Runs, for each of the samples that are asked for.
_RUNS = 20


def units(settings: Settings) -> list[Unit]:
    """List a unit for each world and what is said in it."""
    runs = _RUNS * settings.samples
    worlds = [(name, said) for name in _WORLDS for said in SAID]
    worlds += [(world.name, said) for world in TASKS for said in _PASSINGS]
    return [
        Unit("delays", f"{name}/{said}", {"world": name, "said": said, "runs": runs})
        for name, said in worlds
        if not settings.quick or name in ("GW1", OTHERS[0].name)
    ]


def run(unit: Unit, settings: Settings) -> Result:
    """Count the runs that end in the goal, and how late, for each probability, with and without."""
    said, together = unit.parameters["said"], unit.parameters["said"] == "plan"
    method, world = "minimal" if together else said, WORLDS[unit.parameters["world"]]
    if said in _PASSINGS:
        return _without_step(world, unit, settings)
    candidates, language = language_for(world, method, settings.seed)
    trials = DelayTrials(list(languages_in_tasks(language, candidates)), together=together)
    found: Result = {"words": None if together else len(language.words), "tasks": candidates.count}
    for name, yields in _YIELDING.items():
        found[name] = []
        for delay in DELAYS:
            random = Random(f"{settings.seed} {unit.key} {name} {delay}")
            found[name].append(trials.sample(delay, yields, unit.parameters["runs"], random))
    return found


def _without_step(world: World, unit: Unit, settings: Settings) -> Result:
    said = unit.parameters["said"]
    candidates, language = language_for(world, "asynchronous", settings.seed)
    trials = EventTrials(list(languages_in_tasks(language, candidates)), said)
    found: Result = {"words": len(language.words), "tasks": candidates.count, "passings": []}
    for delay in DELAYS:
        random = Random(f"{settings.seed} {unit.parameters['world']} {delay}")
        found["passings"].append(trials.sample(delay, unit.parameters["runs"], random))
    return found


def section(records: Sequence[Record]) -> Section:
    """Render a table for one probability, and a figure for all."""
    worlds = by_world(records)
    alt = "Runs that end in the goal, by the probability of a delay"
    figure = Figure("delays", alt, partial(_figure, worlds))
    return Section([_DEFINITION, _table(worlds), _arrived(records), figure])


_DEFINITION = """\
A task and one of its plans are drawn. All robots follow this *plan*, or each draws a plan with its
sentence. In each step every robot that is not done is delayed with probability *p*. As they come,
a step that is no joint step is a failure. *Yielding*: robots that cannot do their steps wait; the
run fails if all wait for ever, or miss the goal. The figure shows all *p*; the table has p = 0.1:
runs that end in the goal in percent, as they come and yielding, and in brackets the mean
steps of the yielding ones beyond the least makespan.

The last three rows are of robots that [keep no step](asynchronous.md) and wait for passings: all
follow the plan with its dependency graph, or each draws a plan with its sentence in an asynchronous
language, or chooses what may start now of what that leaves open. After the semicolon: how often in
a run a robot that is not delayed waits, with 95 %. The last two worlds are single tasks."""


def _table(worlds: Mapping[str, Sequence[Record]]) -> str:
    cells = {
        (name, record.parameters["said"]): _cell(record)
        for name, here in worlds.items()
        for record in here
    }
    rows = [[TITLES[said], *(cells.get((name, said)) for name in worlds)] for said in SAID]
    return markdown(("said", *worlds), rows)


def _arrived(records: Sequence[Record]) -> str:
    """How many runs of robots that keep no step end in the goal, with all probabilities."""
    samples = [one for record in records for one in record.result.get("passings", [])]
    runs, well = (sum(sample[k] for sample in samples) for k in (0, 1))
    return f"Of the runs of robots that keep no step, with all *p*, {well:,} of {runs:,} arrive."


def _cell(record: Record) -> str:
    """The share of runs that end well, as they come and yielding, and how late the latter are."""
    shown = DELAYS.index(0.1)
    if "passings" in record.result:
        runs, well, late, waits, squares = record.result["passings"][shown]
        mean = waits / well
        spread = 1.96 * sqrt((squares / well - mean**2) / well)
        return f"{100 * well / runs:.1f} (+{late / well:.2f}; {mean:.3f} ± {spread:.3f})"
    (runs, well, _), (_, yielding, late) = (record.result[name][shown] for name in _YIELDING)
    mean = f" (+{late / yielding:.2f})" if yielding else ""
    return f"{100 * well / runs:.1f}, {100 * yielding / runs:.1f}{mean}"


def _figure(worlds: Mapping[str, Sequence[Record]]) -> Any:
    def series(record: Record, name: str) -> Series:
        said = record.parameters["said"]
        points = [rate(well, runs) for runs, well, _ in record.result[name]]
        return Series(said, TITLES[said], *zip(*points, strict=True))

    unit = "runs that end in the goal (%)"
    panels = [
        Lines(f"{world}, {name}", unit, [series(record, name) for record in own])
        for world, here in worlds.items()
        if (own := [record for record in here if record.parameters["said"] not in _PASSINGS])
        for name in _YIELDING
    ]
    return lines(panels, DELAYS, "probability of a delay", len(_YIELDING))


RECIPE = Recipe("delays", "Robots that are late", units, run, section)
