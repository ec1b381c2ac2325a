# SPDX-License-Identifier: GPL-3.0-or-later
"""Table 1 of the paper: how many words the candidate tasks of a map need, by every method."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from statistics import median
from typing import Any

from coordlang.building import build_language
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
from coordlang.evaluation.material.brute_force import MOST_PAIRS, find_by_brute_force
from coordlang.evaluation.material.paper import TABLE_1
from coordlang.evaluation.material.state_orders import RANDOM_ORDERS, greedy_partitions
from coordlang.evaluation.material.suite import OTHERS, ROWS, WORLDS, World

#: A column: its name, the method, and whether only first differences count (alpha).
METHODS = (
    ("greedy", "greedy", True),
    ("least alpha", "separating", True),
    ("separating", "separating", False),
    ("minimal", "minimal", False),
    ("exhaustive", "exhaustive", False),
)
#: The columns with lower bounds.
PROVED = ("least alpha", "separating", "minimal")
QUICK = ("GW1", "GW2", "GWB5", "tray")
#: Seconds after which brute force is stopped.
BRUTE_SECONDS = 10.0
#: Seconds that the slow rows take with SAT, roughly; the others are done in a second or two.
_SLOW = {"GW4": 60.0, "GW3": 10.0, "GWB4": 8.0, "GWB3": 8.0}


def units(settings: Settings) -> list[Unit]:
    """List a unit for each world and method, and one for the greedy method in other orders."""
    found = []
    for world in (*ROWS, *OTHERS):
        if settings.quick and world.name not in QUICK:
            continue
        found += [
            _method_unit(world, column, settings)
            for column, method, _ in METHODS
            if method != "exhaustive" or world in ROWS
        ]
        orders = 10 if settings.quick else RANDOM_ORDERS
        parameters = {"world": world.name, "column": "orders", "orders": orders}
        found.append(Unit("table1", f"{world.name}/orders", parameters, world.files, 2.0))
    return found


def _method_unit(world: World, column: str, settings: Settings) -> Unit:
    method, alpha_only = next((m, alpha) for name, m, alpha in METHODS if name == column)
    parameters: dict[str, Any] = {
        "world": world.name,
        "column": column,
        "method": method,
        "alpha_only": alpha_only,
    }
    effort = 0.5 if method == "greedy" else _SLOW.get(world.name, 1.0)
    if method == "exhaustive":
        parameters["seconds"] = min(BRUTE_SECONDS, settings.unit_limit)
        effort = BRUTE_SECONDS
    return Unit("table1", f"{world.name}/{column}", parameters, world.files, effort)


def run(unit: Unit, settings: Settings) -> Result:
    """Build and verify one language, or count the words of the greedy method in many orders."""
    asked = unit.parameters
    candidates = WORLDS[asked["world"]].candidates(settings.domains)
    if asked["column"] == "orders":
        orders = greedy_partitions(candidates, asked["orders"], unit.random(settings.seed))
        return {"words": {name: int(words.max()) + 1 for name, words in orders}}
    if asked["method"] == "exhaustive":
        return find_by_brute_force(candidates, asked["seconds"], settings.seed)
    built = build_language(
        candidates,
        asked["method"],
        seed=settings.seed,
        alpha_only=asked["alpha_only"] and asked["method"] != "greedy",
    )
    guarantee = built.language.guarantee
    return {
        "tasks": candidates.count,
        "states": candidates.states,
        "divergences": len(built.first_differences.divergences),
        "requiring": built.first_differences.requiring,
        "words": guarantee.size,
        "lower_bound": guarantee.lower_bound,
        "proved_minimal": guarantee.proved_minimal,
        "verified": built.verdict.holds,
        "stopped": built.stopped is not None,
        "work": {name: int(value) for name, value in sorted(built.figures.items())},
    }


#: The records of a row or world by column.
_Columns = Mapping[str, Record]


def section(records: Sequence[Record]) -> Section:
    """Render the words and the seconds of all rows, and the words of other domains."""
    of: dict[str, dict[str, Record]] = {}
    for record in done(records):
        of.setdefault(record.parameters["world"], {})[record.parameters["column"]] = record
    rows = {world.name: of[world.name] for world in ROWS if "greedy" in of.get(world.name, {})}
    others = {w.name: of[w.name] for w in OTHERS if "greedy" in of.get(w.name, {})}
    alt = "Words of every row of Table 1, by method, beside the paper's"
    blocks: list[str | Figure] = [
        _DEFINITION,
        _words(rows),
        Figure("table1-words", alt, lambda: _figure(rows)),
        "Seconds of processor time, from the PDDL text to the verified language (the paper's on "
        "its"
        "author's machine):",
        _seconds(rows),
    ]
    stopped = [
        f"{name} {column} ({columns[column].result['words']} words so far)"
        for name, columns in of.items()
        for column in PROVED
        if column in columns and columns[column].result["stopped"]
    ]
    if stopped:
        blocks.append(f"Stopped by its limit before its proof was complete: {', '.join(stopped)}.")
    if others:
        blocks += ["Domains that are not grids, all tasks:", _words(others)]
    return Section(tuple(blocks), _differences(rows), tuple(_headlines(rows)))


def _headlines(rows: Mapping[str, _Columns]) -> Iterator[Headline]:
    for name, columns in rows.items():
        greedy, least = columns["greedy"].result["words"], _starred(columns.get("minimal"))
        yield f"{name}: words", f"{TABLE_1[name].words}", f"{greedy}", least or "–"


_DEFINITION = """\
Tasks and states must be exactly the paper's. *Greedy* is the paper's method: fill a word with every
state that still fits; beside it the least and the greatest number of words that it needs when the
states come in other orders. *Least alpha* is the least number of words that separate all first
differences, as greedy words do (`--method separating --alpha-only`); *separating* the least number
that separate first or last differences (Theorem 3); *minimal* the least number of words of any
partition, by definition; *exhaustive* the paper's brute force, where it ends. A star: proved to be
the least of its kind. Every language is verified by definition."""


def _words(rows: Mapping[str, _Columns]) -> str:
    """The table of words; the column of brute force is for the paper's rows only."""
    lines = []
    for name, columns in rows.items():
        greedy, orders = columns["greedy"].result, _in_orders(columns)
        line: list[object] = [name, greedy["tasks"], greedy["states"], greedy["divergences"]]
        line += [_paper_words(name), greedy["words"]]
        line.append(f"{min(orders)} to {max(orders)}" if orders else None)
        line += [_starred(columns.get(column)) for column in PROVED]
        if name in TABLE_1:
            brute = columns.get("exhaustive")
            line.append(brute.result["words"] if brute else None)
        lines.append(line)
    head = ["row", "tasks", "states", "divergences", "paper", "greedy", "greedy, orders", *PROVED]
    if any(name in TABLE_1 for name in rows):
        head.append("exhaustive")
    return table(head, lines)


