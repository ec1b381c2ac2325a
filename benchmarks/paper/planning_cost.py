# SPDX-License-Identifier: GPL-3.0-or-later
"""What a sentence saves the listener: nodes that A* expands with and without it."""

from __future__ import annotations

from collections.abc import Sequence
from random import Random
from statistics import fmean

import numpy as np

from benchmarks.paper.grid import cell_position
from benchmarks.paper.recipe import Recipe, Record, Result, Section, Settings, Unit
from benchmarks.paper.reported import PLANNING_RATIO
from benchmarks.paper.suite import METHODS, OTHERS, QUICK_ROW, ROW, WORLDS, language_for, method_of
from benchmarks.paper.tables import elsewhere, table
from benchmarks.paper.task_choices import languages_in_tasks
from coordlang.execution.guided_search import plan_under_sentence
from coordlang.execution.task_language import TaskLanguage
from planners.joint.model import Goal, JointModel
from planners.joint.states import TrueFacts
from planners.joint.tables import Ints, Rows
from planners.search.goals import Values, goal_facts
from planners.search.heuristics import HEURISTICS, Bound
from planners.search.state_variables import StateVariable


def units(settings: Settings) -> list[Unit]:
    """List a unit for each world, heuristic and method; on other domains some tasks are drawn."""
    row = QUICK_ROW if settings.quick else ROW
    searched: list[tuple[str, str, int | None]] = [
        (row, heuristic, None) for heuristic in ("manhattan", "relaxed", "blind")
    ]
    for world in OTHERS[: 1 if settings.quick else None]:
        searched += [(world.name, name, 3 * settings.samples) for name in ("relaxed", "blind")]
    return [
        Unit(
            "planning_cost",
            f"{world}/{heuristic}/{method}",
            {"world": world, "heuristic": heuristic, "method": method, "samples": samples},
        )
        for world, heuristic, samples in searched
        for method in METHODS
    ]


def run(unit: Unit, settings: Settings) -> Result:
    """Count the nodes that A* expands with one heuristic, with and without the sentences."""
    world = WORLDS[unit.parameters["world"]]
    candidates, language = language_for(world, unit.parameters["method"], settings.seed)
    tasks = list(languages_in_tasks(language, candidates))
    samples = unit.parameters["samples"]
    if samples is not None and samples < len(tasks):
        # The same tasks for every language and heuristic.
        tasks = Random(f"{settings.seed} {world.name}").sample(tasks, samples)
    bound = {**HEURISTICS, "manhattan": manhattan}[unit.parameters["heuristic"]]
    counted = [expansions(task, bound) for task in tasks]
    alone, pruned, bounded = (list(column) for column in zip(*counted, strict=True))
    return {
        "tasks": len(counted),
        "alone": sum(alone),
        "pruned": sum(pruned),
        "bounded": sum(bounded),
        "mean_ratio_pruned": round(fmean(a / p for a, p in zip(alone, pruned, strict=True)), 4),
        "more": sum(p > a for a, p in zip(alone, pruned, strict=True)),
    }


def expansions(language: TaskLanguage, bound: Bound) -> tuple[int, int, int]:
    """Count the nodes that A* expands in one task.

    Without a sentence; with the sentence of the plan found, only pruning, as in the paper; and with
    the number of words left as a bound, too.
    """
    alone = plan_under_sentence(language, None, bound)
    pruned = plan_under_sentence(language, alone.words, bound, count_words=False)
    bounded = plan_under_sentence(language, alone.words, bound)
    return alone.expanded, pruned.expanded, bounded.expanded


def manhattan(model: JointModel, goal: Goal, _: Sequence[StateVariable]) -> Values:
    """The paper's bound: the largest Manhattan distance of a robot from its cell in the goal.

    For grids, where a step leads to a neighbouring cell.
    """
    atoms = model.codec.facts.atoms
    cells = {fact: (atom.args[0], cell_position(atom.args[1])) for fact, atom in enumerate(atoms)}
    wanted = dict(cells[fact] for fact in goal_facts(model, goal))
    away = [
        sum(abs(own - to) for own, to in zip(cell, wanted.get(robot, cell), strict=True))
        for robot, cell in cells.values()
    ]

    def value(rows: Rows) -> Ints:
        true = TrueFacts(model.codec.facts_part(rows))
        return true.greatest(np.array(away))

    return value


def section(records: Sequence[Record]) -> Section:
    """Render the expanded nodes by heuristic and method."""

    def name(record: Record) -> str:
        return f"{record.parameters['heuristic']}, {method_of(record)}"

    row = records[0].parameters["world"]
    others = [
        record
        for record in records
        if record.parameters["world"] != row and record.parameters["heuristic"] == "relaxed"
    ]
    mine = [record for record in records if record.parameters["world"] == row]
    blocks = [
        _DEFINITION.format(row=row, ratio=PLANNING_RATIO),
        table(
            "search", name, _COLUMNS, [r for r in mine if r.parameters["heuristic"] != "relaxed"]
        ),
    ]
    columns = elsewhere({r"A\*": _COLUMNS["times fewer"]}, others)
    of = {(r.parameters["heuristic"], r.parameters["method"]): r.result for r in mine}
    greedy, least = (of.get(("manhattan", method)) for method in ("greedy", "minimal"))
    if row != ROW or greedy is None:
        return Section(blocks, elsewhere=columns)
    found = tuple(f"{_ratio(r, 'pruned'):.2f}" if r else "–" for r in (greedy, least))
    headline = ("A* with a sentence, times fewer nodes", f"{PLANNING_RATIO}", *found)
    return Section(blocks, [_difference(least)], [headline], columns)


_DEFINITION = """\
Expanded nodes of A*, for an optimal plan of each task alone, and again under the sentence of that
plan, pruned by it as in the paper. *Times fewer*: over all tasks together (paper: {ratio} on
{row}). *Per task*: the mean of the ratios. *Bounded*: the number of words that remain is also a
lower bound. *More*: tasks in which the sentence costs nodes."""


def _ratio(result: Result, how: str) -> float:
    return float(result["alone"] / max(1, result[how]))


_COLUMNS = {
    "nodes alone": lambda r: f"{r.result['alone'] / r.result['tasks']:.1f}",
    "times fewer": lambda r: f"{_ratio(r.result, 'pruned'):.2f}",
    "per task": lambda r: f"{r.result['mean_ratio_pruned']:.2f}",
    "bounded": lambda r: f"{_ratio(r.result, 'bounded'):.2f}",
    "more": lambda r: f"{r.result['more']:,}",
}


def _difference(least: Result | None) -> str:
    text = (
        "**Planning cost.** The saving depends on the order of equally good nodes, which the paper "
        "does not give; ours expands the node reached last first."
    )
    if least and least["alone"] <= 1.05 * least["pruned"]:
        text += " Minimal words prune little: their sentences leave most plans open."
    return text


RECIPE = Recipe("planning_cost", "Planning cost: nodes that A* expands", units, run, section)
