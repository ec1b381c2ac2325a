# SPDX-License-Identifier: GPL-3.0-or-later
"""Table 1 of the paper: how many words the candidate tasks of a map need, by every method."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from statistics import median
from typing import Any

from benchmarks.frame import markdown
from benchmarks.paper.plots import Series, by_category
from benchmarks.paper.recipe import Figure, Recipe, Record, Result, Section, Settings, Unit
from benchmarks.paper.reported import TABLE_1
from benchmarks.paper.state_orders import RANDOM_ORDERS, greedy_partitions
from benchmarks.paper.suite import METHODS as COMPARED
from benchmarks.paper.suite import OTHERS, ROWS, WORLDS, World
from benchmarks.paper.tables import by_world
from coordlang.commands.building import build_language

#: A column, the method, and whether only first differences count (alpha).
METHODS = {
    "greedy": ("greedy", True),
    "least alpha": ("separating", True),
    "separating": ("separating", False),
    "minimal": ("minimal", False),
}
#: The columns with lower bounds.
PROVED = ("least alpha", "separating", "minimal")
QUICK = ("GW1", "GW2", "GWB5", "tray")


def units(settings: Settings) -> list[Unit]:
    """List a unit for each world and method, and one for the greedy method in other orders."""
    found = []
    for world in (*ROWS, *OTHERS):
        if not settings.quick or world.name in QUICK:
            found += [_unit(world, column, settings) for column in (*METHODS, "orders")]
    return found


def _unit(world: World, column: str, settings: Settings) -> Unit:
    parameters: dict[str, Any] = {"world": world.name, "column": column}
    if column == "orders":
        parameters["orders"] = 10 if settings.quick else RANDOM_ORDERS
    else:
        method, alpha_only = METHODS[column]
        parameters |= {"method": method, "alpha_only": alpha_only}
    return Unit("table1", f"{world.name}/{column}", parameters)


def run(unit: Unit, settings: Settings) -> Result:
    """Build and verify one language, or count the words of the greedy method in many orders."""
    asked = unit.parameters
    candidates = WORLDS[asked["world"]].candidates()
    if asked["column"] == "orders":
        orders = greedy_partitions(candidates, asked["orders"], unit.random(settings.seed))
        return {"words": {name: int(words.max()) + 1 for name, words in orders}}
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
        "divergences": len(built.job.first_differences.listed),
        "requiring": built.job.first_differences.requiring,
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
    """Render the words and the seconds of all rows."""
    of = {
        world: {record.parameters["column"]: record for record in here}
        for world, here in by_world(records).items()
        if any(record.parameters["column"] == "greedy" for record in here)
    }
    rows = {name: columns for name, columns in of.items() if name in TABLE_1}
    alt = "Words of every row of Table 1, by method"
    blocks: list[str | Figure] = [
        _DEFINITION,
        _words(rows),
        Figure("table1-words", alt, lambda: _figure(rows)),
        "Seconds of processor time, from PDDL to the verified language:",
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
    return Section(blocks, list(_differences(rows)), elsewhere=_elsewhere(of))


_DEFINITION = """\
Tasks and states are exactly the paper's. *Greedy*: fill a word with every state that still fits;
*orders*: the range over other orders of the states. *Least alpha*: fewest words that separate all
first differences. *Separating*: that separate first or last differences (Theorem 3). *Minimal*:
fewest words of any partition. A star: proved the least of its kind. Every language is verified by
definition."""


def _words(rows: Mapping[str, _Columns]) -> str:
    """The table of words."""
    lines = []
    for name, columns in rows.items():
        greedy, orders = columns["greedy"].result, _in_orders(columns)
        paper = TABLE_1[name]
        exact = f" (exact {paper.exact})" if paper.exact else ""
        line: list[object] = [name, greedy["tasks"], greedy["states"], greedy["divergences"]]
        line += [f"{paper.words}{exact}", greedy["words"]]
        line.append(f"{min(orders)} to {max(orders)}" if orders else None)
        lines.append([*line, *(_starred(columns.get(column)) for column in PROVED)])
    head = ("row", "tasks", "states", "divergences", "paper", "greedy", "greedy, orders", *PROVED)
    return markdown(head, lines)


def _elsewhere(of: Mapping[str, _Columns]) -> dict[str, dict[str, object]]:
    """Tasks and words of the other worlds."""
    found: dict[str, dict[str, object]] = {"tasks": {}, "words": {}}
    for name, columns in of.items():
        for method in COMPARED if name not in TABLE_1 else ():
            if method in columns:
                found["tasks"][f"{name}, {method}"] = columns[method].result["tasks"]
                found["words"][f"{name}, {method}"] = _starred(columns[method])
    return found


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
        lines.append([name, f"{paper.seconds:,.1f}{exact}", *seconds])
    return markdown(("row", "paper", *shown), lines)


def _figure(rows: Mapping[str, _Columns]) -> Any:
    def words(column: str) -> list[float | None]:
        found = [columns.get(column) for columns in rows.values()]
        return [record.result["words"] if record else None for record in found]

    orders = [_in_orders(columns) for columns in rows.values()]
    low, high = ([end(o) if o else None for o in orders] for end in (min, max))
    series = [
        Series("paper", "paper (greedy)", [TABLE_1[name].words for name in rows]),
        Series("greedy", "greedy (line: other orders)", words("greedy"), low, high),
        *(Series(column, column, words(column)) for column in PROVED),
    ]
    return by_category(list(rows), series, "words")


def _differences(rows: Mapping[str, _Columns]) -> Iterator[str]:
    yield from _about_orders(rows)
    yield from _about_alpha(rows)
    ratios = [
        TABLE_1[name].words / columns["minimal"].result["words"]
        for name, columns in rows.items()
        if "minimal" in columns
    ]
    if ratios:
        exact = " and ".join(name for name, paper in TABLE_1.items() if paper.exact)
        yield (
            f"**The least number of words** is {min(ratios):.1f} to {max(ratios):.1f} times "
            f"smaller than the paper's (median {median(ratios):.1f}), which is exact for {exact} "
            "only."
        )


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
        f"rows ({', '.join(other)}). The words depend on the order of the states, which the paper "
        "does not give."
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
            "reports fewer words than any partition has that separates all first differences "
            "(proved). So its condition must be weaker there."
        )


RECIPE = Recipe("table1", "Table 1: how many words", units, run, section)
