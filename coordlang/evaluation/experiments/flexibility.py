# SPDX-License-Identifier: GPL-3.0-or-later
"""How many plans a sentence leaves open."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from coordlang.evaluation.lab.plots import Panel, histograms
from coordlang.evaluation.lab.recipe import (
    Figure,
    Headline,
    Recipe,
    Record,
    Result,
    Section,
    Settings,
    Unit,
    table,
)
from coordlang.evaluation.lab.statistics import rounded_mean
from coordlang.evaluation.material.languages import TITLES, language_for
from coordlang.evaluation.material.method_comparison import Comparison, comparison_units
from coordlang.evaluation.material.paper import OPEN_ALL, OPEN_SEVERAL, SEVERAL
from coordlang.evaluation.material.sentence_statistics import (
    MOST_LISTED,
    SentenceStatistics,
    candidate_statistics,
)
from coordlang.evaluation.material.state_orders import SYSTEMATIC, greedy_partitions
from coordlang.evaluation.material.suite import ROW, WORLDS
from coordlang.language.flexibility import flexibility


def units(settings: Settings) -> list[Unit]:
    """List a unit for each method and world, and one for the greedy method in other orders."""
    return comparison_units("flexibility", settings, effort=2.0, flexible=60.0)


def run(unit: Unit, settings: Settings) -> Result:
    """Measure the plans that one language leaves open, or the greedy method in many orders."""
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
            found[name] = [
                round(float(measured.first.mean()), 3),
                round(float(measured.expected.mean()), 3),
            ]
        return {"open_and_expected": found}
    candidates, language = language_for(world, unit.parameters["method"], settings)
    return {
        "words": len(language.words),
        **measures(list(candidate_statistics(candidates, language))),
    }


def measures(tasks: Sequence[SentenceStatistics]) -> Result:
    """Return the mean numbers of open plans: after first plans, last plans, and in expectation.

    ``several``: tasks in which the first plan's sentence leaves more than one plan open.
    """
    first = [task.plans[task.first] for task in tasks]
    several = [number for number in first if number > 1]
    return {
        "tasks": len(tasks),
        "plans": rounded_mean([task.count for task in tasks], 4),
        "open": rounded_mean(first, 4),
        "several": len(several),
        "open_several": rounded_mean(several, 4),
        "open_last": rounded_mean([task.plans[task.last] for task in tasks], 4),
        "expected": rounded_mean([float(task.expected_open) for task in tasks], 4),
        "first": first[:MOST_LISTED],
    }


def section(records: Sequence[Record]) -> Section:
    """Render the open plans by method, their distribution, and those of other domains."""
    found = Comparison.of(records)
    row, mine = found.row, found.languages
    blocks: list[str | Figure] = [_DEFINITION.format(row=row), _table(mine)]
    if mine:
        blocks.append(
            Figure(
                "flexibility",
                f"Distribution over the tasks of {row} of the number of plans open after the first "
                "plan's sentence",
                lambda: _open(mine),
            )
        )
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
    there = "open_several"
    return (
        (
            f"{row}: plans open, all tasks",
            f"{OPEN_ALL}",
            f"{greedy['open']:.1f}",
            f"{least['open']:.1f}",
        ),
        (
            f"{row}: plans open where several",
            f"{OPEN_SEVERAL}",
            f"{greedy[there]:.1f}",
            f"{least[there]:.1f}",
        ),
        (f"{row}: tasks with several", f"{SEVERAL}", f"{greedy['several']}", f"{least['several']}"),
    )


_DEFINITION = """\
*Open* are the optimal plans with the sentence of the first plan found, as in the paper; *several*
counts the tasks with more than one. *Any plan* is the expectation when the speaker draws one of the
N optimal plans uniformly, `sum of n_s^2 / N` over the sentences s with n_s plans each: it does not
depend on the order in which plans are found. Measured on {row}; *optimal plans* is the upper bound
for every language."""


def _table(records: Sequence[Record], world: bool = False) -> str:
    rows: list[list[object]] = []
    for record in records:
        r = record.result
        name = TITLES[record.parameters["method"]]
        rows.append(
            [
                f"{record.parameters['world']}, {name}" if world else name,
                r["words"],
                f"{r['open']:.1f}",
                f"{r['several']:,} of {r['tasks']:,}",
                f"{r['open_several']:.1f}" if r["several"] else None,
                f"{r['open_last']:.1f}",
                f"{r['expected']:.1f}",
                f"{r['plans']:.1f}",
            ]
        )
    if not world and records and records[0].parameters["world"] == ROW:
        rows.insert(0, ["paper", 4, OPEN_ALL, f"{SEVERAL} of 956", OPEN_SEVERAL, None, None, None])
    head = (
        "language",
        "words",
        "open",
        "several",
        "open there",
        "last plan",
        "any plan",
        "optimal plans",
    )
    return table(head, rows)


def _orders_text(record: Record) -> str:
    found: dict[str, list[float]] = record.result["open_and_expected"]
    random = [pair for name, pair in found.items() if name not in SYSTEMATIC]
    first, expected = (sorted(column) for column in zip(*random, strict=True))
    middle = len(random) // 2
    named = ", ".join(f"{name} {found[name][0]:.1f}" for name in SYSTEMATIC)
    return (
        f"With the states in {len(random)} random orders, the greedy method leaves {first[0]:.1f} "
        f"to {first[-1]:.1f} plans open (median {first[middle]:.1f}), in expectation "
        f"{expected[0]:.1f} to {expected[-1]:.1f} (median {expected[middle]:.1f}); in systematic "
        f"orders, {named}."
    )


def _open(records: Sequence[Record]) -> Any:
    panels = []
    for record in records:
        r, method = record.result, record.parameters["method"]
        paper = OPEN_ALL if record.parameters["world"] == ROW else None
        panels.append(
            Panel(method, f"{TITLES[method]} ({r['words']} words)", r["first"], r["open"], paper)
        )
    most = max(max(r.result["first"]) for r in records)
    width = max(1, -(-most // 20))
    bounds = [0.5 + width * k for k in range(-(-most // width) + 1)]
    return histograms(panels, bounds, "plans open to the listener", "tasks", 1)


def _differences(row: str, records: Sequence[Record], orders: Sequence[Record]) -> tuple[str, ...]:
    greedy = next((r.result for r in records if r.parameters["method"] == "greedy"), None)
    if row != ROW or greedy is None:
        return ()
    spread = ""
    if orders:
        first = [pair[0] for pair in orders[0].result["open_and_expected"].values()]
        spread = (
            f" It depends on the order of the states: {len(first)} orders give {min(first):.1f} to "
            f"{max(first):.1f}."
        )
    return (
        f"**Flexibility.** The paper leaves {OPEN_ALL} plans open on average over all tasks of "
        f"{ROW} and {OPEN_SEVERAL} over {SEVERAL}, our greedy language {greedy['open']:.1f} and "
        f"{greedy['open_several']:.1f} over {greedy['several']}.{spread}",
    )


RECIPE = Recipe("flexibility", "Flexibility: plans left to the listener", units, run, section)
