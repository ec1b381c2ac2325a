"""Robust navigation: a human stands in the way, seen only once execution has started.

Robots deliver in a warehouse (`coordlang.evaluation.material.warehouse`).  For all tasks of a
delivery plans or sentences are agreed on before anybody moves.  Then a human is seen, in a random
cell that is no corner, who stays there.  A plan fails if any robot would enter that cell.  Under a
sentence each robot picks among its own choices.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from random import Random
from typing import Any

from coordlang.evaluation.lab.plots import Series, by_category
from coordlang.evaluation.lab.recipe import (
    Figure,
    Recipe,
    Record,
    Result,
    Section,
    Settings,
    Unit,
    done,
    percent,
    table,
)
from coordlang.evaluation.lab.statistics import wilson
from coordlang.evaluation.material.disruption_trials import subaction_trials, warehouse_trials
from coordlang.evaluation.material.languages import TITLES, language_for
from coordlang.evaluation.material.suite import OTHERS, WORLDS
from coordlang.evaluation.material.warehouse import LAYOUTS, WAREHOUSES, deliveries, listed_tasks

METHODS = ("greedy", "separating", "minimal")
#: Languages that are not found within minutes: an unfinished one would depend on the machine.
UNFINISHED = {
    *(
        (f"open {size}", layout, method)
        for size in ("4x4", "5x5")
        for layout in LAYOUTS
        for method in METHODS[1:]
    ),
    *((f"ring {size}", "along", "minimal") for size in ("3x4", "3x5", "4x4")),
    ("ring 3x5", "across", "minimal"),
}


def units(settings: Settings) -> list[Unit]:
    """The pieces of work, with all their parameters."""
    found = []
    for name, (world, _, _) in WAREHOUSES.items():
        if settings.quick and name not in ("open 3x3", "ring 3x4"):
            continue
        for layout in LAYOUTS:
            for method in METHODS:
                if (name, layout, method) in UNFINISHED:
                    continue
                parameters = {
                    "warehouse": name,
                    "layout": layout,
                    "method": method,
                    "samples": settings.samples,
                }
                effort = 30.0 if name == "open 5x5" else 5.0
                found.append(
                    Unit("navigation", f"{name}/{layout}/{method}", parameters, world.files, effort)
                )
    for world in OTHERS[: 1 if settings.quick else None]:
        for method in METHODS:
            parameters = {"world": world.name, "method": method, "samples": settings.samples}
            found.append(
                Unit("navigation", f"{world.name}/{method}", parameters, world.files, 10.0)
            )
    return found


def run(unit: Unit, settings: Settings) -> Result:
    """One piece of work, as JSON data."""
    asked = unit.parameters
    if "world" in asked:
        candidates, language = language_for(WORLDS[asked["world"]], asked["method"], settings)
        trials = subaction_trials(candidates, language)
    else:
        world, rows, columns = WAREHOUSES[asked["warehouse"]]
        every = deliveries(rows, columns, asked["layout"])
        candidates, language = language_for(world, asked["method"], settings, listed_tasks(every))
        trials = warehouse_trials(candidates, language, every)
    random = Random(
        f"{settings.seed} {unit.key.rsplit('/', 1)[0]}"
    )  # the same draws for every language
    return {
        "words": len(language.words),
        "trials": len(trials.trials),
        "exact": trials.exact(),
        "few": trials.sample(settings.samples, random),
        "many": trials.sample(settings.many, random),
    }


def section(records: Sequence[Record]) -> Section:
    """The results, as this section of the page."""
    found = done(records)
    mine = [r for r in found if "warehouse" in r.unit.parameters]
    others = [r for r in found if "world" in r.unit.parameters]
    blocks: list[str | Figure] = [_DEFINITION]
    for layout in LAYOUTS:
        here = [r for r in mine if r.unit.parameters["layout"] == layout]
        if not here:
            continue
        blocks += [
            f"Deliveries {layout} the warehouse:",
            _table(here),
            Figure(
                f"navigation-{layout}",
                f"Success rates of deliveries {layout} the warehouse under an agreed plan and "
                "under sentences, by map",
                partial(_drawn, here),
            ),
        ]
    if others:
        blocks += [_OTHERS, _table(others)]
    return Section(tuple(blocks), _differences(mine))


_DEFINITION = """\
Two robots on a map whose corners are storage (S1, S2, left) and dispatch (D1, D2, right). They start in random corners;
robot i fetches at Si and brings to Di, or back. That is two tasks one after the other, both agreed on before anybody moves.
Then a human is seen in a random cell that is no corner, and stays. The agreed plan fails if a robot would enter that cell.
Under the sentence of the same plan each robot picks among its own choices only (what `coordlang choices` leaves it), without
looking at the other robot or speaking again; it fails if none of its choices avoids the cell. *Exact* is over all starts,
directions, cells and plans, where the sentences are not too many; *possible* is what robots could reach that agree anew, on
any optimal plan. In brackets 95 % intervals (Wilson). Plan and sentence get the same draws. The map, its size and the place
of the corners are our choice: maps are full rectangles (*open*) or their border cells (*ring*); *across* puts D1 opposite S1,
so that the deliveries cross, *along* on the same side."""

_OTHERS = """\
Worlds that are no grids. There one subaction, drawn from those that optimal plans of the task use, turns out to be impossible
when execution starts. All tasks, one each:"""


def _table(records: Sequence[Record]) -> str:
    rows = []
    for record in records:
        r, asked = record.result, record.unit.parameters
        few, many, exact = r["few"], r["many"], r["exact"]
        rows.append(
            [
                f"{asked.get('warehouse', asked.get('world'))}, {TITLES[asked['method']]}",
                r["words"],
                f"{few['plan']} / {few['runs']}",
                f"{few['sentence']} / {few['runs']}",
                _share(many["plan"], many["runs"]),
                _share(many["sentence"], many["runs"]),
                *(
                    percent(exact[what]) if exact else None
                    for what in ("plan", "sentence", "possible")
                ),
            ]
        )
    runs = f"{records[0].result['many']['runs']:,}"
    head = (
        "map, language",
        "words",
        "plan",
        "sentence",
        f"plan, {runs} runs",
        f"sentence, {runs} runs",
        "plan, exact",
        "sentence, exact",
        "possible",
    )
    return table(head, rows)


def _share(successes: int, runs: int) -> str:
    low, high = wilson(successes, runs)
    return f"{percent(successes / runs)} ({100 * low:.1f} to {100 * high:.1f})"


def _drawn(records: Sequence[Record]) -> Any:
    maps = list(dict.fromkeys(r.unit.parameters["warehouse"] for r in records))
    of = {(r.unit.parameters["warehouse"], r.unit.parameters["method"]): r.result for r in records}

    def series(kind: str, label: str, method: str, what: str) -> Series:
        found = [of.get((name, method)) for name in maps]
        ends = [wilson(r["few"][what], r["few"]["runs"]) if r else (None, None) for r in found]
        return Series(
            kind,
            label,
            [100 * r["few"][what] / r["few"]["runs"] if r else None for r in found],
            [100 * low if low is not None else None for low, _ in ends],
            [100 * high if high is not None else None for _, high in ends],
            [100 * r["exact"][what] if r and r["exact"] else None for r in found],
        )

    shown = [series("plan", "plan", "greedy", "plan")]
    shown += [series(m, f"sentence, {TITLES[m]}", m, "sentence") for m in METHODS]
    few = records[0].result["few"]["runs"]
    return by_category(maps, shown, f"success rate (%), {few} runs; line: 95 %")


def _rate(result: Result, what: str) -> float:
    """A success rate in per cent: exact, or of many runs where it is not known."""
    many, exact = result["many"], result["exact"]
    return 100 * float(exact[what] if exact else many[what] / many["runs"])


def _differences(records: Sequence[Record]) -> tuple[str, ...]:
    if not records:
        return ()
    gains = [_rate(r.result, "sentence") - _rate(r.result, "plan") for r in records]
    lower = [gain for gain in gains if gain < 0]
    text = (
        "**Robust navigation.** The paper's map and rates are not known to us, so nothing can be "
        "compared. On our maps a "
        f"sentence adds {min(gains):.1f} to {max(gains):.1f} points to the plan's success rate"
    )
    return (
        text
        + (f", and on {len(lower)} of {len(records)} it loses." if lower else ", and never loses."),
    )


RECIPE = Recipe("navigation", "Robust navigation: a human in the way", units, run, section)
