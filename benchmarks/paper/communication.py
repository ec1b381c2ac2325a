# SPDX-License-Identifier: GPL-3.0-or-later
"""How much shorter a sentence is than the plan that it describes."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any

from benchmarks.paper.plots import Series, per_task
from benchmarks.paper.recipe import Figure, Recipe, Record, Result, Section, Settings, Unit
from benchmarks.paper.reported import DIFFERING, SAVING_ALL, SAVING_DIFFERING
from benchmarks.paper.sentences import MOST_LISTED, Comparison, compare, comparison_units
from benchmarks.paper.suite import TITLES, method_of
from benchmarks.paper.tables import elsewhere, in_percent, percent, rounded_mean, table
from coordlang.language.sentences import Flexibility
from planners.joint.tables import Floats

#: Tasks that the paper's figure shows.
SHOWN = 100


def run(unit: Unit, settings: Settings) -> Result:
    """Measure the savings of one language, or those of the greedy method in many orders."""
    return compare(unit, settings, measures, _of_order)


def _of_order(found: Flexibility) -> list[float]:
    saving = _first_saving(found)
    return [int((saving > 0).sum()), round(float(saving.mean()), 6)]


def _first_saving(found: Flexibility) -> Floats:
    """The saving of the first plan of each task: the share of its states that need no word."""
    return 1 - found.first_words / (found.steps + 1)


def measures(found: Flexibility) -> Result:
    """Return the mean savings of the tasks' first plans, and of a plan drawn uniformly.

    ``differing``: tasks whose first plan's sentence is shorter than its state sequence.
    """
    first = _first_saving(found)
    shorter = first[first > 0]
    return {
        "tasks": len(first),
        "differing": len(shorter),
        "saving_differing": rounded_mean(shorter, 6),
        "saving": rounded_mean(first, 6),
        "saving_expected": rounded_mean(found.saving, 6),
        "states": (found.steps + 1).tolist()[:MOST_LISTED],
        "first_words": found.first_words.astype(int).tolist()[:MOST_LISTED],
    }


def section(records: Sequence[Record]) -> Section:
    """Render the savings by method, and the paper's figure."""
    found = Comparison.of(records)
    row = found.row
    paper = ["paper", 4, f"{DIFFERING} of 956", *map(in_percent, (SAVING_DIFFERING, SAVING_ALL))]
    above = [[*paper, None]] if found.of_paper else []
    blocks: list[str | Figure] = [
        f"{_DEFINITION}{row}.",
        table("language", method_of, _COLUMNS, found.languages, above),
    ]
    if found.languages:
        alt = f"Lengths of plans and shorter sentences of {SHOWN} tasks of {row}"
        blocks.append(Figure("communication-tasks", alt, partial(_first_tasks, found.languages)))
    others = elsewhere({"saving": _COLUMNS["saving, all"]}, found.others)
    return Section(blocks, _differences(found), _headlines(found.of_paper), others)


_COLUMNS = {
    "words": lambda r: r.result["words"],
    "sentence shorter": lambda r: f"{r.result['differing']:,} of {r.result['tasks']:,}",
    "saving there": lambda r: (
        in_percent(r.result["saving_differing"]) if r.result["differing"] else None
    ),
    "saving, all": lambda r: in_percent(r.result["saving"]),
    "any plan": lambda r: in_percent(r.result["saving_expected"]),
}

_DEFINITION = f"""\
The *communication saving* of a plan is `1 - words / states`: only if states are counted do the
paper's two values agree ({percent(SAVING_DIFFERING)} over {DIFFERING} tasks, \
{percent(SAVING_ALL)} over all 956). The saving is
that of each task's first plan; *any plan*: in expectation. Measured in percent on """


def _headlines(of: dict[str, Result]) -> list[tuple[str, str, str, str]]:
    if not {"greedy", "minimal"} <= of.keys():
        return []
    both = of["greedy"], of["minimal"]
    all_tasks, shorter = (
        [percent(r[what]) for r in both] for what in ("saving", "saving_differing")
    )
    number = [str(r["differing"]) for r in both]
    return [
        ("saving, all tasks", percent(SAVING_ALL), all_tasks[0], all_tasks[1]),
        ("saving where shorter", percent(SAVING_DIFFERING), shorter[0], shorter[1]),
        ("tasks with a shorter sentence", f"{DIFFERING}", number[0], number[1]),
    ]


def _first_tasks(records: Sequence[Record]) -> Any:
    reference = records[0].result
    lengths = zip(reference["states"], reference["first_words"], strict=True)
    shown = [n for n, (states, words) in enumerate(lengths) if words < states][:SHOWN]
    of = {record.parameters["method"]: record.result["first_words"] for record in records}
    series = [
        Series(method, TITLES[method], [of[method][n] for n in shown])
        for method in ("greedy", "minimal")
        if method in of
    ]
    return per_task([reference["states"][n] for n in shown], series, "length (states; words)")


def _differences(found: Comparison) -> list[str]:
    if "greedy" not in found.of_paper:
        return []
    text = (
        "**Communication.** The saving depends on the order of the states and on which plan is the "
        "first; the paper gives neither."
    )
    if found.orders:
        savings = [saving for _, saving in found.orders.values()]
        inside = min(savings) <= SAVING_ALL <= max(savings)
        reached = "the paper's value is in this range" if inside else "none gives the paper's value"
        text += (
            f" {len(savings)} orders give {percent(min(savings))} to {percent(max(savings))}; "
            f"{reached}."
        )
    return [text]


RECIPE = Recipe(
    "communication",
    "Communication: plans and sentences",
    partial(comparison_units, "communication"),
    run,
    section,
)
