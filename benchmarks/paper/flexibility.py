# SPDX-License-Identifier: GPL-3.0-or-later
"""How many plans a sentence leaves open."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any

from benchmarks.paper.plots import Histogram, histograms
from benchmarks.paper.recipe import Figure, Recipe, Record, Result, Section, Settings, Unit
from benchmarks.paper.reported import OPEN_ALL, OPEN_SEVERAL, SEVERAL
from benchmarks.paper.sentences import MOST_LISTED, Comparison, compare, comparison_units
from benchmarks.paper.suite import ROW, TITLES, method_of
from benchmarks.paper.tables import elsewhere, rounded_mean, table
from coordlang.language.sentences import Flexibility


def run(unit: Unit, settings: Settings) -> Result:
    """Measure the plans that one language leaves open, or the greedy method in many orders."""
    return compare(unit, settings, measures, _of_order)


def _of_order(found: Flexibility) -> list[float]:
    return [round(float(values.mean()), 3) for values in (found.first, found.expected)]


def measures(found: Flexibility) -> Result:
    """Return the mean numbers of open plans: after first plans, and in expectation.

    ``several``: tasks in which the first plan's sentence leaves more than one plan open.
    """
    first = found.first.round().astype(int)
    several = first[first > 1]
    return {
        "tasks": len(first),
        "plans": rounded_mean(found.plans, 4),
        "open": rounded_mean(first, 4),
        "several": len(several),
        "open_several": rounded_mean(several, 4),
        "expected": rounded_mean(found.expected, 4),
        "first": first.tolist()[:MOST_LISTED],
    }


def section(records: Sequence[Record]) -> Section:
    """Render the open plans by method, and their distribution."""
    found = Comparison.of(records)
    row = found.row
    paper = ["paper", 4, OPEN_ALL, f"{SEVERAL} of 956", OPEN_SEVERAL, None, None]
    above = [paper] if found.of_paper else []
    blocks: list[str | Figure] = [
        _DEFINITION.format(row=row),
        table("language", method_of, _COLUMNS, found.languages, above),
    ]
    if found.languages:
        alt = f"Tasks of {row} by the number of plans open"
        blocks.append(Figure("flexibility", alt, partial(_figure, found.languages)))
    shown = {"optimal plans": _COLUMNS["optimal plans"], "open": _COLUMNS["open"]}
    others = elsewhere(shown, found.others)
    return Section(blocks, _differences(found), _headlines(found.of_paper), others)


_COLUMNS = {
    "words": lambda r: r.result["words"],
    "open": lambda r: f"{r.result['open']:.1f}",
    "several": lambda r: f"{r.result['several']:,} of {r.result['tasks']:,}",
    "open there": lambda r: f"{r.result['open_several']:.1f}" if r.result["several"] else None,
    "any plan": lambda r: f"{r.result['expected']:.1f}",
    "optimal plans": lambda r: f"{r.result['plans']:.1f}",
}

_DEFINITION = """\
*Open*: the optimal plans with the sentence of the first plan. *Several*: the tasks with more than
one. *Any plan*: the expectation `sum of n_s^2 / N`. *Optimal plans*: an upper bound for every
language. Measured on {row}."""


def _headlines(of: dict[str, Result]) -> list[tuple[str, str, str, str]]:
    if not {"greedy", "minimal"} <= of.keys():
        return []
    both = of["greedy"], of["minimal"]
    plans, there = ([f"{r[what]:.1f}" for r in both] for what in ("open", "open_several"))
    number = [str(r["several"]) for r in both]
    return [
        ("plans open, all tasks", f"{OPEN_ALL}", plans[0], plans[1]),
        ("plans open where several", f"{OPEN_SEVERAL}", there[0], there[1]),
        ("tasks with several", f"{SEVERAL}", number[0], number[1]),
    ]


def _figure(records: Sequence[Record]) -> Any:
    panels = []
    for record in records:
        r, method = record.result, record.parameters["method"]
        paper = OPEN_ALL if record.parameters["world"] == ROW else None
        title = f"{TITLES[method]} ({r['words']} words)"
        panels.append(Histogram(method, title, r["first"], r["open"], paper))
    most = max(max(r.result["first"]) for r in records)
    width = max(1, -(-most // 20))
    bounds = [0.5 + width * k for k in range(-(-most // width) + 1)]
    return histograms(panels, bounds, "plans open to the listener", "tasks")


def _differences(found: Comparison) -> list[str]:
    if "greedy" not in found.of_paper or not found.orders:
        return []
    first = [measures[0] for measures in found.orders.values()]
    return [
        f"**Flexibility.** {len(first)} orders of the states leave {min(first):.1f} to "
        f"{max(first):.1f} plans open."
    ]


RECIPE = Recipe(
    "flexibility",
    "Flexibility: plans left to the listener",
    partial(comparison_units, "flexibility"),
    run,
    section,
)