def _paper_words(name: str) -> object:
    paper = TABLE_1.get(name)
    if paper is None:
        return None
    return f"{paper.words} (exact {paper.exact})" if paper.exact else paper.words


def _in_orders(columns: _Columns) -> list[int]:
    """The greedy method's numbers of words in all orders tried."""
    return list(columns["orders"].result["words"].values()) if "orders" in columns else []


def _starred(record: Record | None) -> str | None:
    if record is None:
        return None
    return f"{record.result['words']}{'*' * _proved(record)}"


def _proved(record: Record) -> bool:
    """Whether it is proved that no language of the method's kind has fewer words."""
    r = record.result
    separating = r["work"].get("separating_lower_bound") == r["words"] and not r["stopped"]
    return bool(r["proved_minimal"] or separating)


def _seconds(rows: Mapping[str, _Columns]) -> str:
    shown = ("greedy", *PROVED)
    lines = []
    for name, columns in rows.items():
        paper = TABLE_1[name]
        exact = f" (exact {paper.exact_seconds})" if paper.exact_seconds else ""
        seconds = [f"{columns[c].cpu:.2f}" if c in columns else None for c in shown]
        brute = _brute_seconds(columns.get("exhaustive"))
        lines.append([name, f"{paper.seconds:,.1f}{exact}", *seconds, brute])
    return table(("row", "paper", *shown, "exhaustive"), lines)


