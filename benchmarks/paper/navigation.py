# SPDX-License-Identifier: GPL-3.0-or-later
"""Robust navigation: a human stands in the way, detected only once execution has started.

Robots deliver in a warehouse (`benchmarks.paper.warehouse`).  For both tasks of a delivery they
agree on plans or sentences beforehand.  Then a human is detected in a random cell that is no
corner, and stays there.  A plan fails if any robot would enter that cell.  Under a sentence each
robot selects among its own choices.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from random import Random

from benchmarks.frame import markdown
from benchmarks.paper.disruptions import subaction_trials, warehouse_trials
from benchmarks.paper.recipe import Recipe, Record, Result, Section, Settings, Unit
from benchmarks.paper.suite import METHODS, OTHERS, WORLDS, language_for, method_of
from benchmarks.paper.tables import Columns, elsewhere, in_percent, share_of_runs
from benchmarks.paper.warehouse import LAYOUTS, WAREHOUSES, deliveries, listed_tasks

#: Languages that take more than minutes to build: an unfinished one would depend on the machine.
UNFINISHED = {
    *((f"open {n}", layout, m) for n in ("4x4", "5x5") for layout in LAYOUTS for m in METHODS[1:]),
    *((f"ring {size}", "along", "minimal") for size in ("3x4", "3x5", "4x4")),
    ("ring 3x5", "across", "minimal"),
}


def units(settings: Settings) -> list[Unit]:
    """List a unit for each warehouse, layout and method, and for each other world and method."""
    maps = ("open 3x3", "ring 3x4") if settings.quick else tuple(WAREHOUSES)
    samples = {"samples": settings.samples}
    found = [
        Unit(
            "navigation",
            f"{name}/{layout}/{method}",
            {"warehouse": name, "layout": layout, "method": method, **samples},
        )
        for name in maps
        for layout in LAYOUTS
        for method in METHODS
        if (name, layout, method) not in UNFINISHED
    ]
    for world in OTHERS[: 1 if settings.quick else None]:
        for method in METHODS:
            parameters = {"world": world.name, "method": method, **samples}
            found.append(Unit("navigation", f"{world.name}/{method}", parameters))
    return found


def run(unit: Unit, settings: Settings) -> Result:
    """Measure the success rates of plans and sentences, exactly and in random trials."""
    asked, seed = unit.parameters, settings.seed
    if "world" in asked:
        candidates, language = language_for(WORLDS[asked["world"]], asked["method"], seed)
        trials = subaction_trials(candidates, language)
    else:
        world, rows, columns = WAREHOUSES[asked["warehouse"]]
        every = deliveries(rows, columns, asked["layout"])
        candidates, language = language_for(world, asked["method"], seed, listed_tasks(every))
        trials = warehouse_trials(candidates, language, every)
    # The same draws for every language.
    random = Random(f"{seed} {unit.key.rsplit('/', 1)[0]}")
    return {
        "words": len(language.words),
        "trials": len(trials.trials),
        "exact": trials.exact(),
        "many": trials.sample(100 * settings.samples, random),
    }


def section(records: Sequence[Record]) -> Section:
    """Render the success rates by map and method."""
    mine = [record for record in records if "warehouse" in record.parameters]
    others = [record for record in records if "world" in record.parameters]
    blocks = [_DEFINITION]
    by_layout = {n: [r for r in mine if r.parameters["layout"] == n] for n in LAYOUTS}
    if mine:
        blocks.append(_table(by_layout))
    columns: Columns = {
        "robust": lambda r: f"{_exact('plan', r)}, {_exact('sentence', r)}",
    }
    return Section(blocks, _differences(mine), elsewhere=elsewhere(columns, others))


_DEFINITION = """\
Two robots start in random corners: storage S1 and S2 (left), dispatch D1 and D2 (right). Robot i
goes to Si and then to Di, or the other way round. Once the robots have agreed, a human appears in a
random cell that is no corner. An agreed *plan* fails if a robot would enter that cell, its
*sentence* if some robot has no choice of its own that avoids it. Cells: successes, percent of all
cases; with a 95 % interval (Wilson): of 10,000 runs. Our maps are full rectangles (*open*) or their
border (*ring*). *Across*: D1 is opposite S1; *along*: on the same side."""


def _table(by_layout: Mapping[str, Sequence[Record]]) -> str:
    cells: dict[str, dict[str, list[object]]] = {}
    for layout, records in by_layout.items():
        for record in records:
            if record.parameters["method"] == "separating":
                continue  # the page compares most words with fewest
            name = f"{record.parameters['warehouse']}, {method_of(record)}"
            rates = (_exact(what, record) for what in ("plan", "sentence"))
            cells.setdefault(name, {})[layout] = [record.result["words"], *rates]
    heads = (f"{n}: {what}" for n in by_layout for what in ("words", "plan", "sentence"))
    rows = [
        [name, *(cell for layout in by_layout for cell in of.get(layout, [None] * 3))]
        for name, of in cells.items()
    ]
    return markdown(("map, language", *heads), rows)


def _exact(what: str, record: Record) -> str | None:
    """A success rate: exact, or of many runs with its interval if it is not known."""
    known, many = record.result["exact"], record.result["many"]
    if known:
        return in_percent(known[what])
    return share_of_runs(many[what], many["runs"]) if what in many else None


def _rate(result: Result, what: str) -> float:
    """A success rate in per cent: exact, or of many runs if it is not known."""
    many, exact = result["many"], result["exact"]
    return 100 * float(exact[what] if exact else many[what] / many["runs"])


def _differences(records: Sequence[Record]) -> list[str]:
    if not records:
        return []
    gains = [_rate(r.result, "sentence") - _rate(r.result, "plan") for r in records]
    lower = [gain for gain in gains if gain < 0]
    worse = f"and on {len(lower)} of {len(records)} it loses" if lower else "and never loses"
    return [
        "**Robust navigation.** The paper gives neither its map nor its rates. On our maps a "
        f"sentence adds {min(gains):.1f} to {max(gains):.1f} points to the plan's success rate, "
        f"{worse}."
    ]


RECIPE = Recipe("navigation", "Robust navigation: a human in the way", units, run, section)
