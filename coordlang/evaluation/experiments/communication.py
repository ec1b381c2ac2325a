# SPDX-License-Identifier: GPL-3.0-or-later
"""How much shorter a sentence is than the plan that it describes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from coordlang.evaluation.lab.plots import Panel, Series, histograms, per_task
from coordlang.evaluation.lab.recipe import (
    Figure,
    Headline,
    Recipe,
    Record,
    Result,
    Section,
    Settings,
    Unit,
    percent,
    table,
)
from coordlang.evaluation.lab.statistics import rounded_mean
from coordlang.evaluation.material.languages import TITLES, language_for
from coordlang.evaluation.material.method_comparison import Comparison, comparison_units
from coordlang.evaluation.material.paper import DIFFERING, SAVING_ALL, SAVING_DIFFERING
from coordlang.evaluation.material.sentence_statistics import (
    MOST_LISTED,
    SentenceStatistics,
    candidate_statistics,
)
from coordlang.evaluation.material.state_orders import SYSTEMATIC, greedy_partitions
from coordlang.evaluation.material.suite import ROW, WORLDS
from coordlang.language.flexibility import flexibility

#: Tasks that the paper's figure shows.
SHOWN = 100


def units(settings: Settings) -> list[Unit]:
    """List a unit for each method and world, and one for the greedy method in other orders."""
    # The most flexible language takes long; `flexibility`, which starts sooner, builds it.
    return comparison_units("communication", settings, effort=1.5, flexible=1.5)


def run(unit: Unit, settings: Settings) -> Result:
    """Measure the savings of one language, or those of the greedy method in many orders."""
    world = WORLDS[unit.parameters["world"]]
    if "orders" in unit.parameters:
        candidates = world.candidates(settings.domains)
        found = {}
        for name, words in greedy_partitions(
            candidates, unit.parameters["orders"], unit.random(settings.seed)
        ):
            measured = flexibility(
                candidates.spaces, [words[space.state] for space in candidates.spaces]
            )
            shorter = measured.first_words < measured.steps + 1
            found[name] = [int(shorter.sum()), round(float(measured.first_saving.mean()), 6)]
        return {"differing_and_saving": found}
    candidates, language = language_for(world, unit.parameters["method"], settings)
    return {
        "words": len(language.words),
        **measures(list(candidate_statistics(candidates, language))),
    }


def measures(tasks: Sequence[SentenceStatistics]) -> Result:
    """Return the mean savings of the tasks' first plans, and of other plans.

    ``differing``: tasks whose first plan's sentence is shorter than its state sequence.
    """
    first = [task.saving(len(task.first)) for task in tasks]
    shorter = [saving for saving in first if saving > 0]
    return {
        "tasks": len(tasks),
        "differing": len(shorter),
        "saving_differing": rounded_mean(shorter, 6),
        "saving": rounded_mean(first, 6),
        "saving_last": rounded_mean([task.saving(len(task.last)) for task in tasks], 6),
        "saving_expected": rounded_mean([task.saving(task.expected_words) for task in tasks], 6),
        "saving_most": rounded_mean([task.saving(task.fewest_words) for task in tasks], 6),
        "saving_of_actions": rounded_mean(
            [1 - len(task.first) / task.steps for task in tasks if task.steps], 6
        ),
        "states": [task.steps + 1 for task in tasks][:MOST_LISTED],
        "first_words": [len(task.first) for task in tasks][:MOST_LISTED],
    }


def section(records: Sequence[Record]) -> Section:
    """Render the savings by method, their distribution, and those of other domains."""
    found = Comparison.of(records)
    row, mine = found.row, found.languages
    blocks: list[str | Figure] = [f"{_DEFINITION}{row}.", _table(mine)]
    if mine:
        blocks += [
            Figure(
                "communication-tasks",
                f"Plan and sentence lengths of the first {SHOWN} tasks of {row} "
                "whose sentence is shorter",
                lambda: _first_tasks(mine),
            ),
            f"The first {SHOWN} tasks whose greedy sentence is shorter than the plan, as in the "
            "paper's figure; below, the savings of all tasks.",
            Figure(
                "communication-savings",
                f"Distribution of the communication saving over the tasks of {row}, by method, "
                "with means",
                lambda: _savings(mine),
            ),
        ]
    if found.orders:
        blocks.append(_orders_text(found.orders[0]))
    if found.others:
        blocks += ["Domains that are not grids, all tasks:", _table(found.others, world=True)]
    return Section(tuple(blocks), _differences(row, mine, found.orders), _headlines(found))


def _headlines(found: Comparison) -> tuple[Headline, ...]:
    results = found.greedy_and_minimal()
    if results is None:
        return ()
    row = found.row
    greedy, least = results
    there = "saving_differing"
    return (
        (
            f"{row}: saving, all tasks",
            percent(SAVING_ALL),
            percent(greedy["saving"]),
            percent(least["saving"]),
        ),
        (
            f"{row}: saving where shorter",
            percent(SAVING_DIFFERING),
            percent(greedy[there]),
            percent(least[there]),
        ),
        (
            f"{row}: tasks with a shorter sentence",
            f"{DIFFERING}",
            f"{greedy['differing']}",
            f"{least['differing']}",
        ),
    )


_DEFINITION = f"""\
The *communication saving* of a plan is `1 - words / states`: the number of words of its sentence
relative to the number of states that it passes through, which is one more than its joint actions.
The paper's two values, {percent(SAVING_DIFFERING)} over {DIFFERING} tasks and \
{percent(SAVING_ALL)} over all 956, agree with each other only if
the tasks that do not differ save nothing, as they do when states are counted. *Sentence shorter*
are the tasks that differ; *last plan* uses each task's last plan instead of the first, *any plan*
the expectation over all plans, *shortest* the plan with the shortest sentence. Measured on """


def _table(records: Sequence[Record], world: bool = False) -> str:
    rows: list[list[object]] = []
    for record in records:
        r = record.result
        name = TITLES[record.parameters["method"]]
        rows.append(
            [
                f"{record.parameters['world']}, {name}" if world else name,
                r["words"],
                f"{r['differing']:,} of {r['tasks']:,}",
                percent(r["saving_differing"]) if r["differing"] else None,
                percent(r["saving"]),
                percent(r["saving_last"]),
                percent(r["saving_expected"]),
                percent(r["saving_most"]),
            ]
        )
    if not world and records and records[0].parameters["world"] == ROW:
        paper = [f"{DIFFERING} of 956", percent(SAVING_DIFFERING), percent(SAVING_ALL)]
        rows.insert(0, ["paper", 4, *paper, None, None, None])
    head = (
        "language",
        "words",
        "sentence shorter",
        "saving there",
        "saving, all",
        "last plan",
        "any plan",
        "shortest",
    )
    return table(head, rows)


def _orders_text(record: Record) -> str:
    found: dict[str, list[Any]] = record.result["differing_and_saving"]
    savings = sorted(saving for name, (_, saving) in found.items() if name not in SYSTEMATIC)
    named = ", ".join(f"{name} {percent(found[name][1])}" for name in SYSTEMATIC)
    return (
        f"With the states in {len(savings)} random orders, the greedy method saves "
        f"{percent(savings[0])} to {percent(savings[-1])} over all tasks (median "
        f"{percent(savings[len(savings) // 2])}); in systematic orders, {named}."
    )


def _first_tasks(records: Sequence[Record]) -> Any:
    reference = records[0].result
    differing = [
        n
        for n, (s, w) in enumerate(zip(reference["states"], reference["first_words"], strict=True))
        if w < s
    ]
    shown = differing[:SHOWN]
    series = [
        Series(
            r.parameters["method"],
            TITLES[r.parameters["method"]],
            [r.result["first_words"][n] for n in shown],
        )
        for r in records
        if r.parameters["method"] in ("greedy", "minimal")
    ]
    return per_task([reference["states"][n] for n in shown], series, "length (states; words)")


def _savings(records: Sequence[Record]) -> Any:
    panels = []
    for record in records:
        r, method = record.result, record.parameters["method"]
        savings = [100 * (1 - w / s) for s, w in zip(r["states"], r["first_words"], strict=True)]
        paper = 100 * SAVING_ALL if record.parameters["world"] == ROW else None
        panels.append(
            Panel(
                method, f"{TITLES[method]} ({r['words']} words)", savings, 100 * r["saving"], paper
            )
        )
    longest = max(records[0].result["states"])
    bounds = [100 * (k - 0.5) / longest for k in range(longest + 1)]
    return histograms(panels, bounds, "communication saving (%)", "tasks", 1)


def _differences(row: str, records: Sequence[Record], orders: Sequence[Record]) -> tuple[str, ...]:
    greedy = next((r.result for r in records if r.parameters["method"] == "greedy"), None)
    if row != ROW or greedy is None:
        return ()
    text = (
        f"**Communication.** The paper saves {percent(SAVING_ALL)} over all tasks of {ROW}, our "
        f"greedy language {percent(greedy['saving'])}. The value depends on the order in which the "
        "greedy method tries the states and on which plan is the first; the paper does not give "
        "them."
    )
    if orders:
        savings = [saving for _, saving in orders[0].result["differing_and_saving"].values()]
        inside = min(savings) <= SAVING_ALL <= max(savings)
        reached = "the paper's value is in this range" if inside else "none gives the paper's value"
        text += (
            f" {len(savings)} orders give {percent(min(savings))} to {percent(max(savings))} for "
            f"first plans; {reached}."
        )
    return (
        f"{text} The last plans in our order save {percent(greedy['saving_last'])}, the plans with "
        f"the shortest sentences {percent(greedy['saving_most'])}.",
    )


RECIPE = Recipe("communication", "Communication: plans and sentences", units, run, section)