def _brute_seconds(record: Record | None) -> str | None:
    """The seconds of brute force, or why it has no result."""
    if record is None:
        return None
    return f"{record.cpu:.2f}" if record.result["words"] else str(record.result["why"])


def _figure(rows: Mapping[str, _Columns]) -> Any:
    def words(column: str) -> list[float | None]:
        found = [columns.get(column) for columns in rows.values()]
        return [record.result["words"] if record else None for record in found]

    orders = [_in_orders(columns) for columns in rows.values()]
    series = [
        Series("paper", "paper (greedy)", [TABLE_1[name].words for name in rows]),
        Series(
            "greedy",
            "greedy (line: other orders)",
            words("greedy"),
            [min(o) if o else None for o in orders],
            [max(o) if o else None for o in orders],
        ),
        *(Series(column, column, words(column)) for column in PROVED),
    ]
    return by_category(list(rows), series, "words")


def _differences(rows: Mapping[str, _Columns]) -> tuple[str, ...]:
    return (
        *_about_sizes(rows),
        *_about_orders(rows),
        *_about_alpha(rows),
        *_about_minimal(rows),
        *_about_brute_force(rows),
    )


def _about_sizes(rows: Mapping[str, _Columns]) -> Iterator[str]:
    wrong = []
    for name, columns in rows.items():
        greedy, paper = columns["greedy"].result, TABLE_1[name]
        if (greedy["tasks"], greedy["states"]) != (paper.tasks, paper.states):
            wrong.append(name)
    if wrong:
        yield f"**Tasks or states** differ from the paper's on {', '.join(wrong)}."


def _about_orders(rows: Mapping[str, _Columns]) -> Iterator[str]:
    other = {
        name: _in_orders(columns)
        for name, columns in rows.items()
        if columns["greedy"].result["words"] != TABLE_1[name].words
    }
    if not other:
        return
    text = (
        f"**Words of the greedy method** differ from the paper's on {len(other)} of {len(rows)} "
        f"rows ({', '.join(other)}). The result depends on the order of the states, which the "
        "paper does not give."
    )
    beyond = [
        name
        for name, words in other.items()
        if words and not min(words) <= TABLE_1[name].words <= max(words)
    ]
    if beyond:
        text += (
            f" On {', '.join(beyond)} the paper's number is outside of what "
            f"{len(other[beyond[0]])} orders gave."
        )
    yield text


def _about_alpha(rows: Mapping[str, _Columns]) -> Iterator[str]:
    below = []
    for name, columns in rows.items():
        least, paper = columns.get("least alpha"), TABLE_1[name].words
        if least and _proved(least) and paper < least.result["words"]:
            below.append(f"{name} ({paper} against {least.result['words']})")
    if below:
        yield (
            f"**Fewer words than alpha allows.** On {', '.join(below)} the paper's greedy method "
            "reports fewer words than any partition has that separates all first differences, as "
            "is proved. So its condition must be a weaker one there; if last differences count, "
            "too, fewer words are possible."
        )


def _about_minimal(rows: Mapping[str, _Columns]) -> Iterator[str]:
    ratios = [
        TABLE_1[name].words / columns["minimal"].result["words"]
        for name, columns in rows.items()
        if "minimal" in columns
    ]
    if ratios:
        exact = " and ".join(name for name, paper in TABLE_1.items() if paper.exact)
        yield (
            f"**The least number of words** is {min(ratios):.1f} to {max(ratios):.1f} times "
            f"smaller than the paper's (median {median(ratios):.1f}), which has an exact value for "
            f"{exact} only."
        )


def _about_brute_force(rows: Mapping[str, _Columns]) -> Iterator[str]:
    brute = [columns.get("exhaustive") for columns in rows.values()]
    unfinished = [record for record in brute if record and record.result["words"] is None]
    if unfinished:
        yield (
            f"**Brute force** ends within {BRUTE_SECONDS:g} s on {len(rows) - len(unfinished)} of "
            f"{len(rows)} rows; where the tasks have more than {MOST_PAIRS:,} pairs of optimal "
            "plans in total, it is not started."
        )


RECIPE = Recipe("table1", "Table 1: how many words", units, run, section)
