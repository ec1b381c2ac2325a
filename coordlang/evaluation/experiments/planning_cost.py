# SPDX-License-Identifier: GPL-3.0-or-later
"""What a sentence saves the listener: nodes that A* expands with and without it."""

from __future__ import annotations

from collections.abc import Sequence
from random import Random
from statistics import fmean
from typing import Any

from coordlang.evaluation.lab.plots import Series, by_category
from coordlang.evaluation.lab.recipe import (
    Figure,
    Headline,
    Recipe,
    Record,
    Result,
    Section,
    Settings,
    Unit,
    done,
    table,
)
from coordlang.evaluation.material.languages import TITLES, language_for
from coordlang.evaluation.material.paper import PLANNING_RATIO
from coordlang.evaluation.material.suite import OTHERS, QUICK_ROW, ROW, WORLDS
from coordlang.use.sentence.guided_search import ExpandedStates, plan_under_sentence
from coordlang.use.sentence.task_language import TaskLanguage, languages_in_tasks

METHODS = ("greedy", "separating", "minimal")


def units(settings: Settings) -> list[Unit]:
    """List a unit for each world, heuristic and method."""
    row = QUICK_ROW if settings.quick else ROW
    found = []
    for heuristic in ("manhattan", "relaxed", "blind"):
        found += [_unit(row, heuristic, method, None) for method in METHODS]
    for world in OTHERS[: 1 if settings.quick else None]:
        for heuristic in ("relaxed", "blind"):
            found += [
                _unit(world.name, heuristic, method, 3 * settings.samples) for method in METHODS
            ]
    return found


def _unit(world: str, heuristic: str, method: str, samples: int | None) -> Unit:
    """``samples`` tasks drawn at random; None: all."""
    parameters = {"world": world, "heuristic": heuristic, "method": method, "samples": samples}
    effort = 20.0 if heuristic == "relaxed" else 10.0
    return Unit(
        "planning_cost", f"{world}/{heuristic}/{method}", parameters, WORLDS[world].files, effort
    )


def run(unit: Unit, settings: Settings) -> Result:
    """Count the nodes that A* expands with one heuristic, with and without the sentences."""
    world = WORLDS[unit.parameters["world"]]
    candidates, language = language_for(world, unit.parameters["method"], settings)
    states = ExpandedStates(candidates.model, language.partition(candidates.model))
    tasks = list(languages_in_tasks(language, candidates))
    samples = unit.parameters["samples"]
    if samples is not None and samples < len(tasks):
        # The same tasks for every language and heuristic.
        tasks = Random(f"{settings.seed} {world.name}").sample(tasks, samples)
    counted = [expansions(task, unit.parameters["heuristic"], states) for task in tasks]
    alone, pruned, bounded = (list(column) for column in zip(*counted, strict=True))
    return {
        "tasks": len(counted),
        "alone": sum(alone),
        "pruned": sum(pruned),
        "bounded": sum(bounded),
        "mean_ratio_pruned": round(fmean(a / p for a, p in zip(alone, pruned, strict=True)), 4),
        "mean_ratio_bounded": round(fmean(a / b for a, b in zip(alone, bounded, strict=True)), 4),
        "fewer": sum(p < a for a, p in zip(alone, pruned, strict=True)),
        "more": sum(p > a for a, p in zip(alone, pruned, strict=True)),
    }


def expansions(
    language: TaskLanguage, heuristic: str, states: ExpandedStates
) -> tuple[int, int, int]:
    """Count the nodes that A* expands in one task.

    Returns
    -------
    tuple of int
        Without a sentence; with the sentence of the plan found, only pruning, as in the paper; and
        with the number of remaining words as a bound, too.
    """
    alone = plan_under_sentence(language, None, heuristic, states)
    pruned = plan_under_sentence(language, alone.words, heuristic, states, count_words=False)
    bounded = plan_under_sentence(language, alone.words, heuristic, states)
    return alone.expanded, pruned.expanded, bounded.expanded


