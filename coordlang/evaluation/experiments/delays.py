# SPDX-License-Identifier: GPL-3.0-or-later
"""Delays: each robot is late with some probability a step, and goes on with its part.

Coordination languages promise that mixtures of plans done in step are plans again.  Robots that are
late are not in step.  How often does a run still end in the goal, and how late?
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from random import Random
from typing import Any

from coordlang.evaluation.lab.plots import Series, line_panels
from coordlang.evaluation.lab.recipe import (
    Figure,
    Recipe,
    Record,
    Result,
    Section,
    Settings,
    Unit,
    done,
    table,
)
from coordlang.evaluation.material.delays import DelayTrials
from coordlang.evaluation.material.languages import TITLES, language_for
from coordlang.evaluation.material.suite import OTHERS, WORLDS
from coordlang.tolerance.sampled import wilson
from coordlang.use.sentence.task_language import languages_in_tasks

#: What is said: the whole plan, or a sentence of one of these languages.
SAID = ("plan", "minimal", "flexible", "slack", "few", "silence")
#: Probabilities with which a robot is delayed in a step.
DELAYS = (0.0, 0.05, 0.1, 0.2, 0.3)
_WORLDS = ("GW1", "GWB5", *(world.name for world in OTHERS if world.name != "push-box"))
#: Whether robots wait for each other where they cannot all do their steps.
_YIELDING = {"as they come": False, "yielding": True}
#: Runs, for each of the samples that are asked for.
_RUNS = 20


def units(settings: Settings) -> list[Unit]:
    """List a unit for each world and what is said in it."""
    found = []
    for name in ("GW1", OTHERS[0].name) if settings.quick else _WORLDS:
        for said in SAID:
            parameters = {"world": name, "said": said, "runs": _RUNS * settings.samples}
            files = WORLDS[name].files
            found.append(Unit("delays", f"{name}/{said}", parameters, files, 20.0))
    return found


def run(unit: Unit, settings: Settings) -> Result:
    """Count the runs that end in the goal, and how late, for each probability, with and without."""
    parameters = unit.parameters
    said, together = parameters["said"], parameters["said"] == "plan"
    method = "minimal" if together else said
    candidates, language = language_for(WORLDS[parameters["world"]], method, settings)
    trials = DelayTrials(list(languages_in_tasks(language, candidates)), together=together)
    found: Result = {"words": None if together else len(language.words), "tasks": candidates.count}
    for name, yields in _YIELDING.items():
        counted = []
        for delay in DELAYS:
            random = Random(f"{settings.seed} {unit.key} {name} {delay}")
            sampled = trials.sample(delay, yields, parameters["runs"], random)
            counted.append([sampled.runs, sampled.well, sampled.late])
        found[name] = counted
    return found


def section(records: Sequence[Record]) -> Section:
    """Render a table and a figure for each world."""
    found = done(records)
    blocks: list[str | Figure] = [_DEFINITION]
    for name in dict.fromkeys(r.parameters["world"] for r in found):
        here = [r for r in found if r.parameters["world"] == name]
        tasks = here[0].result["tasks"]
        blocks += [
            f"{name}, {tasks:,} tasks:",
            _table(here),
            Figure(
                f"delays-{name}",
                f"Runs on {name} that end in the goal, by the probability of a delay: as they come "
                "and with robots that yield",
                partial(_figure, here),
            ),
        ]
    return Section(tuple(blocks))


_DEFINITION = """\
A task is drawn, and one of its plans, uniformly. The whole *plan* is said, or its sentence, and
then each robot draws one of the plans with this sentence by itself. They do their parts step by
step; but in each step every robot that is not done is delayed with probability *p*: it does
nothing, and goes on with its part afterwards. *As they come*: if what they do together is no joint
step, the run has failed. *Yielding*: as many as can do their steps do, and the others wait; the run
fails if all wait for ever, or the goal does not hold when all are done. Cells: runs that end in the
goal, in percent, and how many steps more than the least makespan these take on average. For
*p* = 0 a coordination language never fails. Lines in the figures: 95 % intervals (Wilson)."""


def _table(records: Sequence[Record]) -> str:
    rows = []
    for record in records:
        result, said = record.result, record.parameters["said"]
        for name in _YIELDING:
            cells = []
            for runs, well, late in result[name]:
                mean = f" (+{late / well:.2f})" if well else ""
                cells.append(f"{100 * well / runs:.1f}{mean}")
            rows.append([f"{TITLES[said]}, {name}", result["words"], *cells])
    head = ("said", "words", *(f"p = {delay:g}" for delay in DELAYS))
    return table(head, rows)


def _figure(records: Sequence[Record]) -> Any:
    panels = []
    for name in _YIELDING:
        series = []
        for record in records:
            said = record.parameters["said"]
            points = []
            for runs, well, _ in record.result[name]:
                low, high = wilson(well, runs)
                points.append((100 * well / runs, 100 * low, 100 * high))
            series.append(Series(said, TITLES[said], *zip(*points, strict=True)))
        panels.append((name, series))
    return line_panels(DELAYS, panels, "probability of a delay", "runs that end in the goal (%)")


RECIPE = Recipe("delays", "Robots that are late", units, run, section)
