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
    """The pieces of work, with all their parameters."""
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
    """One piece of work, as JSON data."""
    world = WORLDS[unit.parameters["world"]]
    candidates, language = language_for(world, unit.parameters["method"], settings)
    terrain = ExpandedStates(candidates.model, language.partition(candidates.model))
    spoken = list(languages_in_tasks(language, candidates))
    samples = unit.parameters["samples"]
    if samples is not None and samples < len(spoken):
        # The same tasks for every language and heuristic.
        spoken = Random(f"{settings.seed} {world.name}").sample(spoken, samples)
    counted = [expansions(one, unit.parameters["heuristic"], terrain) for one in spoken]
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
    spoken: TaskLanguage, heuristic: str, terrain: ExpandedStates
) -> tuple[int, int, int]:
    """Nodes expanded by A* without a sentence.

    With that of the plan it finds, pruning only as in the paper; and with the words still to be
    said as a bound, too.
    """
    alone = plan_under_sentence(spoken, None, heuristic, terrain)
    pruned = plan_under_sentence(spoken, alone.words, heuristic, terrain, count_words=False)
    bounded = plan_under_sentence(spoken, alone.words, heuristic, terrain)
    return alone.expanded, pruned.expanded, bounded.expanded


def section(records: Sequence[Record]) -> Section:
    """The results, as this section of the page."""
    found = done(records)
    row = records[0].unit.parameters["world"]
    mine = [r for r in found if r.unit.parameters["world"] == row]
    others = [r for r in found if r.unit.parameters["world"] != row]
    blocks: list[str | Figure] = [_DEFINITION.format(row=row, ratio=PLANNING_RATIO), _table(mine)]
    if mine:
        blocks.append(
            Figure(
                "planning-cost",
                f"How many times fewer nodes A* expands with a sentence on {row}, by heuristic "
                "and language",
                lambda: _drawn(mine),
            )
        )
    if others:
        blocks += [
            "Worlds that are no grids, where the Manhattan distance says nothing; tasks drawn at "
            "random:",
            _table(others, world=True),
        ]
    return Section(tuple(blocks), _differences(row, mine), _headlines(row, mine))


def _headlines(row: str, records: Sequence[Record]) -> tuple[Headline, ...]:
    of = {
        r.unit.parameters["method"]: r.result
        for r in records
        if r.unit.parameters["heuristic"] == "manhattan"
    }
    if row != ROW or not {"greedy", "minimal"} <= of.keys():
        return ()
    greedy, least = (
        f"{of[method]['alone'] / max(1, of[method]['pruned']):.2f}"
        for method in ("greedy", "minimal")
    )
    return ((f"{row}: A* with a sentence, times fewer nodes", f"{PLANNING_RATIO}", greedy, least),)


_DEFINITION = """\
A* looks for an optimal plan of each task, alone and then again under the sentence of the plan that it found. A node is
expanded when its joint steps are looked at. *Pruned* is the paper's search: what does not fit the sentence is cut off.
*Bounded* also counts the words that are still to be said, each of which takes a step at least. *Times fewer* compares all
nodes over all tasks (paper: {ratio} times on {row}); *per task* is the mean of the tasks' own ratios."""


def _table(records: Sequence[Record], world: bool = False) -> str:
    rows = []
    for record in records:
        r, asked = record.result, record.unit.parameters
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


def _drawn(records: Sequence[Record]) -> Any:
    heuristics = list(dict.fromkeys(r.unit.parameters["heuristic"] for r in records))
    ratio = {
        (r.unit.parameters["heuristic"], r.unit.parameters["method"]): r.result["alone"]
        / max(1, r.result["pruned"])
        for r in records
    }
    paper = Series(
        "paper", "paper", [PLANNING_RATIO if h == "manhattan" else None for h in heuristics]
    )
    series = [Series(m, TITLES[m], [ratio.get((h, m)) for h in heuristics]) for m in METHODS]
    return by_category(heuristics, [paper, *series], "times fewer nodes (pruned)", level=1)


def _differences(row: str, records: Sequence[Record]) -> tuple[str, ...]:
    of = {(r.unit.parameters["heuristic"], r.unit.parameters["method"]): r.result for r in records}
    if row != ROW or ("manhattan", "greedy") not in of:
        return ()
    greedy = of["manhattan", "greedy"]
    text = (
        f"**Planning cost.** The paper's A* expands {PLANNING_RATIO} times fewer nodes with a "
        f"sentence on {ROW}, ours "
        f"{greedy['alone'] / greedy['pruned']:.2f} times with the Manhattan distance and greedy "
        "words. What can be saved "
        "depends on how ties among equally good nodes are broken, and the paper's way is not "
        "known: ours goes on from the "
        f"node that was reached last, and alone expands {greedy['alone'] / greedy['tasks']:.1f} "
        "nodes a task."
    )
    least = of.get(("manhattan", "minimal"))
    if least and least["alone"] <= 1.05 * least["pruned"]:
        text += (
            " Minimal words cut off little: their sentences leave most plans open, which is "
            "what they are for."
        )
    return (text,)


RECIPE = Recipe("planning_cost", "Planning cost: nodes that A* expands", units, run, section)