def section(records: Sequence[Record]) -> Section:
    """Render the expanded nodes by heuristic and method, and those on other domains."""
    found = done(records)
    row = records[0].parameters["world"]
    mine = [r for r in found if r.parameters["world"] == row]
    others = [r for r in found if r.parameters["world"] != row]
    blocks: list[str | Figure] = [_DEFINITION.format(row=row, ratio=PLANNING_RATIO), _table(mine)]
    if mine:
        blocks.append(
            Figure(
                "planning-cost",
                f"How many times fewer nodes A* expands with a sentence on {row}, by heuristic "
                "and language",
                lambda: _figure(mine),
            )
        )
    if others:
        blocks += [
            "Domains that are not grids, without a Manhattan distance; tasks drawn at random:",
            _table(others, world=True),
        ]
    return Section(tuple(blocks), _differences(row, mine), _headlines(row, mine))


def _headlines(row: str, records: Sequence[Record]) -> tuple[Headline, ...]:
    of = {
        r.parameters["method"]: r.result
        for r in records
        if r.parameters["heuristic"] == "manhattan"
    }
    if row != ROW or not {"greedy", "minimal"} <= of.keys():
        return ()
    greedy, least = (
        f"{of[method]['alone'] / max(1, of[method]['pruned']):.2f}"
        for method in ("greedy", "minimal")
    )
    return ((f"{row}: A* with a sentence, times fewer nodes", f"{PLANNING_RATIO}", greedy, least),)


_DEFINITION = """\
A* searches an optimal plan of each task without a sentence, and then again under the sentence of
the plan that it found. A node is expanded when its successors are generated. *Pruned* is the
paper's search: what does not fit the sentence is pruned. *Bounded* also uses the number of words
that remain as a lower bound, since each takes at least one step. *Times fewer* compares all
nodes over all tasks (paper: {ratio} times on {row}); *per task* is the mean of the tasks' own
ratios."""


def _table(records: Sequence[Record], world: bool = False) -> str:
    rows = []
    for record in records:
        r, asked = record.result, record.parameters
        name = f"{asked['heuristic']}, {TITLES[asked['method']]}"
        rows.append(
            [
                f"{asked['world']}, {name}" if world else name,
                r["tasks"],
                f"{r['alone'] / r['tasks']:.1f}",
                f"{r['pruned'] / r['tasks']:.1f}",
                f"{r['bounded'] / r['tasks']:.1f}",
                f"{r['alone'] / max(1, r['pruned']):.2f}",
                f"{r['mean_ratio_pruned']:.2f}",
                f"{r['alone'] / max(1, r['bounded']):.2f}",
                f"{r['more']:,}",
            ]
        )
    head = (
        "search",
        "tasks",
        "nodes alone",
        "pruned",
        "bounded",
        "times fewer",
        "per task",
        "bounded: times fewer",
        "tasks with more",
    )
    return table(head, rows)


def _figure(records: Sequence[Record]) -> Any:
    heuristics = list(dict.fromkeys(r.parameters["heuristic"] for r in records))
    ratio = {
        (r.parameters["heuristic"], r.parameters["method"]): r.result["alone"]
        / max(1, r.result["pruned"])
        for r in records
    }
    paper = Series(
        "paper", "paper", [PLANNING_RATIO if h == "manhattan" else None for h in heuristics]
    )
    series = [Series(m, TITLES[m], [ratio.get((h, m)) for h in heuristics]) for m in METHODS]
    return by_category(heuristics, [paper, *series], "times fewer nodes (pruned)", level=1)


def _differences(row: str, records: Sequence[Record]) -> tuple[str, ...]:
    of = {(r.parameters["heuristic"], r.parameters["method"]): r.result for r in records}
    if row != ROW or ("manhattan", "greedy") not in of:
        return ()
    greedy = of["manhattan", "greedy"]
    text = (
        f"**Planning cost.** The paper's A* expands {PLANNING_RATIO} times fewer nodes with a "
        f"sentence on {ROW}, ours {greedy['alone'] / greedy['pruned']:.2f} times with the "
        "Manhattan distance and greedy words. The possible saving depends on how ties between "
        "equally good nodes are broken, which the paper does not say: ours expands the node that "
        "was reached last first, and without a sentence "
        f"{greedy['alone'] / greedy['tasks']:.1f} nodes a task."
    )
    least = of.get(("manhattan", "minimal"))
    if least and least["alone"] <= 1.05 * least["pruned"]:
        text += " Minimal words prune little, because their sentences leave most plans open."
    return (text,)


RECIPE = Recipe("planning_cost", "Planning cost: nodes that A* expands", units, run, section)
